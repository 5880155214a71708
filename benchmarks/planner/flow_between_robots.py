"""Distance within which the flow of one robot moves another by 5 % and by 1 % of its swimming speed.

Usage: python -m benchmarks flow_between_robots

Tails and head push the fluid with the forces of steady motion (resistive force theory). Head and tails balance:
the head's force and torque are those that make the sums zero. The flow at a place is the sum of the Stokeslets
and the rotlet (Pozrikidis 1992, ch. 2), averaged over a revolution of the disc. The place is in the plane of
motion, at a distance from the body, in the direction where the flow is fastest. With a free surface each force has
an image at the height of `sim.mechanics.flow`. A robot that swims straight flips its motor, so its flow is the
mean of both directions; in a circle it is that of one.

Takes a minute.
"""

from __future__ import annotations

import math

import numpy as np

from planner.paths.obstacles import Footprint
from planner.vehicle.dwell_choice import dwells_for
from planner.vehicle.tracked_point import tracked_vehicle
from planner.vehicle.zigzag import zigzag
from sim.arrays import Floats
from sim.linear.spectral import differentiation
from sim.mechanics.balance import motion_at, tail_spin
from sim.mechanics.flow import HEIGHT
from sim.model.body import Body
from sim.model.presets import PRESETS
from sim.model.robot import Robot
from sim.solve.assembly import bodies
from sim.solve.orbit import FIRST_PHASE
from sim.solve.refinement import FEW, SOLVED, refined_orbit

DISTANCES = np.geomspace(0.05, 20.0, 36)  # l, between body and place
_DIRECTIONS = 36
_PHASES = 8  # of a period
_HEAD = 4  # forces along the head


class Forces:
    """Forces on the fluid at places, means over a revolution, and a torque at the head's centre; body frame."""

    def __init__(self, places: Floats, forces: Floats, centre: Floats, torque: Floats):
        self.places, self.forces, self.centre, self.torque = places, forces, centre, torque

    def flow(self, at: Floats, viscosity: float) -> Floats:
        """Compute the velocity of the fluid (K, 3) at places (K, 3)."""
        total = np.zeros_like(at)
        for rows in np.array_split(np.arange(len(at)), math.ceil(len(at) * len(self.places) / 1e6)):
            away = at[rows, None] - self.places
            inverse = 1 / np.sqrt(np.einsum("kfi,kfi->kf", away, away))
            along = np.einsum("kfi,fi->kf", away, self.forces) * inverse**3
            total[rows] = inverse @ self.forces + np.einsum("kf,kfi->ki", along, away)
        away = at - self.centre
        total += np.cross(self.torque, away) / (away**2).sum(1)[:, None] ** 1.5
        return np.asarray(total / (8 * np.pi * viscosity))

    def mirrored(self, axis: int, at: float = 0.0) -> Forces:
        """Mirror in a plane across an axis; the torque is an axial vector."""
        sign = np.ones(3)
        sign[axis] = -1.0
        shift = np.zeros(3)
        shift[axis] = 2 * at
        return Forces(
            sign * self.places + shift, sign * self.forces, sign * self.centre + shift, -sign * self.torque
        )


