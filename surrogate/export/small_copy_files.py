"""The files of the small copy of the look-up table (`surrogate.export.small_copy`), in a folder:

lookup.safetensors  the numbers; its metadata has a manifest in JSON: domain, units, losses, which table it is
lookup_weights.h    the same numbers for C
lookup.h            a reader in C99
vectors.csv         robots and answers, to test a reader with; NaN where a reader has no answer
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import safetensors.numpy

from sim.io.files import files_together, write_text
from sim.model.groups import DWELL
from sim.model.response import DWELLS
from sim.motion.steady_motion import STEADY_OUTPUTS
from surrogate.export.small_copy import (
    EXACT,
    NETWORKS,
    SmallCopy,
    make_small_copy,
    make_vectors,
    measure_losses,
    network_depth,
)
from surrogate.input_ranges import ROBOT
from surrogate.table.errors import RESPONSE_OUTPUTS
from surrogate.table.lookup import NeuralTable

READERS = Path(__file__).parents[1] / "readers"
FORMAT = 1
_UNITS = {
    "C_t": "1", "C_r": "1", "C_yr": "1", "l_over_R": "1", "L_over_R": "1", "l_over_r0": "1",
    "omega_bar": "EI/(mu0 l^4), signed", "N": "1, a whole number", "a_over_R": "1", DWELL: "mu0 l^4/EI",
    "omega_t_bar": "EI/(mu0 l^4)", "omega_h_bar": "EI/(mu0 l^4)", "omega_yr_bar": "EI/(mu0 l^4)",
    "v_x": "EI/(mu0 l^3)", "v_z": "EI/(mu0 l^3)", "R_yr_over_l": "l", "theta_deg": "degree", "tail_gap": "2 r0",
    "net_speed_bar": "EI/(mu0 l^3)", "lag_psi_rad": "rad", "lag_x": "l", "lag_z": "l",
}  # fmt: skip


def save_small_copy(table: NeuralTable, folder: str | Path) -> str:
    """Write the files of the small copy into a folder, all or none; return the losses in words.

    Raises:
        InputError: no copy fits into MOST_BYTES.
    """
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
    for name in NETWORKS[: 6 if small.has_response else 4]:
        if name not in present:
            networks.append("{0, 0, 0, 0, 0, 0, 0, 0, 0, 0, {0}, {0}, 0}")
            continue
        layer_count, prefix = network_depth(arrays, name), f"lookup_{name}_"
        inputs, outputs = arrays[f"{name}.bypass"].shape
        width = arrays[f"{name}.weights.0"].shape[1]
        half, half_last = (int(arrays[f"{name}.weights.{k}"].dtype == np.float16) for k in (0, layer_count))
        exact = ", ".join(prefix + part for part in EXACT)
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
    components = arrays["lag.bypass"].shape[1] if small.has_response else 0
    if small.has_response:
        dwells = ", ".join(repr(dwell) for dwell in DWELLS.tolist())
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
        "dwells": DWELLS.tolist() if small.has_response else [],
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
