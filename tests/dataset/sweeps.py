"""Small sweeps for tests, and functions that make their rows without simulating, as workers import them."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from pathlib import Path
from tempfile import mkdtemp
from typing import Any

import numpy as np
import pandas as pd

from dataset.rows.design import Axis, SweepDesign
from dataset.rows.schema import COST, arrow_table, schema
from dataset.storage.data_set import ROWS, manifest_content, write_manifest
from dataset.storage.shards import shard_name, write_shard
from dataset.storage.storage import open_storage
from dataset.workers.backend import Lost
from dataset.workers.tasks import Join, Outcome, Task, run_task
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
Rows = Callable[[dict[str, np.ndarray]], dict[str, Any]]
ROOT = Path(__file__).parents[2]
# Where workers of tests leave marks; set before any worker starts.
MARKS = Path(os.environ.setdefault("SOFTFLAGELLA_TEST_MARKS", mkdtemp(dir=FOLDER)))


class InThisProcess:
    """A backend in this process."""

    def __init__(self) -> None:
        self._ended: list[tuple[int, Outcome | Lost]] = []

    def slots(self) -> int:
        return 1

    def submit(self, number: int, task: Task | Join) -> None:
        self._ended.append((number, run_task(task)))

    def collect(self, seconds: float) -> list[tuple[int, Outcome | Lost]]:
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


def poisonous(p: dict[str, np.ndarray]) -> dict[str, Any]:
    """Make rows of which some kill their worker every time: the chunk with the robot of row 100 of seed 5."""
    if (p["C_t"] == design(101).points(100, 101)["C_t"][0]).any():
        _mark(p, "poison")
        os.kill(os.getpid(), 9)
    return invented(p)


def raising(p: dict[str, np.ndarray]) -> dict[str, Any]:
    """Make rows of which some raise an error: the chunk with the robot of row 100 of seed 5."""
    if (p["C_t"] == design(101).points(100, 101)["C_t"][0]).any():
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


def write_rows(folder: Path, manifest: dict[str, Any], columns: dict[str, Any]) -> None:
    """Store rows as a finished data set with the configuration and version of another one."""
    config, effects, code = manifest["config"], manifest["effects"], manifest["code_version"]
    storage, key = open_storage(folder), manifest["config_hash"]
    table = arrow_table(columns, schema(effects, config["sensitivities"]))
    contents = write_shard(storage, shard_name(ROWS, 0, len(table)), table, key)
    write_manifest(storage, manifest_content(config, key, code, effects, [contents]))


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