def forces_of(body: Body, tails: int) -> Forces:
    """Compute the forces of a robot in steady motion."""
    orbit = refined_orbit(body, tails, FEW)
    assert orbit.ended == SOLVED
    x, u = orbit.x[2], orbit.u[2]
    n, count, _ = x.shape
    slope = np.einsum("ml,klc->kmc", differentiation(count), x)
    cell = np.full(n + 1, 1.0 / n)
    cell[[0, -1]] /= 2
    places, forces = [], []
    every = max(1, count // (_PHASES * tails))  # smooth in the phase, so a few are enough
    every = next(step for step in range(every, 0, -1) if len(u) % step == 0)
    for m in range(0, count, every):
        phase = FIRST_PHASE + 2 * np.pi * m / count
        motion = motion_at(body, u[m % len(u)], phase)
        nodes = np.concatenate([[[body.offset, 0.0, 0.0]], x[:, m]])
        velocity = np.array(motion.linear) + np.cross(motion.spin, nodes)
        velocity[1:] += slope[:, m] * tail_spin(body, u[m % len(u)])
        before = nodes[:1] + np.array([0.0, 0.0, 1.0 / n])  # the tail is clamped along the axis
        edges = np.diff(np.concatenate([before, nodes]), axis=0)
        edges /= np.sqrt((edges**2).sum(1))[:, None]
        tangent = edges + np.concatenate([edges[1:], edges[-1:]])
        tangent /= np.sqrt((tangent**2).sum(1))[:, None]
        along = (tangent * velocity).sum(1)[:, None] * tangent
        drag = cell[:, None] * (body.zeta_perp * velocity + (body.zeta_parallel - body.zeta_perp) * along)
        frame = np.array([motion.e_x, motion.e_y, (0.0, 0.0, 1.0)])  # rows: the body's axes
        places.append(nodes @ frame.T)
        forces.append(drag @ frame.T * every / len(u))
    r, f = np.concatenate(places), np.concatenate(forces)
    centre = np.array([0.0, 0.0, body.head_length / 2])
    head = np.zeros((_HEAD, 3))
    head[:, 2] = (np.arange(_HEAD) + 0.5) / _HEAD * body.head_length
    push = np.repeat(-f.sum(0)[None] / _HEAD, _HEAD, 0)
    torque = -np.cross(r - centre, f).sum(0)
    return Forces(np.concatenate([r, head]), np.concatenate([f, push]), centre, torque)


def fastest(parts: list[Forces], robot: Robot, viscosity: float) -> Floats:
    """Compute the fastest flow in the plane of motion at each of DISTANCES from the body."""
    body = Footprint.of(robot, -robot.head_length / 2 / robot.tail_length)  # from the disc
    front, back = float(body.places.max()), float(body.places.min())
    turn = 2 * math.pi * np.arange(_DIRECTIONS) / _DIRECTIONS
    speeds = []
    for distance in DISTANCES:
        away = (distance + body.radius) * np.stack([np.sin(turn), 0 * turn, np.cos(turn)], 1)
        ends = np.concatenate([away[away[:, 2] >= 0] + [0, 0, front], away[away[:, 2] <= 0] + [0, 0, back]])
        along = np.linspace(back, front, 12)
        side = np.stack([np.full(12, distance + body.radius), 0 * along, along], 1)
        at = np.concatenate([ends, side, side * [-1, 1, 1]])
        flow = np.sum([part.flow(at, viscosity) for part in parts], axis=0)
        speeds.append(np.hypot(flow[:, 0], flow[:, 2]).max())
    return np.array(speeds)


def reach(speeds: Floats, limit: float) -> float:
    """Find the distance beyond which the flow is slower."""
    above = np.flatnonzero(speeds > limit)
    if not len(above):
        return 0.0
    k = int(above[-1])
    if k + 1 == len(speeds):
        return math.inf
    low, high = np.log(speeds[k : k + 2] / limit)
    return float(DISTANCES[k] * (DISTANCES[k + 1] / DISTANCES[k]) ** (low / (low - high)))


def main() -> None:
    print(f"{'robot':20}{'motion':>10}{'surface':>9}{'5 % at':>18}{'1 % at':>18}"
          f"{'at 0.5 l':>10}{'at 1 l':>8}{'decay':>7}")  # fmt: skip
    for name, robot in PRESETS.items():
        body, tails = bodies(robot.groups())[0], robot.groups().N
        tracked = tracked_vehicle(robot, None, "head_centre", None)
        speed = zigzag(tracked.vehicle, dwells_for(tracked.vehicle, "error", None)[0]).net_speed
        circling = forces_of(body, tails)
        height = HEIGHT * max(body.offset, body.head_radius)
        half = Forces(circling.places, circling.forces / 2, circling.centre, circling.torque / 2)
        for motion, direct in (("straight", [half, half.mirrored(0)]), ("circle", [circling])):
            for surface in (False, True):
                parts = [*direct, *([part.mirrored(1, height) for part in direct] if surface else [])]
                speeds = fastest(parts, robot, body.viscosity) / speed
                near, far = (reach(speeds, limit) for limit in (0.05, 0.01))
                decay = math.log(speeds[-1] / speeds[-8]) / math.log(DISTANCES[-1] / DISTANCES[-8])
                nearer = [100 * float(np.interp(d, DISTANCES, speeds)) for d in (0.5, 1.0)]
                cm = 100 * robot.tail_length
                print(f"{name:20}{motion:>10}{'yes' if surface else 'no':>9}{near:8.2f} l {cm * near:5.1f} cm"
                      f"{far:8.2f} l {cm * far:5.1f} cm{nearer[0]:8.0f} %{nearer[1]:6.0f} %{decay:7.2f}",
                      flush=True)  # fmt: skip
