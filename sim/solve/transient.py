"""How a robot comes to its steady motion: shapes at all phases of the disc, changing from turn to turn.

The shape of a tail depends on the time t since the motor's speed jumped and on the disc's phase φ:

    ẋ = ∂x/∂t + ω_t ∂x/∂φ

At each t, x is collocated at M phases, as on an orbit (`sim.solve.orbit`). One solution holds M/N robots, one for
each disc phase at the jump. It is smooth in t, so time steps need not resolve the turning of the disc.

Time steps are those of SDIRK2 (γ = 1 − 1/√2, L-stable, second order). Both stages use one factorisation. The
length of a step follows the difference to the embedded method of first order.

With the pose g after the jump and the steady circle c, the lag λ = (Δz, Δx, Δψ) is defined by g = λ ∘ c. It is
integrated in the same steps, and stops changing where the motion is steady:

    λ_ψ' = ω_yr − ω*_yr,   (λ_z, λ_x)' = Rot(ψ)(v − v*) + λ_ψ' J Rot(λ_ψ) c

Where a turn has an odd number of instants, λ is a function of φ, too: its mean and spread over φ are those of
robots whose phase at the jump is unknown. Where the number is even, only the mean over a turn is followed.

Units: l, μ0 l⁴/EI. Source: Alexander (1977) for SDIRK2; Brachtendorf and others (1996) for a phase as second time.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from sim.arrays import Floats
from sim.compiling import compiled
from sim.linear.dense import solve_dense
from sim.linear.spectral import differentiation
from sim.mechanics.balance import tail_spin
from sim.model.body import Body
from sim.solve.march import GAMMA
from sim.solve.newton import Workspace, correct, largest_move, move, new_workspace
from sim.solve.orbit import FIRST_PHASE
from sim.solve.rates import in_transient

MOST_STEPS = 400
_CORRECTION = 1e-3  # of a node, in l: Newton's method stops below it
_MOST_CORRECTIONS = 8
_OSCILLATION = 0.1  # weight of what averages out over a turn in the error of a step
_FIRST_STEP = 5e-3  # over √ω̄
_LONGEST_STEP = 0.5
_MOST_REJECTED = 60


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
    turning: Floats  # d/dφ on the instants of a turn, (Q, Q)


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
    instants = u.shape[0]
    fields = instants if instants % 2 == 1 else 1
    turning = columns // instants * differentiation(fields) if fields > 1 else np.zeros((1, 1))
    step = _Step(
        np.zeros((2, n, columns, 3)), np.zeros((2, fields, 3)), np.empty_like(x), np.zeros((fields, 3)), turning
    )
    times, lags = np.zeros(MOST_STEPS + 1), np.zeros((MOST_STEPS + 1, fields, 3))
    rates, shapes = np.zeros_like(lags), np.zeros((len(marks), n, columns, 3))
    work = new_workspace(in_transient(1.0, FIRST_PHASE, x), x, u)
    x_now, u_now, slope_now = x.copy(), u.copy(), np.zeros_like(x)
    now, count, mark, rejected = 0.0, 0, 0, 0
    dt = _FIRST_STEP / np.sqrt(abs(body.omega))
    while now < until and count < MOST_STEPS and rejected < _MOST_REJECTED:
        goal = marks[mark] if mark < len(marks) else until
        dt = _towards(goal - now, dt)
        solved = _try_step(body, x, u, twist, x_now, slope_now, lags[count], now, dt, step, work)
        error = _embedded_error(step, dt) if solved else np.inf
        if not error < 2 * tolerance:
            rejected += 1
            dt *= max(0.2, 0.9 * np.sqrt(tolerance / error)) if solved else 0.3
            u[:] = u_now
            continue
        now = goal if now + dt > goal - 1e-12 else now + dt
        count += 1
        times[count], lags[count], rates[count] = now, step.lag, step.lag_slope[1]
        x_now[:], u_now[:], slope_now[:] = x, u, step.slope[1]
        if mark < len(marks) and now == marks[mark]:
            shapes[mark] = x
            mark += 1
        dt = min(dt * min(2.5, max(0.3, 0.9 * np.sqrt(tolerance / max(error, 1e-12)))), _LONGEST_STEP)
    solved = now >= until
    return Transient(times[: count + 1], lags[: count + 1], rates[: count + 1], shapes, solved)


@compiled
def _towards(left: float, dt: float) -> float:
    """Choose the next step, so that steps end on a goal without a tiny last one."""
    if 1.2 * dt > left:
        return left
    return min(dt, 0.5 * left) if 2 * dt > left else dt


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
        if not _solve_stage(body, x, u, 1 / tau, step.start, stage == 0, work):
            return False
        step.slope[stage] = (x - step.start) / tau
        _advance_lag(body, u, twist, now + (tau if stage == 0 else dt), 1 / tau, lag_start, step)
        step.lag_slope[stage] = (step.lag - lag_start) / tau
    return True


@compiled
def _solve_stage(
    body: Body, x: Floats, u: Floats, rate: float, start: Floats, anew: bool, work: Workspace
) -> bool:
    """Solve with ẋ = ω_t ∂x/∂φ + rate (x − start); `anew`: factorise once, else with stored factors."""
    rates = in_transient(rate, FIRST_PHASE, start)
    before = np.inf
    for count in range(_MOST_CORRECTIONS):
        dx, du = correct(body, rates, x, u, work, anew and count == 0)
        size = np.max(np.abs(dx))
        if not size < min(largest_move(body), 2 * before):  # more, and the step is shortened
            return False
        move(body, x, dx)
        u += du
        if size < _CORRECTION:
            return True
        before = size
    return False


@compiled
def _embedded_error(step: _Step, dt: float) -> float:
    """Compare with the embedded method, (1/2, 1/2) in place of (1 − γ, γ), in the largest entry."""
    _, n, columns, _ = step.slope.shape
    factor, largest = (0.5 - GAMMA) * dt, 0.0
    for k in range(n):
        for c in range(3):
            mean = 0.0
            for m in range(columns):
                change = factor * (step.slope[0, k, m, c] - step.slope[1, k, m, c])
                mean += change / columns
                largest = max(largest, _OSCILLATION * abs(change))
            largest = max(largest, abs(mean))
    return largest


@compiled
def _advance_lag(
    body: Body, u: Floats, twist: Floats, time: float, rate: float, start: Floats, step: _Step
) -> None:
    """Solve rate (λ − start) + ω_t ∂λ/∂φ = λ' for the lag at the end of a stage, into `step.lag`."""
    fields = start.shape[0]
    matrix, right = np.zeros((fields, fields)), np.empty((fields, 1))
    motion = _instants(body, u, fields)  # (Q, 4): v_z, h_x, ω_yr, ω_t
    for p in range(fields):
        matrix[p] = motion[p, 3] * step.turning[p]
        matrix[p, p] += rate
        right[p, 0] = motion[p, 2] - twist[2] + rate * start[p, 2]
    solve_dense(matrix.copy(), right)
    step.lag[:, 2] = right[:, 0]
    forward, leftward = _on_circle(twist, time)
    right = np.empty((fields, 2))
    for p in range(fields):
        lag, heading = step.lag[p, 2], step.lag[p, 2] + twist[2] * time
        surge, sway, turning = motion[p, 0] - twist[0], motion[p, 1] - twist[1], motion[p, 2] - twist[2]
        z = np.cos(lag) * forward - np.sin(lag) * leftward
        x = np.sin(lag) * forward + np.cos(lag) * leftward
        right[p, 0] = np.cos(heading) * surge - np.sin(heading) * sway + turning * x + rate * start[p, 0]
        right[p, 1] = np.sin(heading) * surge + np.cos(heading) * sway - turning * z + rate * start[p, 1]
    solve_dense(matrix, right)
    step.lag[:, :2] = right


