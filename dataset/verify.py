"""Check a data set: files, schema, flags, and some rows simulated again.

A row solved again must give what it gave in its batch, and time stepping from rest must agree with it to the
error of stepping (1 % in spins, 3 % in the rest).
"""

from __future__ import annotations

import numpy as np
import pandas as pd

from dataset.schema import INPUTS
from dataset.store import read, read_manifest
from sim.io.errors import InputError
from sim.motion.batches import steady_columns, stepped_columns

_SPINS = ("omega_t_bar", "omega_h_bar")
_REST = ("omega_yr_bar", "v_x", "R_yr_over_l")
_SPIN_ERROR, _REST_ERROR = 0.01, 0.03


def verify(folder: str, *, rows: int = 8) -> str:
    """Verify a data set; returns a line that says what was checked.

    Raises:
        InputError: what is wrong with it.
    """
    manifest = read_manifest(folder)
    table = read(folder)
    if not np.array_equal(table["row"], np.arange(manifest["rows"])):
        raise InputError(f"{folder} has {len(table)} of {manifest['rows']} rows; run the build again")
    outputs = table[[*_SPINS, *_REST, "net_speed_bar", "lag_psi_rad"]]
    lost = int((outputs.isna().any(axis=1) & ~table["failed"]).sum())
    if lost:
        raise InputError(f"{folder} has {lost} rows with empty outputs that are not flagged as failed")
    good = table[table["converged"]]
    sample = good.sample(min(rows, len(good)), random_state=1)
    worst = {}
    names = [c.name for c in INPUTS if c.name != "dwell_bar"] + list(manifest["effects"])
    points = {n: sample[n].to_numpy(dtype=float) for n in names}
    for kind, solve in (("again", steady_columns), ("stepped", stepped_columns)):
        again = solve(points, title=f"verify {kind}")
        worst[kind] = max(_worst(sample, again, _SPINS) / _SPIN_ERROR, _worst(sample, again, _REST) / _REST_ERROR)
    if worst["again"] > 1e-3 or worst["stepped"] > 1:
        raise InputError(
            f"{folder}: rows solved again differ by {100 * worst['again'] * _REST_ERROR:.4f} %, "
            f"stepped in time by {100 * worst['stepped'] * _REST_ERROR:.2f} %; build it anew"
        )
    return (
        f"{len(table)} rows as configured, flags consistent; {len(sample)} rows simulated again: "
        f"largest difference {100 * worst['again'] * _REST_ERROR:.4f} % solved again, "
        f"{100 * worst['stepped'] * _REST_ERROR:.2f} % stepped in time from rest"
    )


def _worst(rows: pd.DataFrame, again: dict[str, np.ndarray], names: tuple[str, ...]) -> float:
    return max(float(np.max(np.abs(again[n] / rows[n].to_numpy() - 1))) for n in names)
