"""How robots come to their steady motions: shapes at all phases of the disc, changing from turn to turn.

The shape of a tail depends on the time t since the motor's speed jumped and on the disc's phase φ:

    ẋ = ∂x/∂t + ω_t ∂x/∂φ

At each t, x is collocated at M phases, as on an orbit (`sim.solve.orbit`). One solution holds M/N robots, one for
each disc phase at the flips. It is smooth in t, so time steps need not resolve the turning of the disc.

Time steps are those of SDIRK2 (γ = 1 − 1/√2, L-stable, second order). Both stages use one factorisation. The
length of a step follows the difference to the embedded method of first order. The lag behind the steady circle
(`sim.solve.lag`) is integrated in the same steps.

Robots are in lanes (`sim.lanes`). Each lane has its own time, and its own length of steps. In each round every
lane tries a step; a lane whose step is rejected keeps its state, and one whose robot has come to its end takes the
next robot. So the numbers of a robot depend neither on its neighbours nor on the number of lanes.

Units: l, μ0 l⁴/EI. Source: Alexander (1977) for SDIRK2; Brachtendorf and others (1996) for a phase as second time.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from common.arrays import Floats, Integers
from sim.jit import borrowing, compiled, formula, inlined
from sim.lanes import choose, lane, lanes, larger, less, smaller, somewhere, width, with_lane, zeros
from sim.linear.lane_arrays import add_chosen, choose_all, combine, copy, largest_entry, put_lane, take_lane
from sim.linear.spectral import differentiation
from sim.model.body import Body
from sim.solve.assembly import are_local
from sim.solve.grouping import NAMES, body_of_numbers, by_kind
from sim.solve.lag import advance_lag, between, turning
from sim.solve.march import GAMMA
from sim.solve.newton import Workspace, correct, largest_move, move, new_workspace
from sim.solve.rates import Rates, in_transient

_MOST_STEPS = 2000
_CORRECTION = 1e-3  # of a node, in l: Newton's method stops below it
_MOST_CORRECTIONS = 8
_OSCILLATION = 0.1  # weight of what averages out over a turn in the error of a step
_FIRST_STEP = 5e-3  # over √ω̄
_LONGEST_STEP = 0.5
_MOST_REJECTED = 60
NO_MARKS = np.empty(0)


class Flip(NamedTuple):
    """A robot at a jump of its motor's speed, such as a flip; or B robots, in arrays (B, …)."""

    numbers: Floats  # with the speed after the jump, (K,), see `sim.solve.assembly.numbers`
    x: Floats  # shape, (n, M, 3)
    u: Floats  # guessed velocities, (P, 4)
    twist: Floats  # steady (v_z, h_x, ω_yr) after the jump, (3,): mean surge, sway of the head's centre, yaw rate
    until: Any  # time to follow


class Course(NamedTuple):
    """What a robot does after a jump; or B robots, in arrays (B, …)."""

    lag: Floats  # (T, Q, 3): (Δz, Δx, Δψ), Q phases, or one entry for the mean over a turn; NaN after its end
    velocities: Floats  # (T, P, 4)
    shapes: Floats  # at the marks, (K, n, M, 3)
    end: Floats  # shape at the end, (n, M, 3)
    solved: Any


class _State(NamedTuple):
    """Where the lanes are: at the start of a step, or in one."""

    x: Floats  # (n, M, 3)
    u: Floats  # (P, 4)
    slope: Floats  # ∂x/∂t, (n, M, 3)
    lag: Floats  # (Q, 3)
    lag_rate: Floats  # (Q, 3)


class _Step(NamedTuple):
    """One step in the making."""

    slope: Floats  # (2, n, M, 3): ∂x/∂t of the stages
    lag_slope: Floats  # (2, Q, 3)
    start: Floats  # (n, M, 3)
    lag_start: Floats  # (Q, 3)
    dx: Floats  # (n, M, 3)
    du: Floats  # (P, 4)
    by_phase: Floats  # d/dφ of x, (M, M)
    lag_by_phase: Floats  # d/dφ of the lag, (Q, Q)


class _Progress(NamedTuple):
    """Which robot each lane has, and how far it has come; (W,)."""

    robot: Integers
    steps: Integers
    rejected: Integers
    marks: Integers  # passed
    places: Integers  # times at which the lag is known


