"""A small copy of the look-up table, for a microcontroller: at most 150 kB of numbers.

It has one member of each ensemble. Two tails and more, where the table is most exact, are in single precision. The
rest is in half precision: one tail (but for its last layer), the gap, and the response to flips with equal dwells.
What this loses against the whole table is measured on random robots and written into the file. Left out: effects,
intervals, the memory of other dwells, and the joint support (only the ranges of the inputs and the limit of the
yaw rate are checked). Its files, in a folder:

    lookup.safetensors  the numbers; its metadata has a manifest in JSON: domain, units, losses, which table it is
    lookup_weights.h    the same numbers for C
    lookup.h            a reader in C99
    vectors.csv         robots and answers, to test a reader with; NaN where a reader has no answer
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import safetensors.numpy

from sim.arrays import Flags, Floats
from sim.inputs import check_columns
from sim.io.errors import InputError
from sim.io.files import files_together, write_text
from sim.io.keywords import checks_keywords
from sim.model.groups import DWELL
from sim.model.response import DWELLS
from sim.motion.steady_motion import STEADY_OUTPUTS
from surrogate.domain import ROBOT
from surrogate.errors import COMPARED, RESPONSE_OUTPUTS, error_scale, relative_errors
from surrogate.interface import LookupTable
from surrogate.motions import WrenchTable
from surrogate.network import SHARED, Ensemble
from surrogate.response import Basis, put_flips
from surrogate.table import NeuralTable
from surrogate.table_file import trained_table
from surrogate.training.simulated import draw_robots

MAX_BYTES = 150_000
NETWORKS = ("one_tail", "two_tails", "more_tails", "gap", "lag", "memory")
_TRIED, _SEED = 4096, 20
_VECTORS = 48
_MAX_COMPONENTS = 30  # of the curves
_MANIFEST_BYTES = 12_000  # room for the header of the file

Arrays = dict[str, Any]  # by name, single or half precision


@dataclass(frozen=True)
class SmallCopy:
    """The small copy: its numbers, and the table that they make."""

    arrays: Arrays  # network.part, curves.mean, curves.basis
    table: NeuralTable  # with the same numbers in double precision; its curves are not used

    @property
    def bytes(self) -> int:
        """Bytes of the numbers."""
        return sum(array.nbytes for array in self.arrays.values())

    def query(self, columns: Mapping[str, Floats]) -> dict[str, Floats]:
        """Return what a reader answers, in double precision; with a column `dwell_bar` also the response to flips.

        Args:
            columns: robots without effects, each (M,).
        """
        values = check_columns({name: array for name, array in columns.items() if name != DWELL})
        motions = self.table.solve(values)
        result = motions.steady
        if DWELL in columns:
            parts = [_network(self.arrays, name) for name in NETWORKS[4:]]
            basis = Basis(*(self.arrays[f"curves.{name}"].astype(float) for name in ("mean", "basis")))
            put_flips(parts, basis, motions, columns[DWELL])
            answers = zip(RESPONSE_OUTPUTS, motions.outputs[len(result) :], strict=True)
            result |= {name: np.where(values["N"] > 1, answer, np.nan) for name, answer in answers}
        return result


def make_small_copy(table: NeuralTable) -> SmallCopy:
    """Make the small copy of a table.

    Raises:
        InputError: it does not fit into MAX_BYTES.
    """
    arrays: Arrays = {}
    for name, network in zip(NETWORKS, (*table.tails.wrench, table.tails.gap), strict=False):
        if network is not None:
            half, last_exact = name not in NETWORKS[1:3], name == "one_tail"
            arrays |= _arrays(name, network.member(0), half=half, last_exact=last_exact)
    arrays |= _curve_arrays(table)
    wrench = [
        network and _network(arrays, name) for name, network in zip(NETWORKS, table.tails.wrench, strict=False)
    ]
    small = SmallCopy(arrays, replace(table, tails=WrenchTable(tuple(wrench), _network(arrays, "gap"))))
    if small.bytes > MAX_BYTES - _MANIFEST_BYTES:
        raise InputError(
            f"the networks of this look-up table are too large for {MAX_BYTES / 1000:.0f} kB; train narrower ones"
        )
    return small


def measure_losses(table: NeuralTable, small: SmallCopy) -> dict[str, dict[str, float]]:
    """Measure the median and 95th percentile of the small copy's difference from the table, by output.

    Relative as in `surrogate.errors`, over random robots of the domain with two tails and more; for one tail
    the names end with "one_tail".
    """
    robots = _robots(_TRIED, _SEED)
    wanted_steady, answer = table.query(_without_dwells(robots), flag=True), small.query(robots)
    inside, several = _known(table, small, robots), robots["N"] > 1
    losses: dict[str, dict[str, float]] = {}
    parts = [("", inside & several), (" one_tail", inside & ~several)]
    for words, rows in parts:
        errors = relative_errors(
            {k: v[rows] for k, v in answer.items()}, {k: v[rows] for k, v in wanted_steady.items()}
        )
        losses |= {f"{name}{words}": _figures(errors[name]) for name in COMPARED}
    if (inside & several).any():
        rows = inside & several
        wanted = table.query({k: v[rows] for k, v in robots.items()}, flag=True)
        errors = {n: (answer[n][rows] - wanted[n]) / error_scale(n, wanted) for n in RESPONSE_OUTPUTS}
        losses |= {name: _figures(errors[name]) for name in RESPONSE_OUTPUTS}
    return {name: figures for name, figures in losses.items() if figures}


def make_vectors(table: NeuralTable, small: SmallCopy) -> dict[str, Floats]:
    """Draw robots of the domain with both directions and every N; let the small copy answer; NaN: no answer."""
    robots = {
        name: np.array([float(f"{v:.5g}") for v in values]) for name, values in _robots(4 * _VECTORS, 21).items()
    }
    inside = _known(table, small, robots)
    chosen = {name: values[inside][:_VECTORS] for name, values in robots.items()}
    return chosen | small.query(chosen)


def _known(table: NeuralTable, small: SmallCopy, robots: Mapping[str, Floats]) -> Flags:
    """Tell which robots are inside the domain for the table and for the small copy, (M,)."""
    groups = _without_dwells(robots)
    outside = [each.query(groups, flag=True)["outside"] for each in (table, small.table)]
    return np.asarray(~(outside[0] | outside[1]))


def _without_dwells(robots: Mapping[str, Floats]) -> dict[str, Floats]:
    return {name: values for name, values in robots.items() if name != DWELL}


def _robots(count: int, seed: int) -> dict[str, Floats]:
    """Return random robots of the domain, half of them with a reversed motor, with dwells."""
    robots = {
        name: np.array(values) for name, values in draw_robots(count, seed, wide=False).items() if name in ROBOT
    }
    robots = {name: robots[name] for name in ROBOT}
    random = np.random.default_rng(seed)
    dwells = 0.25 * 12 ** random.uniform(size=count)
    robots["omega_bar"] *= np.where(random.uniform(size=count) < 0.5, -1, 1)
    return robots | {DWELL: dwells}


def _figures(apart: Floats) -> dict[str, float]:
    size = np.abs(apart[np.isfinite(apart)])
    return {"median": float(np.median(size)), "p95": float(np.quantile(size, 0.95))} if len(size) else {}


def _arrays(
    name: str, network: Ensemble, *, half: bool, last_exact: bool = False, outputs: int | None = None
) -> Arrays:
    """Return the numbers of a network of one member, without the axis of members; the first `outputs` only.

    What members share is in single precision always.

    Args:
        last_exact: its last layer is in single precision in any case.
    """
    last = [f"{kind}.{network.shape['depth']}" for kind in ("weights", "biases")]
    exact = (*SHARED, *last) if last_exact else SHARED
    arrays: Arrays = {}
    for part, array in network.state.items():
        values = array if part in SHARED else array[0]
        if part in ("bypass", "mean", "spread", *last):
            values = values[..., :outputs]
        kind = np.float16 if half and part not in exact else np.float32
        arrays[f"{name}.{part}"] = np.ascontiguousarray(values, dtype=kind)
    return arrays


def _curve_arrays(table: NeuralTable) -> Arrays:
    """Return networks and curves of the response to flips with equal dwells."""
    mean, vectors = table.curves.equal_dwells
    of_lag = len(table.curves.bases["lag"].vectors)
    count = min(of_lag, len(vectors) - of_lag, _MAX_COMPONENTS)
    arrays: Arrays = {}
    for name, network in zip(NETWORKS[4:], table.curves.networks[:2], strict=True):
        arrays |= _arrays(name, network.member(0), half=True, outputs=count)
    kept = np.concatenate([vectors[:count], vectors[of_lag : of_lag + count]])
    return arrays | {"curves.mean": mean.astype(np.float32), "curves.basis": kept.astype(np.float16)}


def network_depth(arrays: Arrays, name: str) -> int:
    return sum(part.startswith(f"{name}.weights.") for part in arrays) - 1


def _network(arrays: Arrays, name: str) -> Ensemble:
    """Return the network of a name, in double precision."""
    state = {part.removeprefix(f"{name}."): array.astype(float) for part, array in arrays.items()
             if part.startswith(f"{name}.")}  # fmt: skip
    return Ensemble.from_state({part: value if part in SHARED else value[None] for part, value in state.items()})


READERS = Path(__file__).parent / "readers"
FORMAT = 1
_UNITS = {
    "C_t": "1", "C_r": "1", "C_yr": "1", "l_over_R": "1", "L_over_R": "1", "l_over_r0": "1",
    "omega_bar": "EI/(mu0 l^4), signed", "N": "1, a whole number", "a_over_R": "1", DWELL: "mu0 l^4/EI",
    "omega_t_bar": "EI/(mu0 l^4)", "omega_h_bar": "EI/(mu0 l^4)", "omega_yr_bar": "EI/(mu0 l^4)",
    "v_x": "EI/(mu0 l^3)", "v_z": "EI/(mu0 l^3)", "R_yr_over_l": "l", "theta_deg": "degree", "tail_gap": "2 r0",
    "net_speed_bar": "EI/(mu0 l^3)", "lag_psi_rad": "rad", "lag_x": "l", "lag_z": "l",
}  # fmt: skip


@checks_keywords
def export(folder: str | Path, *, lookup: LookupTable | str | Path | None = None) -> str:
    """Write a trained look-up table for other programs: at most 150 kB, with a reader in C99; all files or none.

    Args:
        folder: it is made if it is missing.
        lookup: a trained table, or its file; default: the one that comes with the package.

    Returns:
        What the copy loses in accuracy, in words.

    Raises:
        InputError: the table is that of one robot or too large, or the files cannot be written.

    Example:
        >>> import tempfile
        >>> import softflagella as sf
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     print(sf.export(folder)[:3])
        148
    """
    table = trained_table(lookup)
    small = make_small_copy(table)
    losses = measure_losses(table, small)
    vectors = make_vectors(table, small)
    manifest = json.dumps(_manifest(table, small, losses))
    data = safetensors.numpy.save(small.arrays, {"manifest": manifest})
    readers = {reader.name: reader.read_text() for reader in sorted(READERS.iterdir())}
    lines = [
        ",".join(vectors),
        *(",".join(repr(float(v)) for v in row) for row in zip(*vectors.values(), strict=True)),
    ]
    with files_together(folder, ("lookup.safetensors", "lookup_weights.h", *readers, "vectors.csv")) as temporary:
        (temporary / "lookup.safetensors").write_bytes(data)
        write_text(temporary / "lookup_weights.h", weights_header(table, small, losses))
        for name, text in readers.items():
            write_text(temporary / name, text)
        write_text(temporary / "vectors.csv", "\n".join(lines) + "\n")
    rows = [f"{name:<24}{f['median']:10.1e}{f['p95']:10.1e}" for name, f in losses.items()]
    return "\n".join([f"{len(data) / 1000:.1f} kB; loss against the whole table: median, 95 %", *rows])


def weights_header(table: NeuralTable, small: SmallCopy, losses: Mapping[str, Mapping[str, float]]) -> str:
    """Write lookup_weights.h: the numbers as arrays of C."""
    arrays, lines, networks = small.arrays, [], []
    for name, array in arrays.items():
        kind = "float" if array.dtype == np.float32 else "uint16_t"
        lines.append(f"static const {kind} lookup_{name.replace('.', '_')}[{array.size}] = {{{_listed(array)}}};")
    present = [name for name in NETWORKS if f"{name}.bypass" in arrays]
    depth = max(network_depth(arrays, name) for name in present)
    for name in NETWORKS:
        if name not in present:
            networks.append("{0, 0, 0, 0, 0, 0, 0, 0, 0, 0, {0}, {0}, 0}")
            continue
        layer_count, prefix = network_depth(arrays, name), f"lookup_{name}_"
        inputs, outputs = arrays[f"{name}.bypass"].shape
        width = arrays[f"{name}.weights.0"].shape[1]
        half, half_last = (int(arrays[f"{name}.weights.{k}"].dtype == np.float16) for k in (0, layer_count))
        exact = ", ".join(prefix + part for part in SHARED)
        layers = [
            ", ".join(f"{prefix}{part}_{i}" for i in range(layer_count + 1)) for part in ("weights", "biases")
        ]
        networks.append(
            f"{{{inputs}, {outputs}, {width}, {layer_count}, {half}, {half_last}, {exact},\n"
            f"     {{{layers[0]}}},\n     {{{layers[1]}}}, {prefix}bypass}}"
        )
    widest = max(arrays[f"{name}.weights.0"].shape[1] for name in present)
    outputs = max(arrays[f"{name}.bypass"].shape[1] for name in NETWORKS[:4] if name in present)
    inputs = max(16, *(arrays[f"{name}.bypass"].shape[0] for name in present))
    ends = [[table.ranges[name][side] for name in ROBOT] for side in (0, 1)]
    components, dwells = arrays["lag.bypass"].shape[1], ", ".join(map(repr, DWELLS.tolist()))
    lines.append(f"static const double lookup_dwells[{len(DWELLS)}] = {{{dwells}}};")
    numbers = "\n".join(lines).replace("lookup_curves_", "lookup_curve_")
    network_list = ",\n    ".join(networks)
    loss_lines = "\n".join(f"   {name}: {f['median']:.1e}, {f['p95']:.1e}" for name, f in losses.items())
    return f"""/* Numbers of a small look-up table, for lookup.h; written by softflagella.
   Table {table.identity}; {small.bytes} bytes. Loss against the whole table, median and 95 %:
{loss_lines} */
#ifndef LOOKUP_WEIGHTS_H
#define LOOKUP_WEIGHTS_H

