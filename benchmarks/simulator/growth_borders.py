"""Borders of stability along the motor's speed, and time steps on both sides of each.

Without contact the orbit with tails alike is followed from a slow motor along its whole branch, around folds
(`sim.motion.continuation`). With contact each orbit is solved on its own, from a slow motor, and the border is
searched for between two speeds.

On each side of a border the tails of a robot on the orbit are bent a little, and it is stepped in time for a turn
of its disc, on the orbit's mesh. The difference from the unperturbed robot is scaled back to its first size and
stepped again, turn by turn. Its growth must have the sign that is stated.
Source of the last: Benettin, Galgani, Giorgilli and Strelcyn, *Meccanica* 15, 9 (1980).
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from sim.arrays import Floats
from sim.model.body import Body
from sim.model.robot import Robot
from sim.motion.continuation import Point, first_point, follow, locate
from sim.motion.exponents import Leading, leading_exponent
from sim.motion.revolution import STEPS, Revolutions
from sim.motion.slow_sweep import perturbed
from sim.motion.swept_input import SweptInput
from sim.motion.tails_alike import TailsAlike
from sim.motion.turn_shapes import state_from_orbit
from sim.solve.assembly import bodies
from sim.solve.march import State
from sim.solve.orbit import mean_motion
from sim.solve.refinement import FEW, SOLVED, refined_orbit

_SIZE = 1e-4  # of the perturbation of all nodes together, in l
_STEPS, _STEPS_IN_CONTACT = 2 * STEPS, STEPS  # in a motor revolution
_TURNS, _TURNS_IN_CONTACT = 20, 10  # of the disc; the growth is measured over the last three quarters of them
_PLAIN = 0.3  # size of a growth that is plain enough, however near the border
_MOST_POINTS = 150  # of a branch
_CLOSE = 2e-3  # relative width of the interval of speeds to which a border with contact is narrowed


class Side(NamedTuple):
    """An orbit beside a border."""

    omega_bar: float
    stated: float  # growth in a motor revolution; NaN: there is no orbit here
    stepped: float  # the same in time steps; NaN: a step failed

    @property
    def agrees(self) -> bool:
        """Whether both decay or both grow."""
        return self.stated * self.stepped > 0


class Border(NamedTuple):
    """Where the growth changes its sign."""

    curvature: float  # 1/l
    twist: float  # 1/l
    omega_bar: float
    kind: str  # `sim.motion.exponents`
    lost: bool  # stability is lost here on the way from a slow motor, else regained
    sides: list[Side]  # before and after, on this way; fewer where the branch leaves no room

    def __str__(self) -> str:
        """Say where it is, and what time steps do on both sides."""
        sides = "; ".join(
            f"at {side.omega_bar:.1f} {side.stated:+.2f}, in time steps {side.stepped:+.2f}" for side in self.sides
        )
        return (
            f"curvature {self.curvature:+.2f}, twist {self.twist:g}: {'lost' if self.lost else 'regained'} at "
            f"ω̄ = {self.omega_bar:.1f} ({self.kind}); growth {sides}"
        )


def stepped_growth(body: Body, tails: int, x: Floats, u: Floats, steps: int, count: int) -> float:
    """Measure the growth in a motor revolution, from an orbit x (n, M, 3), u (P, 4); NaN where a step fails.

    Args:
        body: a robot with N tails.
        tails: N.
        x: the orbit's shape.
        u: the orbit's velocities.
        steps: in a motor revolution.
        count: turns of the disc.
    """
    omega_t, omega_h = mean_motion(body, u)[:2]
    share = abs(omega_t / (omega_t - omega_h))
    turns = Revolutions(lambda _: body, tails, len(x), int(np.ceil(steps / share)))
    start = state_from_orbit(body, x, u)
    here = turns.timed(start, 0.0, 2 * np.pi / abs(omega_t))
    if here is None:
        return np.nan
    change = perturbed(start, 1.0, 0).x - start.x
    growths = []
    for _ in range(count):
        change *= _SIZE / np.linalg.norm(change)
        bent = State(start.x + change, start.x_dot.copy(), start.pose.copy(), start.u.copy())
        there = turns.turn(bent, 0.0, here.time)
        if there is None:
            return np.nan
        change = there.state.x - here.state.x
        growths.append(np.log(np.linalg.norm(change) / _SIZE))
    return float(np.mean(growths[count // 4 :]) * share)


def borders_of_branch(robot: Robot, limits: tuple[float, float], away: float) -> list[Border]:
    """Follow the orbit with tails alike from a slow motor, and find where its growth changes its sign.

    Args:
        robot: without contact.
        limits: of ω̄, where the branch begins and ends.
        away: relative distance of the two sides from the border. They are nearer where the growth is plain before,
            and half way to where the branch turns back or the growth changes its sign again.
    """
    swept = SweptInput(robot, "omega_bar", *limits)
    family = TailsAlike(swept.body_at, robot.tails)
    start = family.start(0.0)
    first = None if start is None else first_point(family, start, 1.0)
    if first is None:
        return []

    def leading(point: Point) -> Leading:
        return leading_exponent(swept.body_at(point.s), robot.tails, *family.unpack(point.y))

    def side(points: list[Point], growths: list[float], border: float) -> list[Side]:
        """Choose the point beside the border, and step from it."""
        chosen = 0
        for point, growth in zip(points, growths, strict=True):
            if point.turns * points[0].turns < 0 or growth * growths[0] < 0:
                chosen //= 2
                break
            if abs(swept.value(point.s) / border - 1) >= away or abs(growth) > _PLAIN:
                break
            chosen += 1
        if not points or not 0 <= chosen < len(points):
            return []
        point = points[chosen]
        stepped = stepped_growth(swept.body_at(point.s), robot.tails, *family.unpack(point.y), _STEPS, _TURNS)
        return [Side(swept.value(point.s), growths[chosen], stepped)]

    points = [first, *follow(family, first, _MOST_POINTS)]
    growths = [leading(point).growth for point in points]
    borders = []
    for i, (growth, next_growth) in enumerate(pairwise(growths)):
        crossing = None
        if growth * next_growth < 0:
            crossing = locate(family, points[i], points[i + 1], lambda p: leading(p).growth)
        if crossing is not None:
            place = swept.value(crossing.s)
            before = side(points[i::-1], growths[i::-1], place)
            after = side(points[i + 1 :], growths[i + 1 :], place)
            curvature, twist = (robot.effects.get(name, 0.0) for name in ("natural_curvature", "natural_twist"))
            kind = leading(crossing).kind
            borders.append(Border(curvature, twist, place, kind, growth < 0, before + after))
    return borders


class Pressed(NamedTuple):
    """The orbit of a robot whose tails push against each other, on the finest mesh of a row."""

    body: Body
    x: Floats
    u: Floats
    leading: Leading  # its growth is NaN where there is no orbit


def orbit_in_contact(robot: Robot, omega_bar: float, curvature: float) -> Pressed:
    """Solve for the orbit with contact at a speed and a natural curvature, and for its growth."""
    groups = replace(robot, effects={"natural_curvature": curvature, "tail_contact": 1.0}).with_motor(omega_bar)
    body = bodies(groups.groups())[0]
    orbit = refined_orbit(body, robot.tails, FEW)
    x, u = orbit.x[2], orbit.u[2]
    if orbit.ended != SOLVED:
        return Pressed(body, x, u, Leading(np.nan, np.nan, robot.tails))
    return Pressed(body, x, u, leading_exponent(body, robot.tails, x, u))


def border_in_contact(
    robot: Robot, curvature: float, speeds: Floats, growths: Floats, away: float
) -> list[Border]:
    """Search for the border between the first two speeds between which stability is lost.

    Args:
        robot: without effects.
        curvature: of the tails, 1/l.
        speeds: ω̄, ascending, (S,).
        growths: with contact, at these speeds, (S,).
        away: relative distance of the two sides from the border.
    """
    crossed = np.flatnonzero((growths[:-1] < 0) & (growths[1:] > 0))
    if not len(crossed):
        return []
    low, high = np.log(speeds[crossed[0] : crossed[0] + 2])
    while high - low > _CLOSE:
        middle = (low + high) / 2
        growth = orbit_in_contact(robot, float(np.exp(middle)), curvature).leading.growth
        if not np.isfinite(growth):
            return []
        low, high = (low, middle) if growth > 0 else (middle, high)
    place = float(np.exp((low + high) / 2))
    sides = []
    for way in (-away, away):
        beside = orbit_in_contact(robot, (1 + way) * place, curvature)
        if np.isfinite(beside.leading.growth):
            effort = _STEPS_IN_CONTACT, _TURNS_IN_CONTACT
            stepped = stepped_growth(beside.body, robot.tails, beside.x, beside.u, *effort)
            sides.append(Side((1 + way) * place, beside.leading.growth, stepped))
    kind = orbit_in_contact(robot, place, curvature).leading.kind
    return [Border(curvature, 0.0, place, kind, True, sides)]
