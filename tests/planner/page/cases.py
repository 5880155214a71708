"""Robots, vehicles, paths, plans and runs by which the core is compared with Python."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from itertools import product
from typing import Any

import numpy as np
import pandas as pd

from planner.jobs.plan import make_plan
from planner.paths.path import Path2D, circle, polygon
from planner.planning.plan import Plan
from planner.planning.request import PlanRequest
from planner.vehicle.measured import MeasuredVehicle
from planner.vehicle.tracked_point import Point, TrackedVehicle
from planner.vehicle.vehicle import Mode, Vehicle
from sim.model.presets import PRESETS
from sim.motion.steady_motion import LAB_COLUMNS
from softflagella import query
from surrogate.domain import ROBOT as GROUPS
from surrogate.table import NeuralTable
from surrogate.table_file import load
from surrogate.training.simulated import draw_robots
from tests.planner.vehicles import vehicle
from tests.shared import shared

CONTROL, TRIANGLE, MEASURED = (PRESETS[f"paper-{name}"] for name in ("control", "triangle", "measured"))


@cache
def shipped() -> NeuralTable:
    return load()


@cache
def random_groups(count: int) -> list[dict[str, float]]:
    """Draw robots with two to eight tails, every other one with its motor reversed."""
    columns = draw_robots(4 * count, 0, wide=False)
    rows = [{name: float(columns[name][row]) for name in GROUPS} for row in range(4 * count)]
    rows = [row for row in rows if row["N"] >= 2][:count]
    assert len(rows) == count
    return [row | {"omega_bar": (-1) ** i * row["omega_bar"]} for i, row in enumerate(rows)]


def columns_of(rows: list[dict[str, float]]) -> dict[str, np.ndarray]:
    return {name: np.array([row[name] for row in rows]) for name in rows[0]}


TURN, SHARE, LONG = np.linspace(0, 2 * np.pi, 400, endpoint=False), np.linspace(0, 1, 150), np.linspace(0, 9, 300)
HAND = np.stack([6 * SHARE, 2 * np.sin(4 * SHARE) + SHARE**2], 1)  # as a hand draws a stroke
SQUARE, BEND = polygon(4, 3.0), Path2D.of([[0, 0], [3, 0], [3, 4]])
PATHS = {
    "circle": circle(2.0),
    "square": SQUARE,
    "triangle": polygon(3, 4.0),
    "eight": Path2D.of(3 * np.stack([np.sin(TURN), np.sin(2 * TURN) / 2], 1), closed=True),
    "wave": Path2D.of(np.stack([LONG, 0.8 * np.sin(2 * np.pi * LONG / 3)], 1)),
    "stroke": Path2D.of(HAND + 0.01 * np.random.default_rng(24).normal(size=HAND.shape)),
    "bend": BEND,
    "line": Path2D.of([[0, 0], [5, 1]]),
    "star": polygon(5, 3.0),
}


def _in_a_current() -> Vehicle:
    """A vehicle whose current and lags are uncertain, too."""
    car = vehicle()
    rng = np.random.default_rng(1)
    uncertain = Mode("current", np.zeros((2, 3)), None, np.array([1e-4, -2e-4]))
    lagging = Mode("lag", 1e-4 * rng.normal(size=(2, 3)), 1e-4 * rng.normal(size=car.lag.shape))
    spread = rng.uniform(0.0, 1e-3, car.spread.shape)
    current = np.array([0.002, -0.003])
    return replace(car, current=current, modes=(*car.modes, uncertain, lagging), spread=spread, tail_gap=0.7)


VEHICLES = {
    "symmetric": vehicle(),
    "biased": vehicle(bias=0.1),
    "without lags": vehicle(lag=0.0),
    "with a long memory": vehicle(memory=3.0),
    "in a current": _in_a_current(),
}


MEASURED_VEHICLES = {
    "exact": MeasuredVehicle(speed=0.25, turn_left=0.7, turn_right=0.6),
    "slipping": MeasuredVehicle(
        speed=(0.02, 4e-4), turn_left=(0.25, 0.01), turn_right=(0.2, 0.01), slip=(0.4, 0.02), lag=(0.8, 0.1)
    ),
    "with a body": MeasuredVehicle(
        speed=(0.25, 5e-3), turn_left=(0.7, 0.02), turn_right=(0.6, 0.02), slip=(0.1, 0.02), lag=(0.05, 0.1),
        name="it's a car", length=0.3, width=0.18,
    ),
}  # fmt: skip


def tracked_of(car: Vehicle, offset: float = 0.0) -> TrackedVehicle:
    """Return a vehicle with the tracked point, as what is of no table."""
    point: Point = "head_tip" if offset else "head_centre"
    return TrackedVehicle(CONTROL, car, point, offset, "none", own_table=False)


@shared
def followed(path: str, car: str, offset: float = 0.0, **options: Any) -> Plan:
    """Plan for one of PATHS and one of VEHICLES."""
    return make_plan(PATHS[path], tracked_of(VEHICLES[car], offset), PlanRequest(**options))


def look_up(runs: pd.DataFrame) -> dict[str, np.ndarray]:
    """Ask the look-up table for the motion of each run, in the columns of a measured table."""
    motion = query(runs[["N", "l_cm", "omega_rpm"]], robot=MEASURED, lookup=shipped())
    return {name: motion[name].to_numpy() for name in LAB_COLUMNS}


def table_of_runs() -> pd.DataFrame:
    """Make runs of two numbers of tails, two lengths and two speeds, in both directions and three sessions."""
    conditions = product((3, 4), (7.0, 9.5), (100.0, 150.0), (1, -1), range(3))
    rows = [(tails, length, sense * speed, f"day {k}") for tails, length, speed, sense, k in conditions]
    runs = pd.DataFrame(rows, columns=["N", "l_cm", "omega_rpm", "session"])
    rng = np.random.default_rng(7)
    answers = look_up(runs)
    for name in ("omega_h_rpm", "omega_t_rpm", "omega_yr_rad_s", "R_yr_cm", "theta_deg"):
        runs[name] = answers[name] * np.exp(0.03 * rng.normal(size=len(runs)))
    return runs
