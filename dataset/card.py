"""Write the data card: one page of Markdown beside the data, for whoever finds the folder.

It lists ranges, coverage, failures by reason and region, cost and code, and says how to read the data.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from dataset.data_set import CARD, read, read_manifest
from dataset.design import SweepDesign
from dataset.folder import Folder
from dataset.schema import COST

if TYPE_CHECKING:
    import pandas as pd

_BINS = 16  # of equal width in an input's range, for its coverage
_SPEEDS = 4  # regions of ω̄


def write_card(folder: Folder) -> None:
    """Write the card of a finished data set."""
    manifest = read_manifest(folder.address)
    inputs = SweepDesign.from_config(manifest["config"], 1).ranges()
    rows = read(folder.address, [*dict.fromkeys([*inputs, "N", "omega_bar"]), "failed", "reason", COST])
    folder.write(CARD, ("\n\n".join(_paragraphs(folder, manifest, inputs, rows)) + "\n").encode())


def _paragraphs(
    folder: Folder, manifest: dict[str, Any], inputs: dict[str, dict[str, Any]], rows: pd.DataFrame
) -> Iterator[str]:
    count, seconds, files = len(rows), manifest["cost_s"], folder.path("rows")
    yield "# Data card"
    yield (
        f"{count} simulated robots: {manifest['converged']} converged, {manifest['failed']} failed, "
        f"tails touch in {manifest['touching']}. Failed rows are kept and flagged; their outputs are NaN. All "
        "numbers are dimensionless; the unit and meaning of each column are in the Parquet schema."
    )
    yield "## How to read it"
    yield (
        f'```python\nrows = pandas.read_parquet("{files}")\nrows = polars.read_parquet("{files}")\n'
        f"rows = duckdb.sql(\"from '{files}/*.parquet'\")  # it ignores case: there L_over_R is L_over_R_1\n```"
    )
    yield (
        f'They do not check the files against the manifest; `dataset.data_set.read("{folder.address}")` does, and '
        "so does `dataset.data_set.batches`, file by file."
    )
    yield "## Inputs"
    yield (
        f"Points of a scrambled Sobol sequence, seed {manifest['config']['seed']}; row i is its point i. "
        f"Coverage: rows in the emptiest and the fullest of {_BINS} equal parts of the range, over their mean."
    )
    header = ("input", "range", "scale", "smallest", "largest", "coverage")
    yield _table(header, (_input(name, spec, rows[name].to_numpy(float)) for name, spec in inputs.items()))
    yield "## Failures"
    if manifest["failed"]:
        lowest, highest = inputs["omega_bar"]["range"]
        ends = np.geomspace(lowest, highest, _SPEEDS + 1)
        words = [f"{low:.3g} to {high:.3g}" for low, high in pairwise(ends)]
        speed = np.clip(np.searchsorted(ends, rows["omega_bar"].abs(), "right") - 1, 0, _SPEEDS - 1)
        rows = rows.assign(speed=[words[index] for index in speed], index=speed)
        # The index comes before the words, so that groups are in the order of speeds.
        regions = rows.groupby(["N", "index", "speed"])["failed"].agg(["size", "sum"]).reset_index()
        failed = regions[regions["sum"] > 0].drop(columns="index")
        yield _table(("N", "ω̄", "rows", "failed"), failed.itertuples(index=False))
        reasons = rows[rows["failed"]].groupby(["reason", "N", "index", "speed"]).size().reset_index()
        yield _table(("reason", "N", "ω̄", "rows"), reasons.drop(columns="index").itertuples(index=False))
    else:
        yield "None."
    yield "## Cost"
    yield f"{seconds:.1f} s of processor time, {1e3 * seconds / count:.2f} ms a row."
    costs = 1e3 * rows[COST].astype(float).groupby(rows["N"]).mean()
    yield _table(("N", "ms a row"), ((n, f"{cost:.2f}") for n, cost in costs.items()))
    yield "## Made by"
    libraries = ", ".join(f"{name} {version}" for name, version in manifest["libraries"].items())
    yield (
        f"Code {manifest['code_version']}, Python {manifest['python']}, {libraries}. "
        f"Configuration {manifest['config_hash']}, manifest {manifest['digest']}."
    )


def _input(name: str, spec: dict[str, Any], values: np.ndarray) -> Sequence[str]:
    """Return the line of an input."""
    (low, high), mirrored = spec["range"], spec.get("both_directions")
    size = np.abs(values) if mirrored else values
    if low == high:
        share = np.zeros(len(size))
    else:
        share = np.log(size / low) / np.log(high / low) if spec["scale"] == "log" else (size - low) / (high - low)
    bins = np.histogram(share, _BINS, (0.0, 1.0))[0]
    used = bins[bins > 0] if spec["scale"] == "integer" or low == high else bins
    cover = f"{used.min() / used.mean():.2f} to {used.max() / used.mean():.2f}"
    scale = spec["scale"] + (", both directions" if mirrored else "")
    return name, f"{low:g} to {high:g}", scale, f"{values.min():.4g}", f"{values.max():.4g}", cover


def _table(header: Sequence[object], rows: Iterable[Sequence[object]]) -> str:
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join("| " + " | ".join(str(cell) for cell in line) + " |" for line in lines)
