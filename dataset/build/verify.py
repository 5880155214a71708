"""Verify a data set: files, digests, inputs, flags, and some rows simulated again.

A row simulated again must give the same bits, and time stepping from rest must agree with its steady motion to the
error of stepping (1 % in spins, 3 % in other outputs).
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa

from dataset.build.sweep_folder import load_sweep
from dataset.rows.design import SweepDesign
from dataset.rows.schema import COST, arrow_table, schema
from dataset.rows.simulate import HISTORY
from dataset.storage.data_set import batches, check_version, read_manifest
from dataset.storage.storage import open_storage
from dataset.workers.processes import call_in_worker
from dataset.workers.tasks import simulate_in_worker
from sim.io.errors import InputError
from sim.motion.batches import stepped_columns

_SPINS = ("omega_t_bar", "omega_h_bar")
_OTHERS = ("omega_yr_bar", "v_x", "R_yr_over_l")
_SPIN_ERROR, _OTHER_ERROR = 0.01, 0.03


def verify(folder: str | Path, *, rows: int = 8) -> str:
    """Verify a data set; return a line that says what was checked.

    Raises:
        InputError: what is wrong with it.
    """
    storage = open_storage(folder)
    manifest = read_manifest(storage)
    check_version(storage, manifest["code_version"])
    design = load_sweep(storage)[0].with_rows(manifest["rows"])
    if design.config() != manifest["config"]:
        raise InputError(f"{storage.address}: sweep.json is not that of the manifest; repair it with --mend")
    chosen = np.sort(np.random.default_rng(1).choice(design.rows, min(rows, design.rows), replace=False))
    sample, start = [], 0
    for batch in batches(storage):
        stop = start + batch.num_rows
        _check_batch(storage.address, design, batch, start)
        sample.append(pa.Table.from_batches([batch]).take(chosen[(chosen >= start) & (chosen < stop)] - start))
        start = stop
    if start != manifest["rows"]:
        raise InputError(f"{storage.address} has {start} of {manifest['rows']} rows; repair it with --mend")
    stored = pa.concat_tables(sample)
    _check_again(storage.address, design, stored, chosen)
    line = f"{start} rows as configured, flags consistent; {len(chosen)} rows simulated again: the same bits"
    stepped = _check_stepped(storage.address, design, stored.to_pandas())
    return f"{line}; stepped in time from rest: largest difference {100 * stepped * _OTHER_ERROR:.2f} %"


def _check_batch(address: str, design: SweepDesign, batch: pa.RecordBatch, start: int) -> None:
    """Check order, inputs and flags of consecutive rows."""
    stop = start + batch.num_rows
    if not np.array_equal(batch["row"].to_numpy(), design.indices(start, stop)):
        raise InputError(f"{address}: rows {start} to {stop - 1} are not in order; repair it with --mend")
    for name, values in design.points(start, stop).items():
        if not np.array_equal(batch[name].to_numpy(), values):
            raise InputError(f"{address}: {name} in rows {start} to {stop - 1} is not that of its design")
    outputs = [batch[name].to_numpy() for name in (*_SPINS, *_OTHERS)]
    failed = batch["failed"].to_numpy(zero_copy_only=False)
    unflagged = int((np.isnan(outputs).any(0) & ~failed).sum())
    if unflagged:
        raise InputError(f"{address} has {unflagged} rows with empty outputs that are not flagged as failed")


def _check_again(address: str, design: SweepDesign, stored: pa.Table, chosen: np.ndarray) -> None:
    """Simulate stored rows again and compare all bits."""
    points = {name: stored[name].to_numpy().astype(float) for name in design.columns}
    points[HISTORY] = stored[HISTORY].to_numpy()
    again_columns = call_in_worker(simulate_in_worker, points, design.sensitivities)
    again = arrow_table(
        {**again_columns, "row": design.indices()[chosen]}, schema(design.effects, design.sensitivities)
    )
    for name in stored.schema.names:
        if name != COST and _bits(stored[name]) != _bits(again[name]):
            raise InputError(
                f"{address}: {name} of rows simulated again differs; processors differ in last digits, so verify "
                "on a machine of the kind that made it, or build it anew"
            )


def _bits(column: pa.ChunkedArray) -> object:
    values = column.combine_chunks()
    if pa.types.is_fixed_size_list(column.type):
        values = values.flatten()
    return values.to_pylist() if pa.types.is_string(values.type) else values.to_numpy(False).tobytes()


def _check_stepped(address: str, design: SweepDesign, stored: pd.DataFrame) -> float:
    """Compare with time steps from rest; return the largest difference, in units of the error of stepping."""
    good = stored[stored["converged"]]
    if good.empty:
        return 0.0
    again = stepped_columns({name: good[name].to_numpy(dtype=float) for name in design.columns}, title="")
    worst = max(
        _largest_difference(good, again, _SPINS) / _SPIN_ERROR,
        _largest_difference(good, again, _OTHERS) / _OTHER_ERROR,
    )
    if worst > 1:
        raise InputError(
            f"{address}: rows stepped in time differ by {100 * worst * _OTHER_ERROR:.2f} %; build it anew"
        )
    return worst


def _largest_difference(rows: pd.DataFrame, again: dict[str, np.ndarray], names: tuple[str, ...]) -> float:
    return max(float(np.max(np.abs(again[name] / rows[name].to_numpy() - 1))) for name in names)