#include <stdint.h>

#define LOOKUP_TABLE "{table.identity}"
#define LOOKUP_WIDTH {widest}
#define LOOKUP_DEPTH {depth}
#define LOOKUP_INPUTS {inputs}
#define LOOKUP_OUTPUTS {outputs}
#define LOOKUP_COMPONENTS {components}
#define LOOKUP_DWELLS {len(DWELLS)}

typedef struct {{
    int inputs, outputs, width, depth;
    int half, half_last; /* weights (of the last layer) are 16-bit floats, else 32-bit ones */
    const float *shift, *scale, *mean, *spread;
    const void *weights[LOOKUP_DEPTH + 1], *biases[LOOKUP_DEPTH + 1], *bypass; /* row by row: input, output */
}} lookup_network;

/* ranges of {", ".join(ROBOT)} */
static const float lookup_low[9] = {{{_listed(np.array(ends[0], dtype=np.float32))}}};
static const float lookup_high[9] = {{{_listed(np.array(ends[1], dtype=np.float32))}}};
{numbers}

static const lookup_network lookup_networks[{len(networks)}] = {{
    {network_list}}};

#endif
"""


def _manifest(table: NeuralTable, small: SmallCopy, losses: Mapping[str, Any]) -> dict[str, Any]:
    return {
        "format": FORMAT,
        "table": table.identity,
        "networks": [name for name in NETWORKS if f"{name}.bypass" in small.arrays],
        "domain": {name: list(table.ranges[name]) for name in ROBOT},
        "dwells": DWELLS.tolist(),
        "units": {name: _UNITS[name] for name in (*ROBOT, DWELL, *STEADY_OUTPUTS, *RESPONSE_OUTPUTS)},
        "loss": losses,
        "errors": table.errors,
    }


def _listed(array: Any) -> str:
    flat = array.ravel()
    if array.dtype == np.float16:
        return ",".join(str(bits) for bits in flat.view(np.uint16))
    words = (f"{value:.9g}" for value in flat.tolist())
    return ",".join(f"{w if set(w) & set('.e') else w + '.0'}f" for w in words)
