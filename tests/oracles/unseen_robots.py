"""Unseen robots and paths as labs have them, planned with the shipped table, carried out by their own tables."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from common.arrays import Floats
from planner.jobs.plan import plan
from planner.paths.path import Path2D, circle, polygon
from planner.planning.plan import Plan
from planner.planning.stated_error import WOBBLE, error_growth, plan_errors, predicted_error
from planner.vehicle.from_table import table_vehicle
from planner.vehicle.tracked_point import TrackedVehicle
from planner.vehicle.vehicle import Rollout, Switches, roll_out
from sim.model.presets import PRESETS
from sim.model.robot import Robot
from surrogate.table import NeuralTable
from surrogate.tabulate import tabulate

LONG = 150.0  # l, from which a path is a long one


class Carried(NamedTuple):
    """A plan that the vehicle of the robot's own table carried out; lengths in l."""

    kind: str  # of the path
    result: Plan
    own_stated: float  # stated error of the same schedule with the robot's own table
    # Largest distance from the declared path, at one phase of the disc, with the motion within its revolution.
    found: float

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


def lab_path(rng: np.random.Generator) -> tuple[str, Path2D]:
    """Draw one of KINDS of paths, of 5 to 250 l; return its kind, too."""
    length = float(np.exp(rng.uniform(np.log(5), np.log(250))))
    kind = list(KINDS)[int(rng.integers(len(KINDS)))]
    path = KINDS[kind](rng, length)
    return kind, path.scaled(length / path.length)


def _race_track(rng: np.random.Generator, _length: float) -> Path2D:
    """Draw corners around an ellipse, and cut them four times."""
    count = int(rng.integers(5, 12))
    angle, reach = np.sort(rng.uniform(0, 2 * np.pi, count)), rng.uniform(0.5, 1.0, count)
    corners = reach[:, None] * np.stack([1.6 * np.cos(angle), np.sin(angle)], 1)
    for _ in range(4):
        after = np.roll(corners, -1, 0)
        corners = np.stack([0.75 * corners + 0.25 * after, 0.25 * corners + 0.75 * after], 1).reshape(-1, 2)
    return Path2D.of(corners, closed=True)


def _field(rng: np.random.Generator, length: float) -> Path2D:
    """Draw lanes to and fro, some with a way back."""
    lanes = int(np.clip(round(np.sqrt(length / rng.uniform(1.5, 4))), 2, 14))
    ends = np.array([0.0, lanes * rng.uniform(0.8, 2)])
    lane = np.arange(lanes).repeat(2)
    return Path2D.of(np.stack([np.where(lane % 2, np.tile(ends[::-1], lanes), np.tile(ends, lanes)), lane], 1),
                     closed=bool(rng.random() < 0.5))  # fmt: skip


def _handwriting(rng: np.random.Generator, length: float) -> Path2D:
    """Draw a row of loops of varying height and width."""
    letters = max(2, round(length / rng.uniform(8, 16)))
    knots = 2 * np.pi * np.arange(letters + 1)
    angle = np.linspace(0, knots[-1], 60 * letters)
    width, height = (np.interp(angle, knots, rng.uniform(*span, letters + 1)) for span in ((0.6, 1.0), (0.8, 1.6)))
    return Path2D.of(np.stack([0.25 * angle - width * np.sin(angle), height * np.cos(angle)], 1), closed=False)


def _coast(rng: np.random.Generator, _length: float) -> Path2D:
    """Draw an island with a rough outline."""
    waves, angle = np.arange(2, 24)[:, None], np.linspace(0, 2 * np.pi, 600, endpoint=False)
    size = 0.5 * rng.normal(size=waves.shape) / waves ** rng.uniform(1.3, 2)
    reach = 1 + (size * np.cos(waves * angle + rng.uniform(0, 2 * np.pi, waves.shape))).sum(0)
    return Path2D.of(np.clip(reach, 0.2, None)[:, None] * np.stack([np.cos(angle), np.sin(angle)], 1), closed=True)


def _regular(rng: np.random.Generator, _length: float) -> Path2D:
    angle = np.linspace(0, 2 * np.pi, 1200)
    eight = Path2D.of(np.stack([np.sin(angle), np.sin(2 * angle) / 2], 1), closed=True)
    return (circle(1.0), eight, polygon(int(rng.integers(3, 7)), 1.0))[int(rng.integers(3))]


KINDS: dict[str, Callable[[np.random.Generator, float], Path2D]] = {
    "race track": _race_track,
    "field": _field,
    "handwriting": _handwriting,
    "coast": _coast,
    "polygon, circle or eight": _regular,
}


def carried(seed: int, lookup: NeuralTable) -> Carried:
    """Draw a robot and a path, plan, and carry the plan out.

    Raises:
        InputError: there is no such plan, or the robot cannot be simulated.
    """
    rng = np.random.default_rng(seed)
    robot = lab_robot(rng)
    kind, path = lab_path(rng)
    result = plan(path, robot, lookup=lookup)
    own = tabulate(robot)
    tracked = result.tracked._replace(vehicle=table_vehicle(robot, own))
    errors = plan_errors(tracked, result.drawn, result.declared, result.switches, guaranteed=None, seed=0)
    rollout = roll_out(tracked.vehicle, result.switches, tracked.offset)
    track = rollout.track + _of_a_phase(rng, tracked, result.switches, rollout)
    found = predicted_error(result.reference, track, closed=result.drawn.closed).largest
    return Carried(kind, result, errors.stated, found + WOBBLE)


def _of_a_phase(rng: np.random.Generator, tracked: TrackedVehicle, switches: Switches, rollout: Rollout) -> Floats:
    """Draw the disc's phase at the first flip for each direction; return what it moves the track, (K, 2)."""
    growth = error_growth(replace(tracked.vehicle, modes=()), switches, rollout)
    angle = rng.uniform(0, 2 * np.pi, 2)
    waves = np.sqrt(2) * np.stack([np.cos(angle), np.sin(angle)], 1).ravel()
    moved = np.einsum("p,epi->ei", waves, growth.deviation)
    samples = (len(rollout.track) - 1) // len(switches.dwells)
    place = np.arange(len(rollout.track)) / samples
    return np.stack([np.interp(place, growth.flips, part) for part in moved.T], 1)
