"""Implicit time steps at constant motor speed, in the disc frame, for a robot in each lane (`sim.lanes`).

Positions are in the disc frame, in which the shape is almost steady at constant motor speed. Every stage solves
the balance with x = x* + τ ẋ, φ = φ* + τ ω_t by Newton's method (`sim.solve.newton`). One or two corrections are
enough in most steps, because the prediction is good. After a flip of the motor the first step is SDIRK2 (γ = 1 −
1/√2, one-step, L-stable). All later steps are BDF2 (γ = 2/3). Both are of second order and stiffly stable, which
is necessary because stretching is stiff. The pose is part of the same step:

    ψ' = ω_yr,   X' = v_z cos ψ − h_x sin ψ,   Y' = v_z sin ψ + h_x cos ψ,   h_x = v_x + ω_yr L/2,

the track of the head's centre seen from above: X along the first heading, Y to its left, ψ counter-clockwise. The
integrals of h_x and v_z (body frame) are stored as well, for means.

Each lane makes its own steps. In each round every lane is corrected once; a lane whose stage has converged goes on
to its next one, and waits for no other.

Units: l, μ0 l⁴/EI, EI/l².
Source: Alexander (1977) for SDIRK2; Hairer and Wanner, *Solving ODEs II*, V.1 for BDF2.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from common.arrays import Floats, Integers
from sim.jit import borrowing, compiled
from sim.lanes import choose, lane, lanes, larger, less, somewhere, width, with_lane, zeros
from sim.linear.lane_arrays import add_chosen, choose_all, largest_entry, take_lane
from sim.mechanics.balance import tail_spin
from sim.mechanics.geometry import straight
from sim.model.body import Body
from sim.solve.assembly import row
from sim.solve.grouping import NAMES, body_of_numbers, in_groups
from sim.solve.newton import MOST_CORRECTIONS, correct, largest_move, move, new_workspace
from sim.solve.rates import in_stage

PHASE, YAW, X, Y, SWAY, SURGE = range(6)  # entries of a pose
GAMMA = 1 - 1 / np.sqrt(2)
TOLERANCE = 2e-4  # on the last correction; Newton converges quadratically
REVERSED = np.array([-1.0, 1.0, -1.0, -1.0])  # signs of (v_x, v_z, ω_yr, ω_h) after a flip


class State(NamedTuple):
    """Shape, pose and velocities of a robot, changed in place by time steps; tails are in their own frames."""

    x: Floats
    x_dot: Floats
    pose: Floats  # (6,): φ, ψ, X, Y, ∫h_x, ∫v_z
    u: Floats  # (4,): v_x, v_z (of J), ω_yr, ω_h


class Steps(NamedTuple):
    """The time steps of a robot, (T,); or of those in the lanes of a group, (T, W)."""

    lengths: Floats
    anew: Any  # made by the one-step method, as the first one after a jump must be
    flips: Any  # the motor is reversed before it
    kept: Any  # the state after it is kept


class Marcher(NamedTuple):
    """A robot that is about to make time steps."""

    body: Body
    reverse: Body  # the same robot with its motor reversed
    state: State  # changed
    steps: Steps


class Marched(NamedTuple):
    """What a robot has done in its time steps."""

    done: int  # steps, all of them unless one did not converge; then the state is that of the step that failed
    poses: Floats  # after every step, (T, 6); NaN from the step that failed on
    kept: State  # after the steps that keep it, arrays (K, …)


class _Written(NamedTuple):
    """What is written down of each lane."""

    done: Integers  # steps, (W,)
    poses: Floats  # (W, T, 6)
    kept: State  # arrays (W, K, …)


@compiled
def _march(
    numbers: Floats, names: Any, given: State, steps: Steps, counts: Integers, tolerance: float,
    record: _Written,
) -> None:  # fmt: skip
    """Make the steps of the robots of one group, each in its lane; arrays end with (W,).

    Args:
        numbers: of the robots, and with their motors reversed, (2, K, W).
        names: of the non-local effects.
        given: where they start, changed.
        steps: (T, W).
        counts: how many of the steps each lane makes, (W,).
        tolerance: on the last correction.
        record: filled.
    """
    own, other = lanes(numbers)[0], lanes(numbers)[1]
    state = State(lanes(given.x), lanes(given.x_dot), lanes(given.pose), lanes(given.u))
    star, now, before = _new_like(state), _new_like(state), _new_like(state)
    u = state.u.reshape((1, 4))
    dx, du = zeros(state.x, state.x.shape), zeros(u, u.shape)
    work = new_workspace(in_stage(1.0, 0.0, star.x), state.x, u)
    body, limit = body_of_numbers(own, names), largest_move(body_of_numbers(own, names))
    none = 0.0 * state.pose[0]
    going, begins, dt, anew, second, corrections = none, none, none + 1.0, none, none, none
    slots = np.zeros(width(), np.int64)
    for i in range(width()):
        going = with_lane(going, i, 1.0 if counts[i] > 0 else 0.0)
    begins, tau = going, dt
    while somewhere(going):
        # A lane whose stage converged starts its next one; it waits for no other.
        if somewhere(begins):
            starts, flips = begins * (1 - second), none
            for i in range(width()):
                if lane(starts, i) != 0:
                    at = record.done[i]
                    dt, anew = with_lane(dt, i, steps.lengths[at, i]), with_lane(anew, i, steps.anew[at, i])
                    flips = with_lane(flips, i, steps.flips[at, i])
            if somewhere(flips):
                _flip(own, other, state, flips)
                body = body_of_numbers(own, names)
                limit = largest_move(body)
            tau = choose(begins, dt * choose(anew, GAMMA, 2 / 3), tau)
            _begin_stage(state, star, now, before, dt, tau, starts, begins, anew, second)
            corrections = choose(begins, 0.0, corrections)
        correct(body, in_stage(1 / tau, star.pose[PHASE], star.x), state.x, u, work, True, going, dx, du)
        change = larger(largest_entry(dx), largest_entry(du) / (1 + abs(body.omega)))
        going = going * less(change, np.inf)
        # Newton's method converges from afar if no node moves further than `limit` in a correction.
        share = choose(less(limit, change), limit / change, 1.0)
        move(body, state.x, share, dx, going)
        add_chosen(u, share, du, going)
        corrections = corrections + 1
        ends = going * less(change, tolerance)
        # A lane out of corrections stops for good; its state stays that of the failed step.
        going = going * larger(ends, less(corrections, MOST_CORRECTIONS))
        begins = ends
        if somewhere(ends):
            _end_stage(body, state, star, tau, ends)
            # A first stage of SDIRK2 ends no step: its second stage begins.
            second, ends = choose(ends, anew * (1 - second), second), ends * (1 - anew * (1 - second))
        for i in range(width()):
            if lane(ends, i) != 0:
                at = record.done[i]
                take_lane(record.poses[i, at], state.pose, i)
                if steps.kept[at, i] != 0:
                    take_lane(record.kept.x[i, slots[i]], state.x, i)
                    take_lane(record.kept.x_dot[i, slots[i]], state.x_dot, i)
                    take_lane(record.kept.pose[i, slots[i]], state.pose, i)
                    take_lane(record.kept.u[i, slots[i]], state.u, i)
                    slots[i] += 1
                record.done[i] = at + 1
                if at + 1 == counts[i]:
                    going = with_lane(going, i, 0.0)
        begins = begins * going


@compiled
def _new_like(state: State) -> State:
    """Allocate arrays for a state."""
    x, pose, u = state.x, state.pose, state.u
    return State(zeros(x, x.shape), zeros(x, x.shape), zeros(x, pose.shape), zeros(x, u.shape))


@borrowing
def _flip(own: Floats, other: Floats, state: State, flips: Any) -> None:
    """Reverse the motors in the lanes where `flips` is 1: shapes stay, velocities become their mirror image."""
    for j in range(len(own)):
        own[j], other[j] = choose(flips, other[j], own[j]), choose(flips, own[j], other[j])
    for a in range(4):
        state.u[a] = choose(flips, REVERSED[a] * state.u[a], state.u[a])
    rate = state.x_dot.reshape(state.x_dot.size)
    for j in range(len(rate)):
        rate[j] = choose(flips, 0.0, rate[j])


@borrowing
def _begin_stage(
    state: State, star: State, now: State, before: State, dt: Any, tau: Any, starts: Any, begins: Any, anew: Any,
    second: Any,
) -> None:  # fmt: skip
    """Fill x* and the pose's part of `star`, and predict x and u in `state`, in the lanes where `begins` is 1.

    Args:
        now, before: states at the start of this step and of the one before.
        starts: 1 where a step starts with this stage.
        anew, second: 1 in steps of SDIRK2 and in their second stage; then state.x_dot and state.pose are those of
            the first one.
    """
    for values, last, first in ((state.pose, now.pose, before.pose), (state.u, now.u, before.u)):
        choose_all(first, starts, last, first)
        choose_all(last, starts, values, last)
    weight, earlier = choose(anew, 1.0, 4 / 3), choose(anew, 0.0, -1 / 3)
    share = choose(anew * second, (1 - GAMMA) * dt / tau, 0.0)
    for c in range(len(state.pose)):
        start = (weight - share) * now.pose[c] + earlier * before.pose[c] + share * state.pose[c]
        star.pose[c] = choose(begins, start, star.pose[c])
    for a in range(len(state.u)):
        state.u[a] = choose(begins * (1 - anew), 2.0 * now.u[a] - 1.0 * before.u[a], state.u[a])
    ahead, behind = choose(anew, 1.0, 2.0), choose(anew, 0.0, -1.0)
    change, lead = share * tau, choose(anew, choose(second, dt, tau), 0.0)
    size = state.x.size
    x, x_dot, origin = state.x.reshape(size), state.x_dot.reshape(size), star.x.reshape(size)
    here, there = now.x.reshape(size), before.x.reshape(size)
    for j in range(size):
        there[j] = choose(starts, here[j], there[j])
        here[j] = choose(starts, x[j], here[j])
        origin[j] = choose(begins, weight * here[j] + earlier * there[j] + change * x_dot[j], origin[j])
        x[j] = choose(begins, ahead * here[j] + behind * there[j] + lead * x_dot[j], x[j])


@borrowing
def _end_stage(body: Body, state: State, star: State, tau: Any, ends: Any) -> None:
    """Set x_dot and pose at the end of a stage, pose = star + τ d(pose)/dt, in the lanes where `ends` is 1."""
    size, rate = state.x.size, 1 / tau
    x, x_dot, origin = state.x.reshape(size), state.x_dot.reshape(size), star.x.reshape(size)
    for j in range(size):
        x_dot[j] = choose(ends, rate * x[j] - rate * origin[j], x_dot[j])
    u, pose, start = state.u, state.pose, star.pose
    sway, surge = u[0] + u[2] * body.head_length / 2, u[1]
    yaw = start[YAW] + tau * u[2]
    cos, sin = np.cos(yaw), np.sin(yaw)
    pose[PHASE] = choose(ends, start[PHASE] + tau * tail_spin(body, u), pose[PHASE])
    pose[YAW] = choose(ends, yaw, pose[YAW])
    pose[X] = choose(ends, start[X] + tau * (surge * cos - sway * sin), pose[X])
    pose[Y] = choose(ends, start[Y] + tau * (surge * sin + sway * cos), pose[Y])
    pose[SWAY] = choose(ends, start[SWAY] + tau * sway, pose[SWAY])
    pose[SURGE] = choose(ends, start[SURGE] + tau * surge, pose[SURGE])


def new_state(tails: int, edges: int, offset: float) -> State:
    """Start from straight tails at rest."""
    x = straight(edges, tails, offset)
    return State(x, np.zeros_like(x), np.zeros(6), np.zeros(4))


def equal_steps(duration: float, count: int) -> Steps:
    """Return equal time steps at constant motor speed; the first is made by the one-step method."""
    return Steps(
        np.full(count, duration / count), np.arange(count) == 0, np.zeros(count, bool), np.zeros(count, bool)
    )


def joined(parts: Sequence[Steps]) -> Steps:
    """Return the steps of several parts, one after the other."""
    return Steps(*map(np.concatenate, zip(*parts, strict=True)))


def side_by_side(swims: Sequence[Marcher], tolerance: float = TOLERANCE) -> list[Marched]:
    """Let at most W robots with equal numbers of tails and edges make their time steps side by side."""
    counts = [len(swim.steps.lengths) for swim in swims]
    wrong = [~((swim.steps.lengths > 0) & (swim.steps.lengths < np.inf)) for swim in swims]
    able = [int(np.argmax(bad)) if bad.any() else count for bad, count in zip(wrong, counts, strict=True)]
    steps = [
        in_groups(np.array([np.pad(part.astype(float), (0, max(counts) - len(part))) for part in parts]))[0]
        for parts in zip(*(swim.steps for swim in swims), strict=True)
    ]
    states = State(*(in_groups(np.array(part))[0] for part in zip(*(swim.state for swim in swims), strict=True)))
    slots = [int(swim.steps.kept.sum()) for swim in swims]
    kept = State(*(np.empty((width(), max(slots), *part.shape[:-1])) for part in states))
    record = _Written(np.zeros(width(), int), np.full((width(), max(counts), 6), np.nan), kept)
    numbers = in_groups(np.array([np.concatenate([row(swim.body), row(swim.reverse)]) for swim in swims]))[0]
    asked = np.zeros(width(), int)
    asked[: len(able)] = able
    _march(numbers, NAMES, states, Steps(*steps), asked, tolerance, record)
    found = []
    for i, swim in enumerate(swims):
        for part, end in zip(swim.state, states, strict=True):
            part[:] = end[..., i]
        own = State(*(part[i, : slots[i]] for part in kept))
        found.append(Marched(int(record.done[i]), record.poses[i, : counts[i]], own))
    return found