def follow_flips(
    flips: Sequence[Flip | None], times: Floats, tolerance: float, marks: Floats = NO_MARKS
) -> list[Course | None]:
    """Follow robots after flips of their motors; None where there is no flip, or no solution.

    Args:
        flips: of robots with any number of tails, phases and edges.
        times: at which the lag is wanted, (T,), increasing.
        tolerance: on the shape in one time step, in l.
        marks: times at which shapes are kept, (K,), increasing.
    """
    courses: list[Course | None] = [None] * len(flips)
    made = {i: flip for i, flip in enumerate(flips) if flip is not None}
    # Fast motors take more steps: they begin, so that the last robots end together.
    order = sorted(made, key=lambda i: -abs(made[i].numbers[0]))
    for robots in by_kind(
        order, lambda i: (made[i].x.shape, len(made[i].u), bool(are_local(made[i].numbers[None])[0]))
    ):
        stacked = Flip(*(np.array(part) for part in zip(*(made[i] for i in robots), strict=True)))
        found = _follow(stacked, NAMES, marks, times, tolerance)
        for at, i in enumerate(robots):
            if found.solved[at]:
                courses[i] = Course(*(part[at] for part in found))
    return courses


@compiled
def _follow(flips: Flip, names: Any, marks: Floats, times: Floats, tolerance: float) -> Course:
    """Follow robots from their shapes at a jump of the motor's speed.

    Args:
        flips: of the robots.
        names: of the non-local effects.
        marks: times at which shapes are kept, increasing.
        times: at which the lag is wanted, (T,), increasing.
        tolerance: on the shape in one step, in l.

    Returns:
        NaN at marks and times after a robot's end.
    """
    robots, n, columns, _ = flips.x.shape
    count = width()
    numbers, twist = lanes(np.empty((flips.numbers.shape[1], count))), lanes(np.empty((3, count)))
    by_phase, lag_by_phase = differentiation(columns), turning(columns, flips.u.shape[1])
    fields = lag_by_phase.shape[0]
    at = _new_state(numbers, n, columns, flips.u.shape[1], fields)
    new = _new_state(numbers, n, columns, flips.u.shape[1], fields)
    step = _Step(
        zeros(numbers, (2, n, columns, 3)), zeros(numbers, (2, fields, 3)), zeros(numbers, at.x.shape),
        zeros(numbers, (fields, 3)), zeros(numbers, at.x.shape), zeros(numbers, at.u.shape), by_phase,
        lag_by_phase,
    )  # fmt: skip
    found = Course(
        np.full((robots, len(times), fields, 3), np.nan),
        np.full((robots, len(times), flips.u.shape[1], 4), np.nan),
        np.full((robots, len(marks), n, columns, 3), np.nan),
        np.full(flips.x.shape, np.nan),
        np.zeros(robots, np.bool_),
    )
    # Lanes without a robot of their own repeat the last one; their results are not recorded.
    waiting = np.full(count, -1)
    progress = _Progress(waiting, waiting.copy(), waiting.copy(), waiting.copy(), waiting.copy())
    for i in range(count):
        _load(flips, min(i, robots - 1), i, numbers, twist, at, progress)
    started = min(count, robots)
    body = body_of_numbers(numbers, names)
    work = new_workspace(in_transient(1.0, by_phase, at.x), at.x, at.u)
    now, dt = zeros(numbers, (1,))[0], _first_step(body)
    goal, going = now, now
    for i in range(count):
        goal = with_lane(goal, i, _goal(flips, progress, i, marks))
        going = with_lane(going, i, 1.0 if i < started else 0.0)
    while somewhere(going):
        # No step jumps over a mark or a robot's end, so a shape there is a shape that was solved for.
        dt = choose(going, _towards(goal - now, dt), dt)
        solved = _try_step(body, twist, at, new, now, dt, going, step, work)
        error = choose(solved, _embedded_error(step.slope, dt), np.inf)
        accepted = going * less(error, 2 * tolerance)
        ended = 1 - less(now + dt, goal - 1e-12)
        new_now = choose(accepted, choose(ended, goal, now + dt), now)
        for i in range(count):
            if lane(accepted, i) != 0:
                progress.steps[i] += 1
                _record(i, progress, at, new, step.lag_slope[1], now, new_now, marks, times, found)
                goal = with_lane(goal, i, _goal(flips, progress, i, marks))
            elif lane(going, i) != 0:
                progress.rejected[i] += 1
        _accept(at, new, step, accepted)
        now = new_now
        dt = choose(accepted, _next_step(dt, error, tolerance), _shorter_step(dt, error, solved, tolerance))
        # A robot that has ended leaves its lane to the next one, so no lane idles while robots wait.
        before = started
        for i in range(count):
            if lane(going, i) != 0 and _has_ended(flips, progress, i, at, lane(now, i), found):
                if started < robots:
                    _load(flips, started, i, numbers, twist, at, progress)
                    now, goal = with_lane(now, i, 0.0), with_lane(goal, i, _goal(flips, progress, i, marks))
                    started += 1
                    going = with_lane(going, i, -1.0)  # new: its body and first step follow below
                else:
                    going = with_lane(going, i, 0.0)
        if started > before:
            body = body_of_numbers(numbers, names)
            dt, going = choose(less(going, 0.0), _first_step(body), dt), abs(going)
    return found