@compiled
def _instants(body: Body, u: Floats, fields: int) -> Floats:
    """Compute (v_z, h_x, ω_yr, ω_t) at every instant of a turn, or their mean over time."""
    motion = np.empty((u.shape[0], 4))
    for p in range(u.shape[0]):
        motion[p, 0], motion[p, 1] = u[p, 1], u[p, 0] + u[p, 2] * body.head_length / 2
        motion[p, 2], motion[p, 3] = u[p, 2], tail_spin(body, u[p])
    if fields == u.shape[0]:
        return motion
    mean, time = np.zeros((1, 4)), 0.0
    for p in range(u.shape[0]):
        time += 1 / motion[p, 3]
        mean[0] += motion[p] / motion[p, 3]
    return mean / time


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
        first, last = solution.lag[k], solution.lag[k + 1]
        out[i] = first + s * s * (3 - 2 * s) * (last - first)
        out[i] += span * s * (1 - s) * ((1 - s) * solution.lag_rate[k] - s * solution.lag_rate[k + 1])
    return out


@compiled
def _on_circle(twist: Floats, time: float) -> tuple[float, float]:
    """Return where the steady circle is after a time: forward and to the left."""
    angle = twist[2] * time
    along = time * (np.sin(angle) / angle if abs(angle) > 1e-6 else 1.0)
    half = angle / 2
    across = time * (np.sin(half) / half if abs(half) > 1e-6 else 1.0) * np.sin(half)
    return along * twist[0] - across * twist[1], across * twist[0] + along * twist[1]
