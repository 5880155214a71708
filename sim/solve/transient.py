"""How a robot comes to its steady motion: shapes at all phases of the disc, changing from turn to turn.

The shape of a tail depends on the time t since the motor's speed jumped and on the disc's phase φ:

    ẋ = ∂x/∂t + ω_t ∂x/∂φ

At each t, x is collocated at M phases, as on an orbit (`sim.solve.orbit`). One solution holds M/N robots, one for
each disc phase at the jump. It is smooth in t, so time steps need not resolve the turning of the disc.

Time steps are those of SDIRK2 (γ = 1 − 1/√2, L-stable, second order). Both stages use one factorisation. The
length of a step follows the difference to the embedded method of first order.

The lag behind the steady circle (`sim.solve.lag`) is integrated in the same steps. `sim.solve.transient_groups`
takes them for groups of robots.

Units: l, μ0 l⁴/EI. Source: Alexander (1977) for SDIRK2; Brachtendorf and others (1996) for a phase as second time.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from sim.arrays import Floats
from sim.compiling import compiled, compiled_exactly, formula
from sim.lanes import choose, larger, less, smaller
from sim.linear.spectral import differentiation
from sim.model.body import Body
from sim.solve.lag import advance_lag, between, turning
from sim.solve.march import GAMMA
from sim.solve.newton import Workspace, correct, largest_move, move, new_workspace
from sim.solve.orbit import FIRST_PHASE
from sim.solve.rates import Rates, in_transient

MOST_STEPS = 400
CORRECTION = 1e-3  # of a node, in l: Newton's method stops below it
MOST_CORRECTIONS = 8
_OSCILLATION = 0.1  # weight of what averages out over a turn in the error of a step
_FIRST_STEP = 5e-3  # over √ω̄
_LONGEST_STEP = 0.5
MOST_REJECTED = 60


class Transient(NamedTuple):
    """K steps after the jump; entry 0 is the jump itself."""

    times: Floats  # (K + 1,)
    lag: Floats  # (K + 1, Q, 3): (Δz, Δx, Δψ), Q phases, or one entry for the mean over a turn
    lag_rate: Floats  # (K + 1, Q, 3); not filled at the jump
    shapes: Floats  # (marks, n, M, 3) at the marks
    solved: bool


class _Step(NamedTuple):
    """One step in the making."""

    slope: Floats  # (2, n, M, 3): ∂x/∂t of the stages
    lag_slope: Floats  # (2, Q, 3)
    start: Floats  # (n, M, 3)
    lag: Floats  # (Q, 3) at the end of the stage
    by_phase: Floats  # d/dφ of x, (M, M)
    lag_by_phase: Floats  # d/dφ of the lag, (Q, Q)


@compiled
def transient(
    body: Body, x: Floats, u: Floats, twist: Floats, until: float, marks: Floats, tolerance: float
) -> Transient:
    """Follow a robot from its shape at a jump of the motor's speed.

    Args:
        body: with the motor's speed after the jump.
        x, u: shape (n, M, 3) and guessed velocities (P, 4) at the jump; changed in place.
        twist: steady (v_z, h_x, ω_yr) after the jump: mean surge, sway of the head's centre, yaw rate.
        until: time to follow.
        marks: times at which shapes are kept, increasing, at most `until`.
        tolerance: on the shape in one step, in l.
    """
    n, columns, _ = x.shape
    by_phase, lag_by_phase = differentiation(columns), turning(columns, u.shape[0])
    fields = lag_by_phase.shape[0]
    step = _Step(
        np.zeros((2, n, columns, 3)), np.zeros((2, fields, 3)), np.empty_like(x), np.zeros((fields, 3)),
        by_phase, lag_by_phase,
    )  # fmt: skip
    times, lags = np.zeros(MOST_STEPS + 1), np.zeros((MOST_STEPS + 1, fields, 3))
    rates, shapes = np.zeros_like(lags), np.zeros((len(marks), n, columns, 3))
    work = new_workspace(in_transient(1.0, FIRST_PHASE, by_phase, x), x, u)
    x_now, u_now, slope_now = x.copy(), u.copy(), np.zeros_like(x)
    now, count, mark, rejected = 0.0, 0, 0, 0
    dt = first_step(body)
    while now < until and count < MOST_STEPS and rejected < MOST_REJECTED:
        goal = marks[mark] if mark < len(marks) else until
        dt = towards(goal - now, dt)
        solved = _try_step(body, x, u, twist, x_now, slope_now, lags[count], now, dt, step, work)
        error = embedded_error(step.slope, dt) if solved else np.inf
        if not error < 2 * tolerance:
            rejected += 1
            dt = shorter_step(dt, error, 1.0 if solved else 0.0, tolerance)
            u[:] = u_now
            continue
        now = goal if now + dt > goal - 1e-12 else now + dt
        count += 1
        times[count], lags[count], rates[count] = now, step.lag, step.lag_slope[1]
        x_now[:], u_now[:], slope_now[:] = x, u, step.slope[1]
        if mark < len(marks) and now == marks[mark]:
            shapes[mark] = x
            mark += 1
        dt = next_step(dt, error, tolerance)
    solved = now >= until
    return Transient(times[: count + 1], lags[: count + 1], rates[: count + 1], shapes, solved)


@formula
def first_step(body: Body) -> Any:
    """Choose the first step after a jump."""
    return _FIRST_STEP / np.sqrt(abs(body.omega))


@formula
def towards(left: Any, dt: Any) -> Any:
    """Choose the next step, so that steps end on a goal without a tiny last one."""
    halved = choose(less(left, 2 * dt), smaller(dt, 0.5 * left), dt)
    return choose(less(left, 1.2 * dt), left, halved)


@formula
def next_step(dt: Any, error: Any, tolerance: Any) -> Any:
    """Choose the step after one that was accepted."""
    factor = 0.9 * np.sqrt(tolerance / larger(error, 1e-12))
    return smaller(dt * smaller(2.5, larger(0.3, factor)), _LONGEST_STEP)


@formula
def shorter_step(dt: Any, error: Any, solved: Any, tolerance: Any) -> Any:
    """Choose the step in place of one that was rejected, by its error or because it could not be solved."""
    return dt * choose(solved, larger(0.2, 0.9 * np.sqrt(tolerance / error)), 0.3)


@compiled
def _try_step(
    body: Body, x: Floats, u: Floats, twist: Floats, x_now: Floats, slope_now: Floats, lag_now: Floats,
    now: float, dt: float, step: _Step, work: Workspace,
) -> bool:  # fmt: skip
    """Solve both stages; x, u and `step` hold the end of the step. Return whether Newton's method converged."""
    tau = GAMMA * dt
    for stage in range(2):
        step.start[:] = x_now
        lag_start = lag_now.copy()
        if stage == 1:
            step.start[:] += (1 - GAMMA) * dt * step.slope[0]
            lag_start += (1 - GAMMA) * dt * step.lag_slope[0]
        x[:] = step.start + tau * (slope_now if stage == 0 else step.slope[0])
        rates = in_transient(1 / tau, FIRST_PHASE, step.by_phase, step.start)
        if not _solve_stage(body, rates, x, u, stage == 0, work):
            return False
        step.slope[stage] = (x - step.start) / tau
        at = now + (tau if stage == 0 else dt)
        advance_lag(body, u, twist, at, 1 / tau, lag_start, step.lag_by_phase, step.lag)
        step.lag_slope[stage] = (step.lag - lag_start) / tau
    return True


