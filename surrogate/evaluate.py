"""Held-out error of the look-up table, per output, and a picture of it.

For outputs that keep their sign the error is relative. For θ it is in degrees. For v_z and for the response to a
switch it is relative to the distance (or turn) of the robot in one unit of time. For the net speed it is relative
to v_z, which is its limit for long dwells. Reported are the root mean square, the median and the 95th percentile
over rows whose tails do not touch, where the model is valid, and the rms over all rows. `calibration` compares the
error with the spread of the ensemble: it is the rms of error over spread.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from sim.arrays import Floats
from surrogate.network import Columns

if TYPE_CHECKING:
    from surrogate.lookup import Lookup

RELATIVE = ("omega_t_bar", "omega_h_bar", "omega_yr_bar", "v_x", "R_yr_over_l")


def scale_of(name: str, truth: Columns) -> Floats | float:
    """The number by which the error of an output is divided."""
    if name in RELATIVE:
        return np.abs(truth[name])
    if name == "theta_deg":
        return 1.0
    if name == "lag_psi_rad":
        return np.abs(truth["omega_yr_bar"])
    if name == "net_speed_bar":
        return np.abs(truth["v_z"])
    return np.hypot(truth["v_x"], truth["v_z"])  # v_z, lag_x, lag_z


COMPARED = (*RELATIVE, "v_z", "net_speed_bar", "theta_deg", "lag_psi_rad", "lag_x", "lag_z")


def held_out_errors(lookup: Lookup, rows: pd.DataFrame) -> dict[str, dict[str, float]]:
    """Errors per output on rows that training did not see."""
    if rows.empty:
        return {}
    names = [*lookup.domain]
    members = lookup.query_members({n: rows[n].to_numpy(dtype=float) for n in names})
    truth = {str(n): rows[n].to_numpy(dtype=float) for n in rows}
    apart = ~rows["touching"].to_numpy()
    report: dict[str, dict[str, float]] = {}
    for name in COMPARED:
        scale = scale_of(name, truth)
        error = (members[name].mean(0) - truth[name]) / scale
        spread = members[name].std(0) / scale
        valid = np.abs(error[apart]) if apart.any() else np.abs(error)
        report[name] = {
            "rms": float(np.sqrt(np.mean(valid**2))),
            "median": float(np.median(valid)),
            "p95": float(np.quantile(valid, 0.95)),
            "rms_with_touching": float(np.sqrt(np.mean(error**2))),
            "calibration": float(np.sqrt(np.mean((error / np.maximum(spread, 1e-12)) ** 2))),
        }
    return report


def error_table(lookup: Lookup) -> str:
    """The held-out errors as text."""
    unit = {"theta_deg": "deg", "lag_psi_rad": "of turn/unit", "v_z": "of speed", "lag_x": "of speed",
            "lag_z": "of speed",
            "net_speed_bar": "of v_z"}  # fmt: skip
    lines = [f"{'output':16}{'rms':>9}{'median':>9}{'95 %':>9}{'rms, all':>10}"]
    for name, error in lookup.errors.items():
        percent = 1 if name == "theta_deg" else 100
        figures = "".join(f"{percent * error[k]:9.3f}" for k in ("rms", "median", "p95"))
        last = f"{percent * error['rms_with_touching']:10.3f}"
        lines.append(f"{name:16}{figures}{last}  {unit.get(name, '%')}")
    return "\n".join(lines)
