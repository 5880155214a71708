"""Robots and vehicles for the tests of the page's core, and the look-up table as the page has it."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np

from planner.page.table_data import table_data
from planner.vehicle.from_table import table_vehicle
from planner.vehicle.vehicle import Vehicle
from sim.io.errors import InputError
from sim.model.presets import PRESETS
from sim.model.robot import Robot
from surrogate.input_ranges import ROBOT
from surrogate.table.lookup import NeuralTable
from surrogate.table.model_file import load
from surrogate.training.simulated import draw_robots
from tests.planner.page.page_core import typed

EXACT = 1e-12  # relative
SOLVED = 1e-11  # relative; balances are solved until a correction is 2e-12, on different ways


@cache
def shipped() -> NeuralTable:
    return load()


@cache
def shipped_data() -> str:
    """Return the shipped table as text for the page."""
    return table_data(shipped())


@cache
def random_groups(count: int, seed: int = 0) -> list[dict[str, float]]:
    """Draw robots with two to eight tails, every other one with its motor reversed."""
    columns = draw_robots(4 * count, seed, wide=False)
    rows = [{name: float(columns[name][row]) for name in ROBOT} for row in range(4 * count)]
    rows = [row for row in rows if row["N"] >= 2][:count]
    assert len(rows) == count
    return [row | {"omega_bar": (-1) ** i * row["omega_bar"]} for i, row in enumerate(rows)]


def columns_of(rows: list[dict[str, float]]) -> dict[str, np.ndarray]:
    return {name: np.array([row[name] for row in rows]) for name in rows[0]}


@cache
def random_robots(count: int, seed: int = 0) -> list[Robot]:
    """Draw robots near the paper's that the table knows."""
    rng, base = np.random.default_rng(seed), PRESETS["paper-control"]
    robots: list[Robot] = []
    while len(robots) < count:
        robot = replace(
            base,
            tails=int(rng.integers(2, 6)),
            C_t=3 * np.exp(0.3 * rng.normal()),
            C_r=2.8 * np.exp(0.3 * rng.normal()),
            C_yr=2 * np.exp(0.5 * rng.normal()),
            tail_length=float(rng.uniform(0.06, 0.13)),
            head_length=float(rng.uniform(0.04, 0.08)),
        ).with_motor(float(rng.uniform(2, 20)))
        with suppress(InputError):
            vehicle_of(robot)
            robots.append(robot)
    return robots


_VEHICLES: dict[tuple[float, ...], Vehicle] = {}


def vehicle_of(robot: Robot) -> Vehicle:
    """Return the vehicle of a robot without effects."""
    groups = tuple(robot.group_values().values())
    if groups not in _VEHICLES:
        _VEHICLES[groups] = table_vehicle(robot, shipped())
    return _VEHICLES[groups]


def vehicle_to_page(vehicle: Vehicle) -> dict[str, Any]:
    """Write a vehicle as the core has it."""
    return {
        "twist": vehicle.twist.tolist(),
        **{name: _sides(getattr(vehicle, name)) for name in ("lag", "rest", "spread")},
        "phaseRate": vehicle.phase_rate.tolist(),
        "modes": [
            {
                "name": mode.name,
                "twist": mode.twist.tolist(),
                "lag": None if mode.lag is None else _sides(mode.lag),
                "current": mode.current.tolist(),
            }
            for mode in vehicle.modes
        ],
        "current": vehicle.current.tolist(),
        "tailGap": vehicle.tail_gap,
        "leastGap": vehicle.least_gap,
    }


def _sides(tables: np.ndarray) -> list[Any]:
    return [typed(table.ravel()) for table in tables]


def check_alike(found: Any, wanted: Any, allowed: float = EXACT) -> None:
    """Assert that numbers are alike relative to the largest one of each column, the last axis."""
    found, wanted = np.asarray(found, dtype=float), np.asarray(wanted, dtype=float)
    assert found.shape == wanted.shape
    columns = wanted.reshape(-1, wanted.shape[-1]) if wanted.ndim else wanted.reshape(1, 1)
    sizes = np.abs(columns).max(0)
    assert (np.abs(found.reshape(columns.shape) - columns) <= allowed * sizes).all()


def check_equal_outputs(found: Mapping[str, Any], wanted: Mapping[str, Any], row: int, allowed: float) -> None:
    """Assert that each output of an answer is that of a row of Python's."""
    for name, values in wanted.items():
        value = float(values[row])
        assert abs(found[name] - value) <= allowed * abs(value), (row, name, found[name], value)
