"""Check a data set: files, digests, inputs, flags, and some rows simulated again.

A row simulated again must give the same bits, and time stepping from rest must agree with its steady motion to the
error of stepping (1 % in spins, 3 % in the rest).
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa

from dataset.build.sweep_folder import chosen_digest, load_sweep
from dataset.rows.design import Design
from dataset.rows.schema import COST, schema, table_of
from dataset.rows.simulate import HISTORY, simulate
from dataset.storage.data_set import batches, read_manifest
from dataset.storage.storage import place
from dataset.workers.tasks import rows_version
from sim.io.errors import InputError
from sim.motion.batches import stepped_columns

_SPINS = ("omega_t_bar", "omega_h_bar")
_REST = ("omega_yr_bar", "v_x", "R_yr_over_l")
_SPIN_ERROR, _REST_ERROR = 0.01, 0.03


def verify(folder: str | Path, *, rows: int = 8) -> str:
    """Verify a data set; returns a line that says what was checked.

    Raises:
        InputError: what is wrong with it.
    """
    there = place(folder)
    manifest = read_manifest(there)
    if manifest["code_version"] != rows_version():
        raise InputError(
            f"{there.address} was made by version {manifest['code_version']}, this is {rows_version()}; "
            "verify it with the version that made it"
        )
    design = load_sweep(there)[0].with_rows(manifest["rows"])
    if design.config() != manifest["config"] or manifest.get("chosen") != chosen_digest(design, design.rows):
        raise InputError(f"{there.address}: sweep.json is not that of the manifest; mend it with --mend")
    chosen = np.sort(np.random.default_rng(1).choice(design.rows, min(rows, design.rows), replace=False))
    sample, start = [], 0
    for batch in batches(there):
        stop = start + batch.num_rows
        _check_batch(there.address, design, batch, start)
        sample.append(pa.Table.from_batches([batch]).take(chosen[(chosen >= start) & (chosen < stop)] - start))
        start = stop
    if start != manifest["rows"]:
        raise InputError(f"{there.address} has {start} of {manifest['rows']} rows; mend it with --mend")
    stored = pa.concat_tables(sample)
    _check_again(there.address, design, stored, chosen)
    line = f"{start} rows as configured, flags consistent; {len(chosen)} rows simulated again: the same bits"
    stepped = _check_stepped(there.address, design, stored.to_pandas())
    return f"{line}; stepped in time from rest: largest difference {100 * stepped * _REST_ERROR:.2f} %"


def _check_batch(address: str, design: Design, batch: pa.RecordBatch, start: int) -> None:
    stop = start + batch.num_rows
    if not np.array_equal(batch["row"].to_numpy(), design.indices(start, stop)):
        raise InputError(f"{address}: rows {start} to {stop - 1} are not in order; mend it with --mend")
    for name, values in design.points(start, stop).items():
        if not np.array_equal(batch[name].to_numpy(), values):
            raise InputError(f"{address}: {name} in rows {start} to {stop - 1} is not that of its design")
    outputs = [batch[n].to_numpy() for n in (*_SPINS, *_REST)]
    failed = batch["failed"].to_numpy(zero_copy_only=False)
    lost = int((np.isnan(outputs).any(0) & ~failed).sum())
    if lost:
        raise InputError(f"{address} has {lost} rows with empty outputs that are not flagged as failed")


def _check_again(address: str, design: Design, stored: pa.Table, chosen: np.ndarray) -> None:
    points = {name: stored[name].to_numpy().astype(float) for name in design.axes}
    points[HISTORY] = stored[HISTORY].to_numpy()
    again = table_of(
        {**simulate(points, sensitivities=design.sensitivities), "row": design.indices()[chosen]},
        schema(design.effects, design.sensitivities),
    )
    for name in stored.schema.names:
        one, other = (_bits(table[name]) for table in (stored, again))
        if name != COST and one != other:
            raise InputError(
                f"{address}: {name} of rows simulated again differs; processors differ in last digits, so verify "
                "on a machine of the kind that made it, or build it anew"
            )


def _bits(column: pa.ChunkedArray) -> object:
    values = column.combine_chunks()
    if pa.types.is_fixed_size_list(column.type):
        values = values.flatten()
    return values.to_pylist() if pa.types.is_string(values.type) else values.to_numpy(False).tobytes()


def _check_stepped(address: str, design: Design, stored: pd.DataFrame) -> float:
    """Largest difference, in units of the error of stepping."""
    good = stored[stored["converged"]]
    if good.empty:
        return 0.0
    again = stepped_columns({n: good[n].to_numpy(dtype=float) for n in design.axes}, title="")
    worst = max(_worst(good, again, _SPINS) / _SPIN_ERROR, _worst(good, again, _REST) / _REST_ERROR)
    if worst > 1:
        raise InputError(
            f"{address}: rows stepped in time differ by {100 * worst * _REST_ERROR:.2f} %; build it anew"
        )
    return worst


def _worst(rows: pd.DataFrame, again: dict[str, np.ndarray], names: tuple[str, ...]) -> float:
    return max(float(np.max(np.abs(again[n] / rows[n].to_numpy() - 1))) for n in names)
