"""Write the data card: one page of Markdown beside the data, for whoever finds the folder.

It lists ranges, coverage, failures by reason and region, cost and code, and says how to read the data. It takes
one pass over the rows.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from dataset.rows.design import SweepDesign
from dataset.rows.schema import COST
from dataset.storage.data_set import CARD, batches, read_manifest
from dataset.storage.shards import plain
from dataset.storage.storage import Storage

_BINS = 16  # of equal width in an input's range, for its coverage
_SPEEDS = 4  # regions of ω̄


def write_card(storage: Storage) -> None:
    """Write the card of a finished data set."""
    manifest = read_manifest(storage)
    inputs = SweepDesign.from_config(manifest["config"], 1).ranges()
    statistics = _Statistics(inputs)
    for batch in batches(storage, [*inputs, *({"N", "omega_bar"} - set(inputs)), "failed", "reason", COST]):
        statistics.add({name: plain(batch[name]) for name in batch.schema.names})
    storage.write(CARD, "\n\n".join(_sections(storage, manifest, statistics)) + "\n")


class _Statistics:
    """Running ranges, coverage, failures and cost of the rows."""

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
        """Add a batch."""
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
            for index in np.unique(region[same]).tolist():
                inside = same & (region == index)
                self.rows[count, index] += int(inside.sum())
                failures = rows["reason"][inside & rows["failed"]]
                self.failed[count, index] += len(failures)
                for reason in failures.tolist():
                    self.reasons[reason, count, index] += 1

    def speed(self, region: int) -> str:
        """Write the bounds of a region of ω̄."""
        return f"{self.speeds[region]:.3g} to {self.speeds[region + 1]:.3g}"


def _share(values: np.ndarray, spec: dict[str, Any]) -> np.ndarray:
    """Return the positions of values in their range, 0 to 1, on its scale."""
    low, high = spec["range"]
    if low == high:
        return np.zeros(len(values))
    if spec["scale"] == "log":
        return np.asarray(np.log(values / low) / np.log(high / low))
    return np.asarray((values - low) / (high - low))


def _sections(storage: Storage, manifest: dict[str, Any], statistics: _Statistics) -> Iterable[str]:
    """Yield the paragraphs of the card."""
    rows, seconds = manifest["rows"], manifest["cost_s"]
    yield "# Data card"
    yield (
        f"{rows} simulated robots: {manifest['converged']} converged, {manifest['failed']} failed, "
        f"tails touch in {manifest['touching']}. Failed rows are kept and flagged; their outputs are NaN. All "
        "numbers are dimensionless; the unit and meaning of each column are in the Parquet schema."
    )
    yield "## How to read it"
    yield _reading(storage)
    yield "## Inputs"
    yield (
        f"Points of a scrambled Sobol sequence, seed {manifest['config']['seed']}; row i is its point i. "
        f"Coverage: rows in the emptiest and the fullest of {_BINS} equal parts of the range, over their mean."
    )
    yield _table(("input", "range", "scale", "smallest", "largest", "coverage"), _inputs(statistics))
    yield "## Failures"
    if manifest["failed"]:
        yield _table(("N", "ω̄", "rows", "failed"), _regions(statistics))
        yield _table(("reason", "N", "ω̄", "rows"), _reasons(statistics))
    else:
        yield "None."
    yield "## Cost"
    yield f"{seconds:.1f} s of processor time, {1e3 * seconds / max(rows, 1):.2f} ms a row."
    by_tails = Counter[int]()
    for (tails, _), count in statistics.rows.items():
        by_tails[tails] += count
    yield _table(
        ("N", "ms a row"), [(n, f"{statistics.cost[n] / by_tails[n] / 1e6:.2f}") for n in sorted(by_tails)]
    )
    yield "## Made by"
    libraries = ", ".join(f"{name} {version}" for name, version in manifest["libraries"].items())
    yield (
        f"Code {manifest['code_version']}, Python {manifest['python']}, {libraries}. "
        f"Configuration {manifest['config_hash']}, manifest {manifest['digest']}."
    )


def _reading(storage: Storage) -> str:
    """Return examples of how to read the rows."""
    folder = storage.path("rows")
    return "\n".join(
        (
            "```python",
            f'rows = pandas.read_parquet("{folder}")',
            f'rows = polars.read_parquet("{folder}")',
            f"rows = duckdb.sql(\"from '{folder}/*.parquet'\")",
            "```",
            "",
            "These do not check the files against the manifest; "
            f'`dataset.storage.data_set.read("{storage.address}")` does, '
            "and so does `dataset.storage.data_set.batches`, shard by shard.",
        )
    )


def _inputs(statistics: _Statistics) -> Iterable[Sequence[object]]:
    for name, spec in statistics.inputs.items():
        bins = statistics.bins[name]
        used = bins[bins > 0] if spec["scale"] == "integer" or spec["range"][0] == spec["range"][1] else bins
        low, high = statistics.ends[name]
        cover = f"{used.min() / used.mean():.2f} to {used.max() / used.mean():.2f}"
        ends = f"{spec['range'][0]:g} to {spec['range'][1]:g}"
        scale = spec["scale"] + (", both directions" if spec.get("both_directions") else "")
        yield name, ends, scale, f"{low:.4g}", f"{high:.4g}", cover


def _regions(statistics: _Statistics) -> Iterable[Sequence[object]]:
    for (tails, region), count in sorted(statistics.rows.items()):
        if statistics.failed[tails, region]:
            yield tails, statistics.speed(region), count, statistics.failed[tails, region]


def _reasons(statistics: _Statistics) -> Iterable[Sequence[object]]:
    for (reason, tails, region), count in sorted(statistics.reasons.items()):
        yield reason, tails, statistics.speed(region), count


def _table(header: Sequence[object], rows: Iterable[Sequence[object]]) -> str:
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join("| " + " | ".join(str(cell) for cell in line) + " |" for line in lines)