@compiled
def _new_state(like: Floats, n: int, columns: int, instants: int, fields: int) -> _State:
    """Allocate the state of the lanes."""
    x, lag = (n, columns, 3), (fields, 3)
    return _State(zeros(like, x), zeros(like, (instants, 4)), zeros(like, x), zeros(like, lag), zeros(like, lag))


@compiled
def _load(
    flips: Flip, robot: int, i: int, numbers: Floats, twist: Floats, at: _State, progress: _Progress
) -> None:
    """Put a robot at its jump into lane i; one without numbers can only come to its end."""
    progress.robot[i] = robot
    progress.steps[i], progress.marks[i], progress.places[i] = 0, 0, 0
    progress.rejected[i] = 0 if np.isfinite(np.sum(flips.numbers[robot])) else _MOST_REJECTED
    put_lane(numbers, i, flips.numbers[robot])
    put_lane(twist, i, flips.twist[robot])
    put_lane(at.x, i, flips.x[robot])
    put_lane(at.u, i, flips.u[robot])
    put_lane(at.slope, i, np.zeros(at.slope.shape))
    put_lane(at.lag, i, np.zeros(at.lag.shape))
    put_lane(at.lag_rate, i, np.zeros(at.lag.shape))


@borrowing
def _has_ended(flips: Flip, progress: _Progress, i: int, at: _State, now: float, found: Course) -> bool:
    """Tell whether the robot of lane i has come to its end, or cannot; keep its shape at the end."""
    robot = progress.robot[i]
    if now >= flips.until[robot]:
        found.solved[robot] = True
        take_lane(found.end[robot], at.x, i)
        return True
    return bool(progress.steps[i] >= _MOST_STEPS or progress.rejected[i] >= _MOST_REJECTED)


@borrowing
def _goal(flips: Flip, progress: _Progress, i: int, marks: Floats) -> float:
    """Return the time at which a step of lane i must end next."""
    until, mark = flips.until[progress.robot[i]], progress.marks[i]
    return float(marks[mark]) if mark < len(marks) and marks[mark] < until else float(until)


@inlined
def _try_step(
    body: Body, twist: Floats, at: _State, new: _State, now: Any, dt: Any, going: Any, step: _Step, work: Workspace
) -> Any:
    """Solve both stages; `new` and `step` hold the end of the step. Return where Newton's method converged."""
    tau = GAMMA * dt
    solved = going
    copy(new.u, at.u)
    for stage in range(2):
        _begin_stage(at, new, step, stage, dt, tau)
        rates = in_transient(1 / tau, step.by_phase, step.start)
        solved = _solve_stage(body, rates, new.x, new.u, stage == 0, solved, step, work)
        if not somewhere(solved):
            break
        combine(step.slope[stage], 1 / tau, new.x, -1 / tau, step.start)
        end = now + (tau if stage == 0 else dt)
        advance_lag(body, new.u, twist, end, 1 / tau, step.lag_start, step.lag_by_phase, new.lag)
        combine(step.lag_slope[stage], 1 / tau, new.lag, -1 / tau, step.lag_start)
    return solved


