"""A data set in closed form."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from dataset.design import Axis, Design
from dataset.store import write_manifest, write_part


def invented(folder: Path, rows: int = 512) -> Path:
    """A data set with outputs in closed form, so that learning is tested without simulating."""
    axes = {
        "C_t": Axis(2, 5, "linear"), "C_r": Axis(1.5, 3.5, "linear"), "C_yr": Axis(1, 7, "linear"),
        "l_over_R": Axis(4, 9, "linear"), "L_over_R": Axis(3, 5, "linear"), "l_over_r0": Axis(20, 45, "linear"),
        "omega_bar": Axis(3, 18, "log"), "N": Axis(2, 5, "integer"), "dwell_bar": Axis(0.7, 2, "log"),
    }  # fmt: skip
    p = Design(axes, rows, 5).points()
    share = 1 / (1 + p["C_r"] / p["N"])
    yaw = 0.05 * p["C_yr"] * share * p["omega_bar"] / 10
    sway = 0.9 * yaw * (1 + 1 / p["C_t"])
    surge = sway * (0.2 + 0.1 * np.log(p["l_over_r0"]) / p["L_over_R"])
    columns = {
        **p, "N": p["N"].astype(int), "a_over_R": np.ones(rows),
        "omega_t_bar": p["omega_bar"] * (1 - share), "omega_h_bar": -p["omega_bar"] * share,
        "omega_yr_bar": yaw, "v_x": sway, "v_z": surge, "R_yr_over_l": np.hypot(sway, surge) / yaw,
        "theta_deg": np.degrees(np.arctan2(sway, surge)), "net_speed_bar": surge,
        "lag_psi_rad": 0.02 * yaw, "lag_x": -0.02 * sway, "lag_z": -0.04 * sway * np.exp(-p["dwell_bar"]),
        "tail_gap": 2 + p["l_over_R"] / p["N"], "error": np.zeros(rows), "row": np.arange(rows),
        "converged": np.ones(rows, bool), "failed": np.zeros(rows, bool), "touching": np.zeros(rows, bool),
        "edges": np.full(rows, 16), "steps": np.full(rows, 24),
    }  # fmt: skip
    write_part(folder, 0, columns, [], "hash")
    inputs = {n: {"range": [a.low, a.high], "scale": a.scale} for n, a in axes.items()}
    write_manifest(folder, {"config_hash": "hash", "effects": [], "rows": rows, "code_version": "test",
                            "config": {"inputs": inputs}})  # fmt: skip
    return folder
