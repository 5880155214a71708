"""Time and memory of a calibration with many runs of few conditions, as a camera with a queue of runs makes them.

96 conditions with 2.5 % of noise, in 40 sessions; nothing is hidden. Each size runs in a process of its own.

Usage: python -m benchmarks many_runs [RUNS …]

Takes a few minutes.
"""

from __future__ import annotations

import multiprocessing
import resource
import time

import numpy as np
import pandas as pd

from calibration.report.robot_verdict import calibrate_robot
from calibration.swimmer.synthetic_table import make_table
from sim.model.presets import PRESETS

_NOISE = 0.025
_SESSIONS = 40
_OUTPUTS = ("omega_h_rpm", "omega_t_rpm", "omega_yr_rad_s", "R_yr_cm")


def main(*runs: str) -> None:
    sizes = [int(count) for count in runs] or [500, 2000, 8000, 20000]
    print("| runs | conditions | processor time [s] | largest memory [GB] | verdict |\n|---|---|---|---|---|")
    for count in sizes:
        with multiprocessing.get_context("spawn").Pool(1) as pool:
            print(pool.apply(_row, (count,)), flush=True)


def _row(count: int) -> str:
    robot = PRESETS["paper-measured"]
    lengths = (5.0, 6.0, 7.0, 8.0, 9.0, 11.0)
    exact = make_table(
        robot, seed=0, lengths_cm=lengths, trials=1, noise=1e-9, session_noise=0.0, title=""
    ).drop_duplicates(["N", "l_cm", "omega_rpm"])
    rng = np.random.default_rng(1)
    table: pd.DataFrame = exact.iloc[rng.permutation(np.arange(count) % len(exact))].reset_index(drop=True)
    for column in _OUTPUTS:
        table[column] *= np.exp(_NOISE * rng.normal(size=count))
    table["theta_deg"] += np.degrees(_NOISE * rng.normal(size=count))
    table["session"] = [f"s{place % _SESSIONS:02d}" for place in range(count)]
    began = time.process_time()
    verdict = calibrate_robot(table, robot, jobs=1, progress=False)
    seconds = time.process_time() - began
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
    return f"| {count} | {len(exact)} | {seconds:.0f} | {memory:.2f} | {verdict.verdict} |"


if __name__ == "__main__":
    main()
