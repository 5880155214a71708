"""The shape of a robot in time, and the forces of the fluid on it: what films, pictures and other programs show.

Lab: x and y as seen from above, z up from the axis of the robot, which stays in the plane z = 0. Body: origin J
(the disc's centre), e_x to the left, e_y up, e_z forward along the axis. Tails are arrays (tail, node, 3), node 0
at the clamp. Units: l, μ0 l⁴/EI, EI/l².
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from common.arrays import Floats, Integers
from common.errors import InputError
from sim.linear.spectral import differentiation, interpolation
from sim.mechanics import planar
from sim.mechanics.balance import motor_gain, tail_spin
from sim.model.body import Body
from sim.model.robot import Robot
from sim.model.schedule import Schedule
from sim.motion.replay import stretches, track_of
from sim.motion.run import SteppedRobot
from sim.solve.assembly import bodies
from sim.solve.march import PHASE, YAW, State, X, Y
from sim.solve.rates import FIRST_PHASE
from sim.solve.refinement import PHASES_FOR_SLOPES, REASONS, SOLVED, orbit_on_mesh, refined_orbit
from sim.solve.residual import fluid_forces

if TYPE_CHECKING:
    import pandas as pd

_JUST_AFTER = 1e-3  # of a time step: when forces are taken after a jump of the motor's speed


class Shapes(NamedTuple):
    """A robot with N tails of n edges at F times, in the lab."""

    times: Floats  # (F,)
    heads: Floats  # (F, 3): x, y and heading of the head's centre
    angles: Floats  # (F, 2): of head and disc about the axis, from e_x towards e_y; both 0 at rest
    nodes: Floats  # (F, N, n + 1, 3)
    forces: Floats  # (F, N, n + 1, 3), of the fluid on the nodes
    on_head: Floats  # (F, 4): F_x, F_z, M_y, M_z of the fluid on head and disc, in the body frame about J
    directions: Integers  # (F,), of the motor
    track: Floats  # (K, 3): time, x and y of the head's centre at every step


def steady_states(robot: Robot, phases: Floats) -> tuple[Body, list[State]]:
    """Return the states of a steadily swimming robot at disc phases (F,), with the motor at +1.

    Raises:
        InputError: the robot has no steady motion in which its tails move alike.
    """
    groups = robot.groups()
    body = bodies(groups)[0]
    orbit = refined_orbit(body, groups.N, PHASES_FOR_SLOPES)
    if orbit.status != SOLVED:
        raise InputError(f"{robot.name} has no shape to draw: {REASONS[orbit.status]}")
    return body, [state_from_orbit(body, orbit.x[2], orbit.u[2], phase) for phase in phases.tolist()]


def steady_shapes(robot: Robot, frames: int = 96) -> Shapes:
    """Return the shapes in a turn of the disc of a steadily swimming robot, at `frames` + 1 equal phases.

    Raises:
        InputError: the robot has no steady motion in which its tails move alike.
    """
    from scipy.integrate import cumulative_simpson  # slow to import

    def integral(rates: Floats) -> Floats:
        return np.asarray(cumulative_simpson(rates, x=phases, axis=0, initial=0.0))

    phases = np.linspace(0, 2 * np.pi, frames + 1)
    body, states = steady_states(robot, phases)
    u = np.array([state.u for state in states])
    spins = (body.omega + motor_gain(body) * u[:, 3])[:, None]
    times, yaw, angle = integral(np.column_stack([np.ones(len(u)), u[:, 2:]]) / spins).T
    forward_left = np.column_stack([u[:, 1], u[:, 0] + u[:, 2] * body.head_length / 2])
    places = integral(planar.turn(forward_left, yaw) / spins)
    heads, angles = np.column_stack([places, yaw]), np.column_stack([angle, phases])
    shown = [_in_lab(body, state, state, head) for state, head in zip(states, heads, strict=True)]
    track = np.column_stack([times, places])
    return _stacked(times, heads, angles, shown, np.ones(len(u), int), track)


def scheduled_shapes(
    schedule: Schedule, times: Floats, *, progress: Callable[[int], object] | None = None
) -> Shapes:
    """Simulate a schedule and return the shapes at times that increase, (F,).

    At the time of a flip, the forces are those just after it.

    Args:
        schedule: any robot.
        times: from 0 to the end of the schedule.
        progress: called after each dwell with 1.

    Raises:
        InputError: the schedule cannot be simulated.
    """
    return shapes_and_track(schedule, times, progress=progress)[0]


def shapes_and_track(
    schedule: Schedule, times: Floats, *, progress: Callable[[int], object] | None = None
) -> tuple[Shapes, pd.DataFrame]:
    """Simulate a schedule; return what `scheduled_shapes` and `sim.motion.replay.replay` do."""
    start, head_angle, phase, now = np.array(schedule.start), 0.0, 0.0, 0.0
    heads, angles, shown, directions, simulated = [], [], [], [], []
    for stretch in stretches(schedule, stops=times, progress=progress):
        simulated.append(stretch)
        run, pose = stretch.run, stretch.run.state.pose
        if len(stretch.times):
            head_angle += (pose[PHASE] - phase - run.body.omega * (stretch.times[-1] - now)) / motor_gain(run.body)
            phase, now = pose[PHASE], stretch.times[-1]
        if stretch.stops:
            heads.append(planar.compose(start, pose[[X, Y, YAW]]))
            angles.append((head_angle, phase))
            shown.append(_in_lab(run.body, run.state, _moving(run) if run.jumped else run.state, heads[-1]))
            directions.append(stretch.direction)
    places = np.concatenate([np.zeros((1, 2)), *(stretch.poses[:, [X, Y]] for stretch in simulated)])
    path = np.column_stack(
        [np.append(0.0, np.concatenate([s.times for s in simulated])), planar.turn(places, start[2]) + start[:2]]
    )
    shapes = _stacked(times, np.array(heads), np.array(angles), shown, np.array(directions), path)
    return shapes, track_of(schedule, simulated)


def _moving(run: SteppedRobot) -> State:
    """Return the state just after a jump of the motor's speed, when its velocities are known."""
    later = run.copy()
    later.steps(2, _JUST_AFTER * run.time_step)
    return later.state


