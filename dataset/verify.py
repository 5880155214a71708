"""Verify a data set: files, digests, inputs, flags, and some rows simulated again.

A row simulated again must be the same to rounding, and time stepping from rest must agree with its steady motion
to the error of stepping (1 % in spins, 3 % in other outputs).
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa

from common.errors import InputError
from dataset.data_set import batches, check_version, read_design, read_manifest
from dataset.design import SweepDesign
from dataset.folder import Folder
from dataset.schema import COST, arrow_table, schema
from dataset.simulate import HISTORY
from dataset.workers import simulate_here
from sim.motion.batches import stepped_columns

# Relative errors of stepping.
_STEPPING = {"omega_t_bar": 0.01, "omega_h_bar": 0.01, "omega_yr_bar": 0.03, "v_x": 0.03, "R_yr_over_l": 0.03}
_ROUNDING = {
    pa.float64(): 1e-8,
    pa.float32(): 1e-6,
}  # relative, with the largest value of a list for its small ones


def verify(folder: str | Path, *, rows: int = 8) -> str:
    """Verify a data set; return a line that says what was checked.

    Raises:
        InputError: what is wrong with it.
    """
    there = Folder(folder)
    manifest, address = read_manifest(folder), there.address
    check_version(there, manifest["code_version"])
    design = read_design(there)[1].with_rows(manifest["rows"])
    if design.config() != manifest["config"]:
        raise InputError(f"{address}: sweep.json is not that of the manifest; repair it with --mend")
    chosen = np.sort(np.random.default_rng(1).choice(design.rows, min(rows, design.rows), replace=False))
    sample, start = [], 0
    for batch in batches(folder):
        stop = start + batch.num_rows
        _check_batch(address, design, batch, start)
        sample.append(pa.Table.from_batches([batch]).take(chosen[(chosen >= start) & (chosen < stop)] - start))
        start = stop
    if start != manifest["rows"]:
        raise InputError(f"{address} has {start} of {manifest['rows']} rows; repair it with --mend")
    stored = pa.concat_tables(sample)
    _check_again(address, design, stored)
    stepped = _check_stepped(address, design, stored.to_pandas())
    return (
        f"{start} rows as configured, flags consistent; {len(chosen)} rows simulated again: the same to rounding; "
        f"stepped in time from rest: largest difference {100 * stepped:.0f} % of the error of stepping"
    )


def _check_batch(address: str, design: SweepDesign, batch: pa.RecordBatch, start: int) -> None:
    """Check order, inputs and flags of consecutive rows."""
    stop = start + batch.num_rows
    if not np.array_equal(batch["row"].to_numpy(), design.indices(start, stop)):
        raise InputError(f"{address}: rows {start} to {stop - 1} are not in order; repair it with --mend")
    for name, values in design.points(start, stop).items():
        if not np.array_equal(batch[name].to_numpy(), values):
            raise InputError(f"{address}: {name} in rows {start} to {stop - 1} is not that of its design")
    outputs = [batch[name].to_numpy() for name in _STEPPING]
    failed = batch["failed"].to_numpy(zero_copy_only=False)
    unflagged = int((np.isnan(outputs).any(0) & ~failed).sum())
    if unflagged:
        raise InputError(f"{address} has {unflagged} rows with empty outputs that are not flagged as failed")


def _check_again(address: str, design: SweepDesign, stored: pa.Table) -> None:
    """Simulate stored rows again and compare."""
    points = {name: stored[name].to_numpy().astype(float) for name in design.columns}
    points[HISTORY] = stored[HISTORY].to_numpy()
    form = schema(design.effects, design.sensitivities)
    again = arrow_table({**simulate_here(points, design.sensitivities), "row": stored["row"]}, form)
    for field in form:
        if field.name != COST and not _same(stored[field.name], again[field.name], field.type):
            raise InputError(f"{address}: {field.name} of rows simulated again differs; build it anew")


def _same(stored: pa.ChunkedArray, again: pa.ChunkedArray, kind: pa.DataType) -> bool:
    """Whether two columns are equal to rounding."""
    is_list = pa.types.is_fixed_size_list(kind)
    tolerance = _ROUNDING.get(kind.value_type if is_list else kind)
    if tolerance is None:
        return bool(stored.to_pylist() == again.to_pylist())
    x, y = (np.array(column.to_pylist(), dtype=float).reshape(len(column), -1) for column in (stored, again))
    size = np.abs(x).max(1, initial=0.0, keepdims=True, where=np.isfinite(x))
    return bool((np.isclose(x, y, rtol=0.0, atol=tolerance * size, equal_nan=True)).all())


def _check_stepped(address: str, design: SweepDesign, stored: pd.DataFrame) -> float:
    """Compare with time steps from rest; return the largest difference over the error of stepping."""
    good = stored[stored["converged"]]
    if good.empty:
        return 0.0
    again = stepped_columns({name: good[name].to_numpy(dtype=float) for name in design.columns}, title="")
    worst = max(float(np.max(np.abs(again[name] / good[name] - 1))) / error for name, error in _STEPPING.items())
    if worst > 1:
        raise InputError(
            f"{address}: rows stepped in time differ by {worst:.2f} times the error of stepping; build it anew"
        )
    return worst
