"""Make the measured tables of this folder: the simulator on half the edge length and half the step, with noise.

python -m tests.reference.make [FOLDER]      writes robot.toml and a CSV for each table, by default here
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd

from calibration.swimmer.synthetic_table import make_table
from sim.model.presets import PRESETS
from sim.model.robot_toml import robot_toml

HERE = Path(__file__).parent
GIVEN = PRESETS["paper-measured"]  # what the calibration starts from
TRUTH = replace(GIVEN, C_t=3.1, C_r=2.4, C_yr=4.4)  # behind every table


def none() -> pd.DataFrame:
    """Simulate with nothing missing."""
    return make_table(TRUTH, seed=1, lengths_cm=(6.0, 9.0), title="")


def effect() -> pd.DataFrame:
    """Turn the head end over end against five times more drag than the model has."""
    hidden = replace(TRUTH, effects={"end_over_end_drag": 5.0})
    return make_table(hidden, seed=21, lengths_cm=(6.0, 9.0), title="")


def unexplained() -> pd.DataFrame:
    """Change the yaw rate by up to 12 % as no effect does: it waves along the tail length."""
    table = make_table(TRUTH, seed=7, lengths_cm=(5.0, 8.0, 11.0), title="")
    sign = np.where(table["omega_rpm"].abs() > 120, 1, -1)
    table["omega_yr_rad_s"] *= np.exp(0.12 * np.sin(1.1 * table["l_cm"]) * sign)
    return table


def ambiguous() -> pd.DataFrame:
    """Add drag on the tails' own spin, to robots of two kinds with one tail length: too few to tell its rivals."""
    hidden = replace(TRUTH, effects={"tail_spin_drag": 1.0})
    return make_table(hidden, seed=5, tails=(3, 4), lengths_cm=(8.0,), trials=4, title="")


TABLES = {"none": none, "effect": effect, "ambiguous": ambiguous, "unexplained": unexplained}

if __name__ == "__main__":
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else HERE
    (folder / "robot.toml").write_text(robot_toml(GIVEN))
    for name, make in TABLES.items():
        make().to_csv(folder / f"{name}.csv", index=False, float_format="%.6g")
