"""How far a robot lags its steady circle: one stage of a time step, for one robot or for a group of robots.

With the pose g after a jump of the motor's speed and the steady circle c, the lag λ = (Δz, Δx, Δψ) is defined by
g = λ ∘ c. It stops changing where the motion is steady:

    λ_ψ' = ω_yr − ω*_yr,   (λ_z, λ_x)' = Rot(ψ)(v − v*) + λ_ψ' J Rot(λ_ψ) c

Where a turn has an odd number of instants, λ is a function of the disc's phase φ, too: its mean over φ is that of
robots whose phase at the jump is unknown. What the phase adds is damped by long time steps, see `sim.solve.phase`.
Where the number is even, only the mean over a turn is followed. Units: l, μ0 l⁴/EI.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from common.arrays import Floats
from sim.jit import compiled, formula
from sim.lanes import choose, less, zeros
from sim.linear.dense import factor_dense, solve_factored
from sim.linear.spectral import differentiation
from sim.mechanics.balance import tail_spin
from sim.model.body import Body


@compiled
def turning(columns: int, instants: int) -> Floats:
    """Differentiate λ in φ: the matrix (Q, Q) for Q phases of λ."""
    if instants % 2 == 0 or instants == 1:
        return np.zeros((1, 1))
    return columns // instants * differentiation(instants)


@compiled
def advance_lag(
    body: Body, u: Floats, twist: Floats, time: Any, rate: Any, start: Floats, by_phase: Floats, lag: Floats
) -> None:
    """Solve rate (λ − start) + ω_t ∂λ/∂φ = λ' for the lag at the end of a stage.

    Args:
        u: velocities at the end of the stage, (P, 4).
        twist: steady (v_z, h_x, ω_yr).
        time: since the jump, at the end of the stage.
        rate: one over the length of the stage.
        start: (Q, 3).
        by_phase: as `turning` returns it.
        lag: (Q, 3), filled.
    """
    fields = start.shape[0]
    matrix, right = zeros(start, (fields, fields)), zeros(start, (fields, 1))
    exchanged = zeros(start, (fields, fields))
    motion = _instants(body, u, fields)
    for p in range(fields):
        for q in range(fields):
            matrix[p, q] = motion[p, 3] * by_phase[p, q]
        matrix[p, p] += rate
        right[p, 0] = motion[p, 2] - twist[2] + rate * start[p, 2]
    factor_dense(matrix, exchanged)
    solve_factored(matrix, exchanged, right)
    forward, leftward = _on_circle(twist, time)
    plane = zeros(start, (fields, 2))
    for p in range(fields):
        lag[p, 2] = right[p, 0]
        angle, heading = lag[p, 2], lag[p, 2] + twist[2] * time
        surge, sway, yaw = motion[p, 0] - twist[0], motion[p, 1] - twist[1], motion[p, 2] - twist[2]
        z = np.cos(angle) * forward - np.sin(angle) * leftward
        x = np.sin(angle) * forward + np.cos(angle) * leftward
        plane[p, 0] = np.cos(heading) * surge - np.sin(heading) * sway + yaw * x + rate * start[p, 0]
        plane[p, 1] = np.sin(heading) * surge + np.cos(heading) * sway - yaw * z + rate * start[p, 1]
    solve_factored(matrix, exchanged, plane)
    for p in range(fields):
        lag[p, 0], lag[p, 1] = plane[p, 0], plane[p, 1]


@compiled
def _instants(body: Body, u: Floats, fields: int) -> Floats:
    """Compute (v_z, h_x, ω_yr, ω_t) at every instant of a turn, or their mean over time."""
    motion = zeros(u, (u.shape[0], 4))
    for p in range(u.shape[0]):
        motion[p, 0], motion[p, 1] = u[p, 1], u[p, 0] + u[p, 2] * body.head_length / 2
        motion[p, 2], motion[p, 3] = u[p, 2], tail_spin(body, u[p])
    if fields == u.shape[0]:
        return motion
    mean, time = zeros(u, (1, 4)), 0.0 * u[0, 0]
    for p in range(u.shape[0]):
        time += 1 / motion[p, 3]
        for i in range(4):
            mean[0, i] += motion[p, i] / motion[p, 3]
    for i in range(4):
        mean[0, i] = mean[0, i] / time
    return mean


@formula
def _on_circle(twist: Any, time: Any) -> tuple[Any, Any]:
    """Return where the steady circle is after a time: forward and to the left."""
    angle = twist[2] * time
    half = angle / 2
    along = time * _sine_over(angle)
    across = time * _sine_over(half) * np.sin(half)
    return along * twist[0] - across * twist[1], across * twist[0] + along * twist[1]


@formula
def _sine_over(angle: Any) -> Any:
    """Compute sin(angle)/angle, also for small angles."""
    return choose(less(1e-6, abs(angle)), np.sin(angle) / angle, 1.0)


@formula
def between(share: Any, span: Any, first: Any, last: Any, first_rate: Any, last_rate: Any) -> Any:
    """Interpolate in a step of length `span`, at a `share` of it: cubic Hermite."""
    s = share
    change = s * s * (3 - 2 * s) * (last - first)
    return first + change + span * s * (1 - s) * ((1 - s) * first_rate - s * last_rate)
