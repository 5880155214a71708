"""Implicit time steps of many robots at once in the disc frame, with tensors.

The reference for `sim.solve.march`, which takes the same steps of one robot in compiled loops.

Every stage solves the balance r(x, ẋ, u, φ) = 0, T = 0 (`sim.reference.balance`) with

    x = x* + τ ẋ,   φ = φ* + τ (ω + ω_h),   τ = γ dt,

by Newton's method. One or two corrections are enough in most steps, because in the disc frame the shape hardly
changes and the prediction is good. After a flip of the motor the first step is SDIRK2 (γ = 1 − 1/√2, one-step,
L-stable). All later steps are BDF2 (γ = 2/3). Both are of second order and stiffly stable, which is necessary
because stretching is stiff. At a flip the shape is continuous, velocities are not.

The pose is part of the same step (same formula, same order):

    ψ' = ω_yr,   X' = v_z cos ψ − h_x sin ψ,   Y' = v_z sin ψ + h_x cos ψ,   h_x = v_x + ω_yr L/2,

the track of the head's centre in the plane seen from above: X along the first heading, Y to its left, ψ
counter-clockwise. The integrals of h_x and v_z (body frame) are stored as well, for means.

If Newton's method fails for a robot, this robot is marked and stays as it is. The others go on.
Units: length l, time μ0 l⁴/EI. Source: Alexander (1977) for SDIRK2; Hairer and Wanner, *Solving ODEs II*,
V.1 for BDF2.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

from sim.io.errors import InputError
from sim.reference.balance import TensorRobots, newton_correction
from sim.solve.march import GAMMA, PHASE, TOLERANCE, YAW

_MOST_CORRECTIONS = 15


@dataclass(frozen=True)
class TensorState:
    """Shapes and poses of B robots at their own times."""

    time: Tensor  # (B,)
    x: Tensor  # (n, 3, N, B) free nodes in the disc frame
    pose: Tensor  # (6, B): φ, ψ, X, Y, ∫h_x, ∫v_z
    u: Tensor  # (4, B): v_x, v_z (of J), ω_yr, ω_h
    x_dot: Tensor  # (n, 3, N, B)
    failed: Tensor  # (B,) bool
    x_before: Tensor | None = None  # previous step of this segment, if any
    pose_before: Tensor | None = None
    u_before: Tensor | None = None


def at_rest(robots: TensorRobots, phase: float = 0.0) -> TensorState:
    """Return straight tails parallel to the axis, at time 0, heading along X.

    Raises:
        InputError: the robots have non-local effects, which these steps do not have.
    """
    present = [name for name, sizes in robots.body.nonlocal_terms._asdict().items() if bool(sizes.any())]
    if present:
        raise InputError(
            f"time steps with tensors do not have the effects {', '.join(present)}; "
            "use softflagella.steady or softflagella.replay"
        )
    x = robots.straight()
    pose = x.new_zeros(6, robots.robots)
    pose[PHASE] = phase
    return TensorState(
        time=x.new_zeros(robots.robots),
        x=x,
        pose=pose,
        u=x.new_zeros(4, robots.robots),
        x_dot=torch.zeros_like(x),
        failed=torch.zeros(robots.robots, dtype=torch.bool, device=x.device),
    )


def step(
    robots: TensorRobots, state: TensorState, omega: Tensor, dt: Tensor, *, tolerance: float = TOLERANCE
) -> TensorState:
    """Advance every robot by its own dt at constant motor speed ω; omega and dt are (B,)."""
    if state.x_before is None or state.pose_before is None or state.u_before is None:
        return _first_step(robots, state, omega, dt, tolerance)
    x_star = (4 * state.x - state.x_before) / 3
    pose_star = (4 * state.pose - state.pose_before) / 3
    guess = 2 * state.x - state.x_before
    x, x_dot, pose, u, failed = _stage(
        robots, x_star, pose_star, dt * (2 / 3), omega, guess, 2 * state.u - state.u_before, tolerance
    )
    return _accept(state, dt, x, x_dot, pose, u, failed)


def _first_step(
    robots: TensorRobots, state: TensorState, omega: Tensor, dt: Tensor, tolerance: float
) -> TensorState:
    tau = GAMMA * dt
    _, x_dot1, pose1, u1, failed1 = _stage(
        robots, state.x, state.pose, tau, omega, state.x + tau * state.x_dot, state.u, tolerance
    )
    weight = (1 - GAMMA) * dt
    pose_dot1 = (pose1 - state.pose) / tau
    x, x_dot, pose, u, failed = _stage(
        robots,
        state.x + weight * x_dot1,
        state.pose + weight * pose_dot1,
        tau,
        omega,
        state.x + dt * x_dot1,
        u1,
        tolerance,
    )
    return _accept(state, dt, x, x_dot, pose, u, failed | failed1)


def _accept(
    state: TensorState, dt: Tensor, x: Tensor, x_dot: Tensor, pose: Tensor, u: Tensor, failed: Tensor
) -> TensorState:
    failed = failed | state.failed
    if bool(failed.any()):
        x = torch.where(failed, state.x, x)
        x_dot = torch.where(failed, torch.zeros_like(x_dot), x_dot)
        pose = torch.where(failed, state.pose, pose)
        u = torch.where(failed, torch.zeros_like(u), u)
    return TensorState(state.time + dt, x, pose, u, x_dot, failed, state.x, state.pose, state.u)


def _stage(
    robots: TensorRobots,
    x_star: Tensor,
    pose_star: Tensor,
    tau: Tensor,
    omega: Tensor,
    x: Tensor,
    u: Tensor,
    tolerance: float,
) -> tuple[Tensor, Tensor, Tensor, Tensor, Tensor]:
    """Solve one stage; returns x, ẋ, pose, u and which robots failed."""
    rate = 1 / tau
    scale = 1 + omega.abs()
    settled = torch.zeros_like(omega, dtype=torch.bool)
    for _ in range(_MOST_CORRECTIONS):
        x_dot = (x - x_star) * rate
        phase = pose_star[PHASE] + tau * robots.omega_t(u, omega)
        dx, du = newton_correction(robots, x, x_dot, phase, u, omega, rate)
        size = torch.maximum(dx.abs().amax((0, 1, 2)), du.abs().amax(0) / scale)
        # Damp corrections that bend a tail too far at once; do not move robots that have converged.
        factor = torch.where(size.isfinite() & ~settled, (0.3 / size).clamp(max=1.0), 0.0)
        x = x + factor * dx.nan_to_num()
        u = u + factor * du.nan_to_num()
        settled = settled | (size < tolerance)
        if bool(settled.all()):
            break
    x_dot = (x - x_star) * rate
    pose = _pose(robots, pose_star, tau, u, omega)
    return x, x_dot, pose, u, ~settled


def _pose(robots: TensorRobots, star: Tensor, tau: Tensor, u: Tensor, omega: Tensor) -> Tensor:
    sway = u[0] + u[2] * robots.body.head_length / 2
    surge = u[1]
    yaw = star[YAW] + tau * u[2]
    c, s = torch.cos(yaw), torch.sin(yaw)
    rates = torch.stack([robots.omega_t(u, omega), u[2], surge * c - sway * s, surge * s + sway * c, sway, surge])
    return star + tau * rates
