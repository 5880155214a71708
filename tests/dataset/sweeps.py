"""Small sweeps for tests, and functions that make their rows without simulating, as workers import them."""

from __future__ import annotations

import json
import os
import time
from collections.abc import Callable
from pathlib import Path
from tempfile import mkdtemp
from typing import Any

import numpy as np
import pandas as pd

from dataset.data_set import SWEEP, sweep_key, write_manifest
from dataset.design import Axis, SweepDesign
from dataset.folder import Folder
from dataset.schema import COST, arrow_table, schema
from dataset.shards import Part, checked_part, file_name, packed
from dataset.workers import Chunk, Ended
from sim.model.response import BEFORE, DWELLS
from tests.shared import FOLDER

SMALL = """
rows = 6
seed = 3
[inputs]
C_t = { range = [2.0, 5.0] }
C_r = { range = [1.5, 3.5] }
C_yr = { range = [1.0, 7.0] }
l_over_R = { range = [4.0, 9.0] }
L_over_R = { range = [3.0, 5.0] }
l_over_r0 = { range = [20.0, 45.0] }
omega_bar = { range = [6.0, 12.0], scale = "log" }
N = { range = [2, 3], scale = "integer" }
"""
DANGER = True  # of some rows that are made by `poisonous` or `raising`
Rows = Callable[[dict[str, np.ndarray]], dict[str, Any]]

# Where workers of tests leave marks; set before any worker starts.
MARKS = Path(os.environ.setdefault("SOFTFLAGELLA_TEST_MARKS", mkdtemp(dir=FOLDER)))


class InThisProcess:
    """A backend in this process."""

    def __init__(self) -> None:
        self._ended: Ended = []

    def slots(self) -> int:
        return 1

    def submit(self, chunk: Chunk) -> None:
        self._ended.append((chunk, chunk.run()))

    def collect(self, seconds: float) -> Ended:
        ended, self._ended = self._ended, []
        return ended

    def stop(self) -> None:
        self._ended = []


def design(rows: int, seed: int = 5) -> SweepDesign:
    """Design a sweep for synthetic rows."""
    axes = {
        "C_t": Axis(2, 5, "linear"), "C_r": Axis(1.5, 3.5, "linear"), "C_yr": Axis(1, 7, "linear"),
        "l_over_R": Axis(4, 9, "linear"), "L_over_R": Axis(3, 5, "linear"), "l_over_r0": Axis(20, 45, "linear"),
        "omega_bar": Axis(3, 18, "log"), "N": Axis(2, 5, "integer"),
    }  # fmt: skip
    return SweepDesign(axes, rows, seed)


def invented(p: dict[str, np.ndarray]) -> dict[str, Any]:
    """Make synthetic rows in closed form: every column of the schema, some robots failed."""
    rows = len(p["N"])
    share = 1 / (1 + p["C_r"] / p["N"])
    yaw = 0.05 * p["C_yr"] * share * p["omega_bar"] / 10
    sway = 0.9 * yaw * (1 + 1 / p["C_t"])
    surge = sway * (0.2 + 0.1 * np.log(p["l_over_r0"]) / p["L_over_R"])
    failed = p["omega_bar"] > 17.5
    dwells = len(DWELLS)
    lag = {"z": -0.04 * sway[:, None] * np.exp(-DWELLS), "x": -0.02 * sway[:, None] * np.ones(dwells),
           "psi_rad": 0.02 * yaw[:, None] * np.ones(dwells)}  # fmt: skip
    curves = {f"lag_{axis}": values for axis, values in lag.items()}
    for axis, values in lag.items():
        curves |= {f"spread_{axis}": 0.01 * np.abs(values), f"rest_{axis}": 0.5 * values}
        curves[f"memory_{axis}"] = np.concatenate([0.1 * values / (1 + k) for k in range(len(BEFORE))], 1)
    return {
        **p, "N": p["N"].astype(int), "a_over_R": np.ones(rows),
        "omega_t_bar": p["omega_bar"] * (1 - share), "omega_h_bar": -p["omega_bar"] * share,
        "omega_yr_bar": yaw, "v_x": sway, "v_z": surge, "R_yr_over_l": np.hypot(sway, surge) / yaw,
        "theta_deg": np.degrees(np.arctan2(sway, surge)), "net_speed_bar": surge[:, None] * np.ones(dwells),
        **curves, "tail_gap": 2 + p["l_over_R"] / p["N"], "error": np.zeros(rows),
        "converged": ~failed, "failed": failed, "touching": np.zeros(rows, bool),
        "stepped": np.zeros(rows, bool),
        "reason": np.where(failed, "it turns too fast", ""), COST: np.full(rows, 1e-3),
    }  # fmt: skip


