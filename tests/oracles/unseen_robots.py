"""Unseen robots and paths as labs have them, planned with the shipped table, carried out by their own tables."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from planner.paths.path import Path2D, circle, polygon
from planner.planning.plan import plan
from planner.planning.planned import Plan
from planner.planning.stated_error import predicted_error
from planner.vehicle.from_table import table_vehicle
from planner.vehicle.rollout import trace
from sim.io.errors import InputError
from sim.model.presets import PRESETS
from sim.model.robot import Robot
from surrogate.interface import LookupTable
from surrogate.one_robot.tabulate import tabulate
from surrogate.table.lookup import NeuralTable

LONG = 2000  # dwells
_LARGEST = 40.0  # times, to which a long path is enlarged


class Carried(NamedTuple):
    """A plan that the vehicle of the robot's own table carried out; lengths in l."""

    result: Plan
    own: LookupTable  # the robot's own table
    found: float  # largest distance from the declared path

    @property
    def held(self) -> bool:
        return self.found <= self.result.stated_error


def lab_robot(rng: np.random.Generator) -> Robot:
    """Draw a robot as labs have them."""
    length = rng.uniform(0.07, 0.13)
    radius = length / rng.uniform(4, 9)
    robot = replace(
        PRESETS["paper-control"],
        tails=int(rng.integers(2, 6)),
        tail_length=length,
        C_t=rng.uniform(1.5, 5),
        C_r=rng.uniform(1.2, 3.5),
        C_yr=rng.uniform(1, 6),
        head_radius=radius,
        head_length=radius * rng.uniform(2.5, 5),
        tail_radius=length / rng.uniform(20, 45),
    )
    return robot.with_motor(float(np.exp(rng.uniform(np.log(5), np.log(80)))))


def lab_path(rng: np.random.Generator) -> Path2D:
    """Draw a path of 1.5 to 8 l in radius or side."""
    radius = rng.uniform(1.5, 8)
    kind = rng.integers(4)
    angle = np.linspace(0, 2 * np.pi, 1200)
    if kind == 0:
        return circle(radius)
    if kind == 1:
        return Path2D.of(radius * np.stack([np.sin(angle), np.sin(2 * angle) / 2], 1), closed=True)
    if kind == 2:
        waves = (rng.normal() * 0.12 / k * np.cos(k * angle + rng.uniform(0, 6)) for k in (2, 3, 4))
        size = radius * (1 + np.sum(list(waves), axis=0))
        return Path2D.of(size[:, None] * np.stack([np.cos(angle), np.sin(angle)], 1), closed=True)
    return polygon(int(rng.integers(3, 7)), radius)


def planned(seed: int, lookup: NeuralTable) -> Plan:
    """Draw a robot and a path, and plan; every third plan is a long one.

    Raises:
        InputError: there is no such plan.
    """
    rng = np.random.default_rng(seed)
    robot, path = lab_robot(rng), lab_path(rng)
    result = plan(path, robot, lookup=lookup)
    size = 1.0
    while seed % 3 == 0 and len(result.dwells) <= LONG:
        size *= max(1.1, 1.1 * LONG / len(result.dwells))
        if size > _LARGEST:
            raise InputError(
                f"{seed}: a path of {size:.0f} times the size still takes {len(result.dwells)} dwells"
            )
        result = plan(path.scaled(size), robot, lookup=lookup)
    return result


def carried(seed: int, lookup: NeuralTable) -> Carried:
    """Plan one seed, and carry the plan out.

    Raises:
        InputError: there is no such plan, or the robot cannot be simulated.
    """
    result = planned(seed, lookup)
    own = tabulate(result.robot)
    track = trace(table_vehicle(result.robot, own), result.switches, result.tracked.offset)
    return Carried(result, own, predicted_error(result.reference, track, closed=result.drawn.closed).largest)
