"""How fast the tails change shape: the one place where an orbit, a time step and a transient differ.

    orbit       ẋ = ω_t D x                          x at M phases; D: derivative of the interpolant
    time step   ẋ = (x − x*)/τ,   φ = φ* + τ ω_t     x*, φ* from earlier steps
    transient   ẋ = ω_t D x + (x − x*)/τ             x at M phases, changing from turn to turn

Columns: tail j of N at instant p of P is column m = p + j P of x (n, M, 3), M = N P, and is at phase φ + 2π m/M.
On an orbit these are all tails at P instants of an N-th of a turn, or in other words tail 0 at M phases of a whole
turn. A time step has one instant.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from common.arrays import Floats
from sim.jit import borrowing, compiled
from sim.lanes import zeros
from sim.linear.blocks import put, vector
from sim.linear.spectral import differentiation
from sim.linear.vectors import ZERO, cross, minus, plus, times
from sim.mechanics.balance import motion_at, motor_gain, tail_spin
from sim.model.body import Body

FIRST_PHASE = np.pi / 2  # of the disc, in the first column of an orbit


class Rates(NamedTuple):
    """An orbit (D alone), a stage of a time step (rate 1/τ alone) or a stage of a transient (both)."""

    rate: Any
    phase: Any  # of column 0; φ* in a stage of a time step
    differentiation: Floats  # D, (M, M); empty where columns are tails at one instant
    start: Floats  # x*, (n, M, 3); empty for an orbit


@compiled
def on_orbit(x: Floats) -> Rates:
    """Collocate x (n, M, 3) at M equal phases."""
    none = 0.0 * x[0, 0, 0]
    return Rates(none, none + FIRST_PHASE, differentiation(x.shape[1]), zeros(x, (0, 0, 0)))


@compiled
def in_stage(rate: Any, phase: Any, start: Floats) -> Rates:
    """Describe a stage with ẋ = rate (x − start) and φ = phase + ω_t/rate."""
    none = 0.0 * start[0, 0, 0]
    return Rates(none + rate, none + phase, np.zeros((0, 0)), start)


@compiled
def in_transient(rate: Any, by_phase: Floats, start: Floats) -> Rates:
    """Describe a stage with ẋ = ω_t ∂x/∂φ + rate (x − start), at M equal phases; `by_phase` is D, (M, M)."""
    none = 0.0 * start[0, 0, 0]
    return Rates(none + rate, none + FIRST_PHASE, by_phase, start)


@borrowing
def is_periodic(rates: Rates) -> bool:
    """Tell whether the columns are phases, joined to each other by ∂x/∂φ."""
    return rates.differentiation.shape[0] > 0


@borrowing
def base_phase(rates: Rates, body: Body, u: Floats) -> Any:
    """Return the phase of column 0, for velocities u (P, 4); column m is 2π m/M later."""
    return rates.phase + (0.0 if is_periodic(rates) else tail_spin(body, u[0]) / rates.rate)


@borrowing
def fill_rates(rates: Rates, body: Body, x: Floats, u: Floats, x_dot: Floats, by_spin: Floats) -> None:
    """Compute the velocities of the free nodes in the disc frame and what a faster spin changes in them.

    Args:
        x, u: free nodes (n, M, 3) and the robot's velocities (P, 4).
        x_dot: (n, M, 3), filled.
        by_spin: (n, M, 3), filled: ∂v/∂ω_t beside e_z × x. On an orbit through ẋ, in a stage through the phase.
    """
    n, columns, _ = x.shape
    base = base_phase(rates, body, u)
    for m in range(columns):
        now = u[m % u.shape[0]]
        if not is_periodic(rates):  # ∂v/∂φ = ω_yr e_x × x − v_x e_y, ∂φ/∂ω_t = 1/rate
            motion = motion_at(body, now, base + 2 * np.pi * m / columns)
            for k in range(n):
                position = vector(x, k, m)
                put(x_dot, k, m, times(rates.rate, minus(position, vector(rates.start, k, m))))
                by_phase = minus(times(now[2], cross(motion.e_x, position)), times(now[0], motion.e_y))
                put(by_spin, k, m, times(1 / rates.rate, by_phase))
        else:
            omega_t = tail_spin(body, now)
            for k in range(n):
                slope = ZERO
                for j in range(columns):
                    slope = plus(slope, times(rates.differentiation[m, j], vector(x, k, j)))
                put(by_spin, k, m, slope)
                change = times(omega_t, slope)
                if rates.start.shape[0] > 0:
                    change = plus(change, times(rates.rate, minus(vector(x, k, m), vector(rates.start, k, m))))
                put(x_dot, k, m, change)


@borrowing
def phase_gain(rates: Rates, body: Body) -> Any:
    """Compute ∂φ/∂ω_h."""
    return 0.0 if is_periodic(rates) else motor_gain(body) / rates.rate