def part(start: int, stop: int) -> Part:
    """Describe a file of rows."""
    return Part(start, stop, 0, "", stop - start, 0, 0, {}, 0.0)


def _mark(p: dict[str, np.ndarray], word: str) -> int:
    """Leave a mark for this chunk; how many there are now."""
    name = f"{word}-{float(p['C_t'][0]).hex()}"
    count = len(list(MARKS.glob(f"{name}-*")))
    (MARKS / f"{name}-{count}-{os.getpid()}").touch()
    return count + 1


def killing_once(p: dict[str, np.ndarray]) -> dict[str, Any]:
    """Make rows that kill their worker the first time."""
    if _mark(p, "once") == 1:
        os.kill(os.getpid(), 9)
    return invented(p)


def _dangerous(p: dict[str, np.ndarray]) -> bool:
    return DANGER and bool((p["C_t"] == design(101).points(100, 101)["C_t"][0]).any())


def poisonous(p: dict[str, np.ndarray]) -> dict[str, Any]:
    """Make rows of which some kill their worker every time: the chunk with the robot of row 100 of seed 5."""
    if _dangerous(p):
        _mark(p, "poison")
        os.kill(os.getpid(), 9)
    return invented(p)


def raising(p: dict[str, np.ndarray]) -> dict[str, Any]:
    """Make rows of which some raise an error: the chunk with the robot of row 100 of seed 5."""
    if _dangerous(p):
        raise ZeroDivisionError("a robot that nobody foresaw")
    return invented(p)


def slow(p: dict[str, np.ndarray]) -> dict[str, Any]:
    """Make rows slowly: a tenth of a second a chunk, and a mark."""
    _mark(p, "slow")
    time.sleep(0.1)
    return invented(p)


def endless(p: dict[str, np.ndarray]) -> dict[str, Any]:
    """Wait for ever."""
    _mark(p, "endless")
    time.sleep(600)
    return invented(p)


def write_rows(
    folder: Path, sweep: SweepDesign, columns: dict[str, Any], code: str, source: str = "dataset.simulate.simulate"
) -> None:
    """Store rows as a finished data set of one file."""
    key, form, there = sweep_key(sweep.config(), code, source), schema(sweep.effects), Folder(folder)
    table = arrow_table(columns, form)
    data = packed(table, key)
    there.write(file_name(0, len(table)), data)
    content = {"config": sweep.config(), "code": code, "rows_by": source, "key": key}
    there.write(SWEEP, json.dumps(content).encode())
    write_manifest(there, sweep, key, code, [checked_part(data, 0, len(table), form, key)])


def without_cost(rows: pd.DataFrame) -> pd.DataFrame:
    """Return all columns that are the same whenever a row is simulated."""
    return rows.drop(columns=COST)


def dying_in_the_write(p: dict[str, np.ndarray]) -> dict[str, Any]:
    """Make rows whose worker dies as it writes them: first at the fsync of the file, then at its renaming."""
    attempt = _mark(p, "write")

    def kill(*_: Any, **__: Any) -> None:
        os.kill(os.getpid(), 9)

    if attempt == 1:
        os.fsync = kill
    if attempt == 2:
        os.replace = kill
    return invented(p)
