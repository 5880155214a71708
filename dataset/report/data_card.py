"""The data card: one page of Markdown beside the data, for whoever finds the folder.

Ranges, coverage, failures by reason and region, cost, code, and how to read it. Made in one pass over the rows.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from dataset.rows.schema import COST
from dataset.storage.data_set import CARD, batches, read_manifest
from dataset.storage.shards import plain
from dataset.storage.storage import Place

_BINS = 16  # of an input's range, for its coverage
_SPEEDS = 4  # regions of ω̄


def write_card(place: Place) -> None:
    """Write the card of a finished data set."""
    manifest = read_manifest(place)
    inputs = manifest["config"]["inputs"]
    seen = _Seen(inputs)
    for batch in batches(place, [*inputs, *({"N", "omega_bar"} - set(inputs)), "failed", "reason", COST]):
        seen.add({name: plain(batch[name]) for name in batch.schema.names})
    place.write(CARD, "\n\n".join(_parts(place, manifest, seen)) + "\n")


class _Seen:
    """Ranges, coverage, failures and cost of the rows so far."""

    def __init__(self, inputs: dict[str, Any]):
        self.inputs = inputs
        self.bins = {name: np.zeros(_BINS, dtype=int) for name in inputs}
        self.ends = {name: (np.inf, -np.inf) for name in inputs}
        low, high = inputs["omega_bar"]["range"]
        self.speeds = np.geomspace(low, high, _SPEEDS + 1)
        self.rows: Counter[tuple[int, int]] = Counter()
        self.failed: Counter[tuple[int, int]] = Counter()
        self.reasons: Counter[tuple[str, int, int]] = Counter()
        self.cost: Counter[int] = Counter()  # nanoseconds, by N

    def add(self, rows: dict[str, np.ndarray]) -> None:
        """Count a batch."""
        for name, spec in self.inputs.items():
            values, (low, high) = rows[name], self.ends[name]
            self.ends[name] = min(low, float(values.min())), max(high, float(values.max()))
            size = np.abs(values) if spec.get("both_directions") else values
            self.bins[name] += np.histogram(_share(size, spec), _BINS, (0.0, 1.0))[0]
        tails = rows["N"].astype(int)
        region = np.clip(np.searchsorted(self.speeds, np.abs(rows["omega_bar"]), "right") - 1, 0, _SPEEDS - 1)
        for count in np.unique(tails).tolist():
            same = tails == count
            self.cost[count] += round(1e9 * float(np.sum(rows[COST][same], dtype=float)))
            for place in np.unique(region[same]).tolist():
                here = same & (region == place)
                self.rows[count, place] += int(here.sum())
                lost = rows["reason"][here & rows["failed"]]
                self.failed[count, place] += len(lost)
                for reason in lost.tolist():
                    self.reasons[reason, count, place] += 1

    def speed(self, region: int) -> str:
        """A region of ω̄ in words."""
        return f"{self.speeds[region]:.3g} to {self.speeds[region + 1]:.3g}"


def _share(values: np.ndarray, spec: dict[str, Any]) -> np.ndarray:
    """Where values lie in their range, 0 to 1, on its scale."""
    low, high = spec["range"]
    if low == high:
        return np.zeros(len(values))
    if spec["scale"] == "log":
        return np.asarray(np.log(values / low) / np.log(high / low))
    return np.asarray((values - low) / (high - low))


def _parts(place: Place, manifest: dict[str, Any], seen: _Seen) -> Iterable[str]:
    rows, seconds = manifest["rows"], manifest["cost_s"]
    yield "# Data card"
    yield (
        f"{rows} simulated robots: {manifest['converged']} converged, {manifest['failed']} failed, "
        f"tails touch in {manifest['touching']}. Failed rows are kept and flagged; their outputs are NaN. All "
        "numbers are dimensionless; the unit and meaning of each column are in the Parquet schema."
    )
    yield "## How to read it"
    yield _reading(place)
    yield "## Inputs"
    which = "row i is its point i" if manifest.get("chosen") is None else "chosen ones, the column row says which"
    yield (
        f"Points of a scrambled Sobol sequence, seed {manifest['config']['seed']}; {which}. "
        f"Coverage: rows in the emptiest and the fullest of {_BINS} equal parts of the range, over their mean."
    )
    yield _table(("input", "range", "scale", "smallest", "largest", "coverage"), _inputs(seen))
    yield "## Failures"
    if manifest["failed"]:
        yield _table(("N", "ω̄", "rows", "failed"), _regions(seen))
        yield _table(("reason", "N", "ω̄", "rows"), _reasons(seen))
    else:
        yield "None."
    yield "## Cost"
    yield f"{seconds:.1f} s of processor time, {1e3 * seconds / max(rows, 1):.2f} ms a row."
    by_tails = Counter[int]()
    for (tails, _), count in seen.rows.items():
        by_tails[tails] += count
    yield _table(("N", "ms a row"), [(n, f"{seen.cost[n] / by_tails[n] / 1e6:.2f}") for n in sorted(by_tails)])
    yield "## Made by"
    libraries = ", ".join(f"{name} {version}" for name, version in manifest["libraries"].items())
    yield (
        f"Code {manifest['code_version']}, Python {manifest['python']}, {libraries}. "
        f"Configuration {manifest['config_hash']}, manifest {manifest['digest']}."
    )


def _reading(place: Place) -> str:
    folder = place.path("rows")
    return "\n".join(
        (
            "```python",
            f'rows = pandas.read_parquet("{folder}")',
            f'rows = polars.read_parquet("{folder}")',
            f"rows = duckdb.sql(\"from '{folder}/*.parquet'\")",
            "```",
            "",
            "These do not check the files against the manifest; "
            f'`dataset.storage.data_set.read("{place.address}")` does, '
            "and so does `dataset.storage.data_set.batches`, piece by piece.",
        )
    )


def _inputs(seen: _Seen) -> Iterable[Sequence[object]]:
    for name, spec in seen.inputs.items():
        bins = seen.bins[name]
        whole = spec["scale"] == "integer"
        used = bins[bins > 0] if whole or spec["range"][0] == spec["range"][1] else bins
        low, high = seen.ends[name]
        cover = f"{used.min() / used.mean():.2f} to {used.max() / used.mean():.2f}"
        ends = f"{spec['range'][0]:g} to {spec['range'][1]:g}"
        scale = spec["scale"] + (", both directions" if spec.get("both_directions") else "")
        yield name, ends, scale, f"{low:.4g}", f"{high:.4g}", cover


def _regions(seen: _Seen) -> Iterable[Sequence[object]]:
    for (tails, region), count in sorted(seen.rows.items()):
        if seen.failed[tails, region]:
            yield tails, seen.speed(region), count, seen.failed[tails, region]


def _reasons(seen: _Seen) -> Iterable[Sequence[object]]:
    for (reason, tails, region), count in sorted(seen.reasons.items()):
        yield reason, tails, seen.speed(region), count


def _table(header: Sequence[object], rows: Iterable[Sequence[object]]) -> str:
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join("| " + " | ".join(str(cell) for cell in line) + " |" for line in lines)
