"""Tables of runs for the tests of the page: the look-up table's answers with noise."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd

from sim.model.presets import PRESETS
from sim.motion.lab_units import lab_columns
from tests.planner.page.cases import columns_of, shipped

ROBOT = PRESETS["paper-measured"]


def look_up(runs: pd.DataFrame) -> dict[str, np.ndarray]:
    """Ask the look-up table for the motion of each run, in the columns of a measured table."""
    robots = [
        replace(ROBOT, tails=int(n), tail_length=length / 100, motor_speed=abs(speed) * np.pi / 30)
        for n, length, speed in zip(runs["N"], runs["l_cm"], runs["omega_rpm"], strict=True)
    ]
    groups = columns_of([robot.group_values() for robot in robots])
    groups["omega_bar"] = groups["omega_bar"] * np.sign(runs["omega_rpm"].to_numpy())
    length, time = runs["l_cm"].to_numpy(), np.array([robot.time_scale for robot in robots])
    return lab_columns(shipped().query(groups), length, time)


def table_of_runs() -> pd.DataFrame:
    """Make runs of two numbers of tails, two lengths and two speeds, in both directions and three sessions."""
    rows = [
        (tails, length, sense * speed, f"day {k % 3}")
        for tails in (3, 4)
        for length in (7.0, 9.5)
        for speed in (100.0, 150.0)
        for sense in (1, -1)
        for k in range(3)
    ]
    runs = pd.DataFrame(rows, columns=["N", "l_cm", "omega_rpm", "session"])
    rng = np.random.default_rng(7)
    answers = look_up(runs)
    for name in ("omega_h_rpm", "omega_t_rpm", "omega_yr_rad_s", "R_yr_cm", "theta_deg"):
        runs[name] = answers[name] * np.exp(0.03 * rng.normal(size=len(runs)))
    return runs
