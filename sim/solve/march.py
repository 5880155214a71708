"""Implicit time steps at constant motor speed, in the disc frame, for a robot in each lane (`sim.lanes`)
or for one alone.

Positions are in the disc frame, in which the shape is almost steady at constant motor speed. Every stage solves
the balance with x = x* + τ ẋ, φ = φ* + τ ω_t by Newton's method (`sim.solve.newton`). One or two corrections are
enough in most steps, because the prediction is good. After a flip of the motor the first step is SDIRK2 (γ = 1 −
1/√2, one-step, L-stable). All later steps are BDF2 (γ = 2/3). Both are of second order and stiffly stable, which
is necessary because stretching is stiff. The pose is part of the same step:

    ψ' = ω_yr,   X' = v_z cos ψ − h_x sin ψ,   Y' = v_z sin ψ + h_x cos ψ,   h_x = v_x + ω_yr L/2,

the track of the head's centre seen from above: X along the first heading, Y to its left, ψ counter-clockwise. The
integrals of h_x and v_z (body frame) are stored as well, for means.

Units: l, μ0 l⁴/EI, EI/l².
Source: Alexander (1977) for SDIRK2; Hairer and Wanner, *Solving ODEs II*, V.1 for BDF2.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from common.arrays import Floats
from sim.jit import compiled
from sim.lanes import lanes, less, somewhere, zeros
from sim.linear.lane_arrays import combine, copy
from sim.mechanics.balance import tail_spin
from sim.mechanics.geometry import straight
from sim.model.body import Body
from sim.solve.assembly import row
from sim.solve.grouping import InLanes, group_of, in_groups, robots_in_lanes
from sim.solve.newton import new_workspace, newton
from sim.solve.rates import in_stage

PHASE, YAW, X, Y, SWAY, SURGE = range(6)  # entries of a pose
GAMMA = 1 - 1 / np.sqrt(2)
TOLERANCE = 2e-4  # on the last correction; Newton converges quadratically


class State(NamedTuple):
    """Shape, pose and velocities of a robot, changed in place by `advance`; tails are in their own frames."""

    x: Floats
    x_dot: Floats
    pose: Floats  # (6,): φ, ψ, X, Y, ∫h_x, ∫v_z
    u: Floats  # (4,): v_x, v_z (of J), ω_yr, ω_h


@compiled
def _march(
    robots: InLanes, given: State, dt: float, count: int, tolerance: float, poses: Floats, shapes: Floats
) -> bool:
    """Step the robots of one group until one of those that are wanted fails; arrays end with (W,)."""
    body, going = group_of(robots, 0)
    w = robots.width
    state = State(lanes(given.x, w), lanes(given.x_dot, w), lanes(given.pose, w), lanes(given.u, w))
    all_poses, all_shapes = lanes(poses, w), lanes(shapes, w)
    star, now, before = _new_like(state), _new_like(state), _new_like(state)
    u = state.u.reshape((1, 4))
    work = new_workspace(in_stage(1.0, 0.0, star.x), state.x, u)
    for i in range(count):
        now, before = before, now
        copy(now.x, state.x)
        copy(now.x_dot, state.x_dot)
        copy(now.pose, state.pose)
        copy(now.u, state.u)
        for stage in range(2 if i == 0 else 1):
            tau = _begin_stage(state, star, now, before, dt, i, stage)
            rates = in_stage(1 / tau, star.pose[PHASE], star.x)
            _, size = newton(body, rates, state.x, u, work, tolerance, going)
            if somewhere(going * (1 - less(size, tolerance))):
                return False
            combine(state.x_dot, 1 / tau, state.x, -1 / tau, star.x)
            _advance_pose(body, state.u, tau, star.pose, state.pose)
        copy(all_poses[i], state.pose)
        late = i - (count - len(all_shapes))
        if late >= 0:
            copy(all_shapes[late], state.x)
    return True


@compiled
def _new_like(state: State) -> State:
    """Allocate arrays for a state."""
    x, pose, u = state.x, state.pose, state.u
    return State(zeros(x, x.shape), zeros(x, x.shape), zeros(x, pose.shape), zeros(x, u.shape))


@compiled
def _begin_stage(state: State, star: State, now: State, before: State, dt: float, step: int, stage: int) -> float:
    """Fill x* and the pose's part of `star`, predict x and u in `state`; returns τ.

    Args:
        now, before: states at the start of this step and of the one before.
        step, stage: step 0 has two stages of SDIRK2; all others are BDF2.
    """
    if step > 0:
        combine(star.x, 4 / 3, now.x, -1 / 3, before.x)
        combine(star.pose, 4 / 3, now.pose, -1 / 3, before.pose)
        combine(state.x, 2.0, now.x, -1.0, before.x)
        combine(state.u, 2.0, now.u, -1.0, before.u)
        return dt * 2 / 3
    tau = GAMMA * dt
    if stage == 0:
        copy(star.x, now.x)
        copy(star.pose, now.pose)
        combine(state.x, 1.0, now.x, tau, now.x_dot)
    else:  # state.x_dot and state.pose are those of the first stage
        share = (1 - GAMMA) * dt / tau
        combine(star.x, 1.0, now.x, (1 - GAMMA) * dt, state.x_dot)
        combine(star.pose, 1 - share, now.pose, share, state.pose)
        combine(state.x, 1.0, now.x, dt, state.x_dot)
    return tau


@compiled
def _advance_pose(body: Body, u: Floats, tau: float, star: Floats, pose: Floats) -> None:
    """Set the pose at the end of a stage that begins at `star`: pose = star + τ d(pose)/dt."""
    sway, surge = u[0] + u[2] * body.head_length / 2, u[1]
    yaw = star[YAW] + tau * u[2]
    cos, sin = np.cos(yaw), np.sin(yaw)
    pose[PHASE] = star[PHASE] + tau * tail_spin(body, u)
    pose[YAW] = yaw
    pose[X] = star[X] + tau * (surge * cos - sway * sin)
    pose[Y] = star[Y] + tau * (surge * sin + sway * cos)
    pose[SWAY], pose[SURGE] = star[SWAY] + tau * sway, star[SURGE] + tau * surge


def new_state(tails: int, edges: int, offset: float) -> State:
    """Start from straight tails at rest."""
    x = straight(edges, tails, offset)
    return State(x, np.zeros_like(x), np.zeros(6), np.zeros(4))


class Steps(NamedTuple):
    """What `advance` has done."""

    solved: bool  # every step converged; if not, the state is that of the step that failed
    poses: Floats  # after every step, (count, 6); NaN from the step that failed on
    shapes: Floats  # after each of the last K steps, (K, n, N, 3)


def advance(body: Body, state: State, dt: float, count: int, tolerance: float, *, shapes: int = 0) -> Steps:
    """Make `count` steps of dt at constant motor speed from a state (changed); the first is a one-step method.

    Args:
        shapes: K, how many of the last shapes are kept.
    """
    steps = Steps(False, np.full((count, 6), np.nan), np.empty((shapes, *state.x.shape)))
    if not 0 < dt < np.inf:
        return steps
    kept = (*state, *steps[1:])
    in_lanes = [in_groups(part[None])[0] for part in kept]
    solved = _march(robots_in_lanes(row(body)), State(*in_lanes[:4]), dt, count, tolerance, *in_lanes[4:])
    for part, found in zip(kept, in_lanes, strict=True):
        part[:] = found[..., 0]
    return steps._replace(solved=bool(solved))