@borrowing
def _begin_stage(at: _State, new: _State, step: _Step, stage: int, dt: Any, tau: Any) -> None:
    """Fill the starts of a stage, and guess its shape."""
    if stage == 0:
        copy(step.start, at.x)
        copy(step.lag_start, at.lag)
        combine(new.x, 1.0, at.x, tau, at.slope)
    else:
        share = (1 - GAMMA) * dt
        combine(step.start, 1.0, at.x, share, step.slope[0])
        combine(step.lag_start, 1.0, at.lag, share, step.lag_slope[0])
        combine(new.x, 1.0, step.start, tau, step.slope[0])


@inlined
def _solve_stage(
    body: Body, rates: Rates, x: Floats, u: Floats, anew: bool, going: Any, step: _Step, work: Workspace
) -> Any:
    """Solve for x and u at the end of a stage, where `going` is 1; return where it converged.

    Args:
        anew: factorise once; else the stored factors are used.
    """
    before, solved, limit = going * np.inf, 0.0 * going, largest_move(body)
    for count in range(_MOST_CORRECTIONS):
        correct(body, rates, x, u, work, anew and count == 0, going, step.dx, step.du)
        size = largest_entry(step.dx)
        going = going * less(size, smaller(limit, 2 * before))  # else the step is shortened
        move(body, x, 1.0, step.dx, going)
        add_chosen(u, 1.0, step.du, going)
        converged = going * less(size, _CORRECTION)
        solved, going, before = larger(solved, converged), going - converged, size
        if not somewhere(going):
            break
    return solved


@borrowing
def _accept(at: _State, new: _State, step: _Step, accepted: Any) -> None:
    """Let accepted steps be the state."""
    choose_all(at.x, accepted, new.x, at.x)
    choose_all(at.u, accepted, new.u, at.u)
    choose_all(at.slope, accepted, step.slope[1], at.slope)
    choose_all(at.lag, accepted, new.lag, at.lag)
    choose_all(at.lag_rate, accepted, step.lag_slope[1], at.lag_rate)


@borrowing
def _record(
    i: int, progress: _Progress, at: _State, new: _State, new_rate: Floats, now: Any, new_now: Any, marks: Floats,
    times: Floats, found: Course,
) -> None:  # fmt: skip
    """Keep lags and velocities that lie in an accepted step of lane i, and the shape if it ends at a mark."""
    robot, begin, end = progress.robot[i], lane(now, i), lane(new_now, i)
    while progress.steps[i] > 1 and progress.places[i] < len(times) and times[progress.places[i]] <= end:
        index = progress.places[i]
        share = (times[index] - begin) / (end - begin)
        for p in range(new.lag.shape[0]):
            for c in range(3):
                found.lag[robot, index, p, c] = between(
                    share, end - begin, lane(at.lag[p, c], i), lane(new.lag[p, c], i),
                    lane(at.lag_rate[p, c], i), lane(new_rate[p, c], i),
                )  # fmt: skip
        for p in range(new.u.shape[0]):
            for c in range(4):
                first, last = lane(at.u[p, c], i), lane(new.u[p, c], i)
                found.velocities[robot, index, p, c] = first + share * (last - first)
        progress.places[i] += 1
    if progress.marks[i] < len(marks) and end == marks[progress.marks[i]]:
        take_lane(found.shapes[robot, progress.marks[i]], new.x, i)
        progress.marks[i] += 1


@formula
def _first_step(body: Body) -> Any:
    """Choose the first step after a jump."""
    return _FIRST_STEP / np.sqrt(abs(body.omega))


@formula
def _towards(left: Any, dt: Any) -> Any:
    """Choose the next step, so that steps end on a goal without a tiny last one."""
    halved = choose(less(left, 2 * dt), smaller(dt, 0.5 * left), dt)
    return choose(less(left, 1.2 * dt), left, halved)


@formula
def _next_step(dt: Any, error: Any, tolerance: Any) -> Any:
    """Choose the step after one that was accepted."""
    factor = 0.9 * np.sqrt(tolerance / larger(error, 1e-12))
    return smaller(dt * smaller(2.5, larger(0.3, factor)), _LONGEST_STEP)


@formula
def _shorter_step(dt: Any, error: Any, solved: Any, tolerance: Any) -> Any:
    """Choose the step in place of one that was rejected, by its error or because it could not be solved."""
    return dt * choose(solved, larger(0.2, 0.9 * np.sqrt(tolerance / error)), 0.3)


@borrowing
def _embedded_error(slope: Floats, dt: Any) -> Any:
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