@compiled
def _solve_stage(body: Body, rates: Rates, x: Floats, u: Floats, anew: bool, work: Workspace) -> bool:
    """Solve for x and u at the end of a stage; `anew`: factorise once, else with stored factors."""
    before = np.inf
    for count in range(MOST_CORRECTIONS):
        dx, du = correct(body, rates, x, u, work, anew and count == 0)
        size = np.max(np.abs(dx))
        if not size < min(largest_move(body), 2 * before):  # more, and the step is shortened
            return False
        move(body, x, dx)
        u += du
        if size < CORRECTION:
            return True
        before = size
    return False


@compiled_exactly
def embedded_error(slope: Floats, dt: Any) -> Any:
    """Compare with the embedded method, (1/2, 1/2) in place of (1 − γ, γ), in the largest entry.

    Args:
        slope: ∂x/∂t of the stages, (2, n, M, 3).
    """
    _, n, columns, _ = slope.shape
    factor, largest = (0.5 - GAMMA) * dt, 0.0 * dt
    for k in range(n):
        for c in range(3):
            mean = 0.0 * dt
            for m in range(columns):
                change = factor * (slope[0, k, m, c] - slope[1, k, m, c])
                mean += change / columns
                largest = larger(largest, _OSCILLATION * abs(change))
            largest = larger(largest, abs(mean))
    return largest


@compiled
def lag_at(solution: Transient, times: Floats) -> Floats:
    """Interpolate the lag (T, Q, 3) to `times` (T,) between the first step and the last (cubic Hermite)."""
    out = np.empty((len(times), solution.lag.shape[1], 3))
    k = 1
    for i in range(len(times)):
        while k < len(solution.times) - 2 and solution.times[k + 1] < times[i]:
            k += 1
        span = solution.times[k + 1] - solution.times[k]
        s = (times[i] - solution.times[k]) / span
        for p in range(out.shape[1]):
            for c in range(3):
                out[i, p, c] = between(
                    s, span, solution.lag[k, p, c], solution.lag[k + 1, p, c],
                    solution.lag_rate[k, p, c], solution.lag_rate[k + 1, p, c],
                )  # fmt: skip
    return out
