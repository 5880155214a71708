"""Implicit time steps of one robot at constant motor speed, in the disc frame.

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

from sim.arrays import Floats
from sim.compiling import compiled
from sim.mechanics.balance import tail_spin
from sim.mechanics.geometry import straight
from sim.model.body import Body
from sim.solve.newton import new_workspace, newton
from sim.solve.rates import in_stage

PHASE, YAW, X, Y, SWAY, SURGE = range(6)  # entries of a pose
TOLERANCE = 2e-4  # on the last correction; Newton converges quadratically
GAMMA = 1 - 1 / np.sqrt(2)


class State(NamedTuple):
    """Shape, pose and velocities of a robot, changed in place by `advance`; tails are in their own frames."""

    x: Floats
    x_dot: Floats
    pose: Floats  # (6,): φ, ψ, X, Y, ∫h_x, ∫v_z
    u: Floats  # (4,): v_x, v_z (of J), ω_yr, ω_h


@compiled
def new_state(tails: int, edges: int, offset: float) -> State:
    """Start from straight tails at rest."""
    x = straight(edges, tails, offset)
    return State(x, np.zeros_like(x), np.zeros(6), np.zeros(4))


@compiled
def advance(
    body: Body, state: State, dt: float, count: int, tolerance: float, poses: Floats, shapes: Floats
) -> bool:
    """Make `count` steps of dt at constant motor speed; the first is a one-step method.

    Args:
        poses: (count, 6), filled with the pose after every step.
        shapes: (K, n, N, 3), filled with the shape after each of the last K steps.

    Returns:
        Whether every step converged. If not, the state is that of the step that failed.
    """
    x, x_dot, pose, u = state
    if not 0 < dt < np.inf:
        return False
    star, now, before = _copy(state), _copy(state), _copy(state)
    work = new_workspace(in_stage(1.0, 0.0, star.x), x, u.reshape(1, 4))
    for i in range(count):
        now, before = before, now
        _store(state, now)
        for stage in range(2 if i == 0 else 1):
            tau = _begin_stage(state, star, now, before, dt, i, stage)
            rates = in_stage(1 / tau, star.pose[PHASE], star.x)
            _, size = newton(body, rates, x, u.reshape(1, 4), work, tolerance)
            if not size < tolerance:
                return False
            _combine(x_dot, 1 / tau, x, -1 / tau, star.x)
            pose[:] = star.pose + tau * _pose_rates(body, star.pose[YAW] + tau * u[2], u)
        poses[i] = pose
        late = i - (count - shapes.shape[0])
        if late >= 0:
            shapes[late] = x
    return True


@compiled
def _copy(state: State) -> State:
    return State(state.x.copy(), state.x_dot.copy(), state.pose.copy(), state.u.copy())


@compiled
def _store(state: State, into: State) -> None:
    into.x[:], into.x_dot[:] = state.x, state.x_dot
    into.pose[:], into.u[:] = state.pose, state.u


@compiled
def _combine(out: Floats, a: float, x: Floats, b: float, y: Floats) -> None:
    """Set out = a x + b y, (n, N, 3)."""
    for k in range(x.shape[0]):
        for m in range(x.shape[1]):
            for c in range(3):
                out[k, m, c] = a * x[k, m, c] + b * y[k, m, c]


@compiled
def _begin_stage(state: State, star: State, now: State, before: State, dt: float, step: int, stage: int) -> float:
    """Fill x* and the pose's part of `star`, predict x and u in `state`; returns τ.

    Args:
        now, before: states at the start of this step and of the one before.
        step, stage: step 0 has two stages of SDIRK2; all others are BDF2.
    """
    if step > 0:
        _combine(star.x, 4 / 3, now.x, -1 / 3, before.x)
        star.pose[:] = (4 * now.pose - before.pose) / 3
        _combine(state.x, 2.0, now.x, -1.0, before.x)
        state.u[:] = 2 * now.u - before.u
        return dt * 2 / 3
    tau = GAMMA * dt
    if stage == 0:
        star.x[:], star.pose[:] = now.x, now.pose
        _combine(state.x, 1.0, now.x, tau, now.x_dot)
    else:  # state.x_dot and state.pose are those of the first stage
        _combine(star.x, 1.0, now.x, (1 - GAMMA) * dt, state.x_dot)
        star.pose[:] = now.pose + (1 - GAMMA) * dt * (state.pose - now.pose) / tau
        _combine(state.x, 1.0, now.x, dt, state.x_dot)
    return tau


@compiled
def _pose_rates(body: Body, yaw: float, u: Floats) -> Floats:
    """Compute d(pose)/dt."""
    sway, surge = u[0] + u[2] * body.head_length / 2, u[1]
    cos, sin = np.cos(yaw), np.sin(yaw)
    return np.array([tail_spin(body, u), u[2], surge * cos - sway * sin, surge * sin + sway * cos, sway, surge])
