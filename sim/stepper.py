"""Implicit time steps of many robots at once in the disc frame, with tensors on any device.

The reference for `sim.march`, which takes the same steps of one robot in compiled loops.

Every stage solves the balance r(x, ẋ, u, φ) = 0, T = 0 (`sim.balance`) with

    x = x* + τ ẋ,   φ = φ* + τ (ω + ω_h),   τ = γ dt,

by Newton's method; one or two corrections are usual, since the predictor is good: in the disc frame the
shape hardly moves. A segment of constant motor direction starts with one step of SDIRK2 (γ = 1 − 1/√2:
one-step, L-stable) and goes on with BDF2 (γ = 2/3); both are of second order and stiffly stable, which
stretching needs. A flip of the motor starts a new segment: the shape is continuous, velocities are not.

The pose is part of the same step (same formula, same order):

    ψ' = ω_yr,   X' = v_z cos ψ − h_x sin ψ,   Y' = v_z sin ψ + h_x cos ψ,   h_x = v_x + ω_yr L/2,

the track of the head's centre in the plane seen from above: X along the starting heading, Y to its left,
ψ counter-clockwise. ∫h_x dt and ∫v_z dt (body frame) are kept as well, for means.

A lane whose Newton iteration fails is marked and frozen; it never disturbs its neighbours.
Units: length l, time μ0 l⁴/EI. Source: Alexander (1977) for SDIRK2; Hairer and Wanner, *Solving ODEs II*,
V.1 for BDF2.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import torch
from torch import Tensor

from sim.balance import Swimmer, newton_correction
from sim.coefficients import BEYOND
from sim.errors import InputError
from sim.march import PHASE, YAW

_GAMMA = 1 - 1 / math.sqrt(2)
# On the last correction. Newton converges quadratically: corrections of 1e-4 were seen to leave about 1e-7 l.
TOLERANCE = 2e-4
_MOST_CORRECTIONS = 15


@dataclass(frozen=True)
class State:
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


def at_rest(swimmer: Swimmer, phase: float = 0.0) -> State:
    """Straight tails parallel to the axis, at time 0, heading along X.

    Raises:
        InputError: the robots have something of what `sim.coefficients` calls BEYOND, which is not balanced here.
    """
    if bool(swimmer.beyond.any()):
        present = [name for name, sizes in zip(BEYOND, swimmer.beyond, strict=True) if bool(sizes.any())]
        raise InputError(f"tensor steps leave out {', '.join(present)}; sim.run has them")
    x = swimmer.straight()
    pose = x.new_zeros(6, swimmer.robots)
    pose[PHASE] = phase
    return State(
        time=x.new_zeros(swimmer.robots),
        x=x,
        pose=pose,
        u=x.new_zeros(4, swimmer.robots),
        x_dot=torch.zeros_like(x),
        failed=torch.zeros(swimmer.robots, dtype=torch.bool, device=x.device),
    )


def step(swimmer: Swimmer, state: State, omega: Tensor, dt: Tensor, *, tolerance: float = TOLERANCE) -> State:
    """Advance every robot by its own dt at constant motor speed ω; omega and dt are (B,)."""
    if state.x_before is None or state.pose_before is None or state.u_before is None:
        return _first_step(swimmer, state, omega, dt, tolerance)
    x_star = (4 * state.x - state.x_before) / 3
    pose_star = (4 * state.pose - state.pose_before) / 3
    guess = 2 * state.x - state.x_before
    x, x_dot, pose, u, failed = _stage(
        swimmer, x_star, pose_star, dt * (2 / 3), omega, guess, 2 * state.u - state.u_before, tolerance
    )
    return _accept(state, dt, x, x_dot, pose, u, failed)


def _first_step(swimmer: Swimmer, state: State, omega: Tensor, dt: Tensor, tolerance: float) -> State:
    tau = _GAMMA * dt
    _, x_dot1, pose1, u1, failed1 = _stage(
        swimmer, state.x, state.pose, tau, omega, state.x + tau * state.x_dot, state.u, tolerance
    )
    weight = (1 - _GAMMA) * dt
    pose_dot1 = (pose1 - state.pose) / tau
    x, x_dot, pose, u, failed = _stage(
        swimmer,
        state.x + weight * x_dot1,
        state.pose + weight * pose_dot1,
        tau,
        omega,
        state.x + dt * x_dot1,
        u1,
        tolerance,
    )
    return _accept(state, dt, x, x_dot, pose, u, failed | failed1)


def _accept(state: State, dt: Tensor, x: Tensor, x_dot: Tensor, pose: Tensor, u: Tensor, failed: Tensor) -> State:
    failed = failed | state.failed
    if bool(failed.any()):
        x = torch.where(failed, state.x, x)
        x_dot = torch.where(failed, torch.zeros_like(x_dot), x_dot)
        pose = torch.where(failed, state.pose, pose)
        u = torch.where(failed, torch.zeros_like(u), u)
    return State(state.time + dt, x, pose, u, x_dot, failed, state.x, state.pose, state.u)


def _stage(
    swimmer: Swimmer,
    x_star: Tensor,
    pose_star: Tensor,
    tau: Tensor,
    omega: Tensor,
    x: Tensor,
    u: Tensor,
    tolerance: float,
) -> tuple[Tensor, Tensor, Tensor, Tensor, Tensor]:
    """Solve one stage; returns x, ẋ, pose, u and which lanes failed."""
    rate = 1 / tau
    scale = 1 + omega.abs()
    settled = torch.zeros_like(omega, dtype=torch.bool)
    for _ in range(_MOST_CORRECTIONS):
        x_dot = (x - x_star) * rate
        phase = pose_star[PHASE] + tau * swimmer.omega_t(u, omega)
        dx, du = newton_correction(swimmer, x, x_dot, phase, u, omega, rate)
        size = torch.maximum(dx.abs().amax((0, 1, 2)), du.abs().amax(0) / scale)
        # Damp what would bend a tail out of its neighbourhood in one go; keep settled lanes still.
        factor = torch.where(size.isfinite() & ~settled, (0.3 / size).clamp(max=1.0), 0.0)
        x = x + factor * dx.nan_to_num()
        u = u + factor * du.nan_to_num()
        settled = settled | (size < tolerance)
        if bool(settled.all()):
            break
    x_dot = (x - x_star) * rate
    pose = _pose(swimmer, pose_star, tau, u, omega)
    return x, x_dot, pose, u, ~settled


def _pose(swimmer: Swimmer, star: Tensor, tau: Tensor, u: Tensor, omega: Tensor) -> Tensor:
    sway = u[0] + u[2] * swimmer.head_length / 2
    surge = u[1]
    yaw = star[YAW] + tau * u[2]
    c, s = torch.cos(yaw), torch.sin(yaw)
    rates = torch.stack([swimmer.omega_t(u, omega), u[2], surge * c - sway * s, surge * s + sway * c, sway, surge])
    return star + tau * rates