def _in_lab(body: Body, state: State, moving: State, head: Floats) -> tuple[Floats, Floats, Floats]:
    """Place the nodes and the forces on them in the lab, (N, n + 1, 3) each; the wrench on the head stays.

    Args:
        moving: the same state, with the velocities that the forces depend on.
    """
    phase = float(moving.pose[PHASE])
    forces, on_head = fluid_forces(body, moving.x, moving.x_dot, moving.u, phase)
    nodes = nodes_in_body(body, state) - [0.0, 0.0, body.head_length / 2]
    placed = _along_lab(nodes, head[2]) + np.append(head[:2], 0.0)
    return placed, _along_lab(_along_body(forces, phase), head[2]), on_head


def _stacked(
    times: Floats,
    heads: Floats,
    angles: Floats,
    shown: Sequence[tuple[Floats, Floats, Floats]],
    directions: Integers,
    track: Floats,
) -> Shapes:
    nodes, forces, on_head = (np.array(parts) for parts in zip(*shown, strict=True))
    return Shapes(times, heads, angles, nodes, forces, on_head, directions, track)


def nodes_in_body(body: Body, state: State) -> Floats:
    """Return the nodes of each tail in the body frame, (N, n + 1, 3), clamp to tip."""
    root = np.zeros((1, *state.x.shape[1:]))
    root[:, :, 0] = body.offset
    return _along_body(np.concatenate([root, state.x]), float(state.pose[PHASE]))


def _along_body(vectors: Floats, phase: float) -> Floats:
    """Turn vectors (K, N, 3), each in the frame of its tail, to the body frame, (N, K, 3)."""
    x, y, z = vectors.transpose(2, 1, 0)
    turn = phase + 2 * np.pi * np.arange(len(x))[:, None] / len(x)
    cos, sin = np.cos(turn), np.sin(turn)
    return np.stack([cos * x - sin * y, sin * x + cos * y, z], -1)


def _along_lab(vectors: Floats, heading: float) -> Floats:
    """Turn vectors (..., 3) from the body frame to that of the lab."""
    return np.concatenate([planar.turn(vectors[..., [2, 0]], heading), vectors[..., [1]]], -1)


def at_phases(periodic: Floats, at: Floats) -> Floats:
    """Interpolate a function on the orbit's phases, (K, M, c), at disc phases `at` (F,), (F, K, c)."""
    return np.einsum("fm,kmc->fkc", interpolation(periodic.shape[1], at - FIRST_PHASE), periodic)


def state_from_orbit(body: Body, x: Floats, u: Floats, phase: float) -> State:
    """Return the state of all tails at a disc phase, from an orbit x (n, M, 3), u (P, 4).

    In an orbit, tail j at disc phase φ has the shape of tail 0 at φ + 2πj/N (`sim.solve.orbit`).
    """
    tails = x.shape[1] // u.shape[0]
    each = phase + 2 * np.pi * np.arange(tails) / tails
    slope = np.einsum("ml,klc->kmc", differentiation(x.shape[1]), x)
    velocity = at_phases(np.tile(u, (tails, 1))[None], np.array([phase]))[0, 0]
    pose = np.zeros(6)
    pose[PHASE] = phase
    shape, rate = (np.ascontiguousarray(at_phases(a, each).transpose(1, 0, 2)) for a in (x, slope))
    return State(shape, rate * tail_spin(body, velocity), pose, velocity)


def state_on_orbit(body: Body, tails: int, edges: int, phase: float) -> State | None:
    """Return the state of a steadily swimming robot at a disc phase; None where there is no orbit."""
    solved, x, u = orbit_on_mesh(body, tails, edges)
    return state_from_orbit(body, x, u, phase) if solved else None
