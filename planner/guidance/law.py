"""The law of guidance: when the motor flips next, from plain numbers.

Its equations stand in `planner.guidance.line_of_sight`. All functions are formulas: a plan follows a whole path
in a compiled loop (`follow_dwells`), a tracker asks for one flip at a time in plain Python. The time of a flip is
the root of one equation, which the secant method finds in about four evaluations. Their cost does not depend on
the length of the path: the place on it is remembered, and moves forward.

A pose is x, y and heading of the head's centre. `sense` is the direction of the motor, `before` the length of the
dwell before, or REST. Lengths in l, times in μ0 l⁴/EI.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from common.arrays import Floats
from sim.jit import compiled, formula
from sim.mechanics.planar import POSE, slip

EXACT = 1e-7  # rad, of the heading at a flip
LARGEST_STEP = 0.4  # rad that the robot turns between two evaluations
LARGEST_TURN = 1.5  # rad that it turns while its place on the path is sought from the last one
TURNS = 4 * math.pi  # a dwell that turns further than this leads nowhere
MOST_BIAS = 0.3  # rad
HALVINGS = 30
MOST_LOOKS = 500  # evaluations of the equation for one dwell; about four are needed
SEGMENTS = 3  # of a way to the path
NO_WAY = -1
REST = math.nan  # the dwell before the first one

Table = Any  # an array, or the same in nested lists, which plain Python reads faster


class Segment(NamedTuple):
    """An arc or a straight line: where it starts, its curvature, its length, and h on it."""

    x: float
    y: float
    course: float
    curvature: float
    length: float
    hysteresis: float


NO_SEGMENT = Segment(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


class GuidanceLaw(NamedTuple):
    """What is followed, by which robot, and how."""

    x: Table  # (m,), of the pivot on the reference
    y: Table
    heading: Table  # (m,) [rad]
    arc: Table  # (m,)
    hysteresis: Table  # (m − 1,) [rad]
    last: int  # step of the reference
    dwell: float  # shortest dwell
    ahead: float  # look-ahead
    rod: float  # from the pivot to the tracked point
    offset: float  # from the head's centre forward to the tracked point
    knots: Table  # (K,), dwells before, at which lags are known
    step: float  # of time, between two lags
    twist: Table  # (2, 3), of directions + and −: forward, left, yaw rate
    lag: Table  # (2, K, T, 3): forward, left, heading
    rest: Table  # (2, T, 3), from rest
    current: Table  # (2,), in the lab
    lag_angle: float = 0.0  # added to the angle of all lags
    around: bool = False  # a lap follows after the last step
    lean: float = 0.0  # angle by which the reference is turned about the tracked point
    way: tuple[Segment, Segment, Segment] = (NO_SEGMENT, NO_SEGMENT, NO_SEGMENT)  # to the reference
    target: int = NO_WAY  # step at which the way ends
    way_ahead: float = 1.0  # look-ahead on the way
    drift: POSE = (0.0, 0.0, 0.0)  # on the way: sideways and in the lab, as shares of the net speed


class PathState(NamedTuple):
    """Where the robot is on path and way, and what the law remembers of the last flip."""

    step: int = 0  # of the reference
    share: float = 0.0  # of this step
    leg: int = SEGMENTS  # segment of the way; SEGMENTS: the reference is followed
    along: float = 0.0  # length along the segment
    error: float = 0.0  # cross-track error, left positive
    last_error: float = 0.0  # at the flip before
    bias: float = 0.0  # the integral [rad]
    reached: float = 0.0  # arc length at the flip before


class NextFlip(NamedTuple):
    """The end of a dwell."""

    time: float  # since its beginning
    ended: bool  # the path ends there
    lost: bool  # the robot turns in circles, and there is none
    state: PathState


@formula
def placed(state: PathState, step: int, share: float, leg: int, along: float, error: float) -> PathState:
    """Move the robot on path and way; what the law remembers of the last flip stays."""
    return PathState(step, share, leg, along, error, state.last_error, state.bias, state.reached)


@formula
def side_of(sense: int) -> int:
    """Return the index of a direction of the motor."""
    return 0 if sense > 0 else 1


@formula
def _between(table: Table, i: int, w: float) -> POSE:
    """Interpolate between two rows of a table (T, 3)."""
    low, high = table[i], table[i + 1]
    return low[0] + w * (high[0] - low[0]), low[1] + w * (high[1] - low[1]), low[2] + w * (high[2] - low[2])


@formula
def lag_after(law: GuidanceLaw, side: int, before: float, time: float) -> POSE:
    """Interpolate the lag after `time` in direction `side` (0: positive, 1: negative)."""
    rest, knots, u = law.rest[side], law.knots, time / law.step
    i = int(u)
    w = u - i
    if i > len(rest) - 2:
        i, w = len(rest) - 2, 1.0
    if math.isnan(before):
        return _between(rest, i, w)
    lag, k, part = law.lag[side], len(knots) - 2, 1.0
    if before < knots[-1]:
        k = 0
        while before > knots[k + 1]:
            k += 1
        part = max((before - knots[k]) / (knots[k + 1] - knots[k]), 0.0)
    z, x, turned = _between(lag[k], i, w)
    if part > 0:
        far_z, far_x, far_turned = _between(lag[k + 1], i, w)
        z, x, turned = z + part * (far_z - z), x + part * (far_x - x), turned + part * (far_turned - turned)
    return z, x, turned


@formula
def arc_terms(rate: float, time: float) -> POSE:
    """Return sin Ω T/Ω, (1 − cos Ω T)/Ω and Ω T."""
    angle = rate * time
    half = math.sin(angle / 2)
    return math.sin(angle) / rate, 2 * half * half / rate, angle


@formula
def pose_after(law: GuidanceLaw, pose: POSE, sense: int, before: float, time: float) -> POSE:
    """Predict the pose of the head's centre after `time` in direction `sense`."""
    side = side_of(sense)
    z, x, turned = lag_after(law, side, before, time)
    turned += sense * law.lag_angle
    twist, current = law.twist[side], law.current
    along, across, angle = arc_terms(twist[2], time)
    ahead, aside = along * twist[0] - across * twist[1], across * twist[0] + along * twist[1]
    c, s = math.cos(turned), math.sin(turned)
    z, x = z + c * ahead - s * aside, x + s * ahead + c * aside
    c, s = math.cos(pose[2]), math.sin(pose[2])
    return (
        pose[0] + c * z - s * x + current[0] * time,
        pose[1] + s * z + c * x + current[1] * time,
        pose[2] + turned + angle,
    )


@formula
def _excess_on_path(law: GuidanceLaw, state: PathState, pose: POSE, sense: int) -> tuple[float, PathState]:
    """Compute σ(φ − φ_d) − h about the reference."""
    heading = pose[2] - law.lean
    x = pose[0] + law.offset * math.cos(pose[2]) - law.rod * math.cos(heading)
    y = pose[1] + law.offset * math.sin(pose[2]) - law.rod * math.sin(heading)
    i, xs, ys, moved = state.step, law.x, law.y, 0
    while True:
        dx, dy = xs[i + 1] - xs[i], ys[i + 1] - ys[i]
        away_x, away_y = x - xs[i], y - ys[i]
        square = dx * dx + dy * dy
        share = (away_x * dx + away_y * dy) / square if square > 0 else 2.0
        if share > 1 and i < law.last and moved >= 0:
            i, moved = i + 1, 1
        elif share < 0 and i > 0 and moved <= 0:
            i, moved = i - 1, -1
        else:
            break
    error = (dx * away_y - dy * away_x) / math.sqrt(square) if square > 0 else 0.0
    within = min(max(share, 0.0), 1.0)
    wanted = law.heading[i] + within * (law.heading[i + 1] - law.heading[i])
    wanted -= math.atan(error / law.ahead) + state.bias
    there = placed(state, step=i, share=share, leg=SEGMENTS, along=0.0, error=error)
    return sense * (heading - wanted) - law.hysteresis[i], there


@formula
def project(segment: Segment, x: float, y: float, near: float) -> tuple[float, float]:
    """Return the progress along a segment, and the distance to its left; on an arc, nearest to `near`."""
    if segment.curvature == 0:
        c, s = math.cos(segment.course), math.sin(segment.course)
        ahead, aside = x - segment.x, y - segment.y
        return c * ahead + s * aside, c * aside - s * ahead
    side = 1.0 if segment.curvature > 0 else -1.0
    ahead = x - (segment.x - math.sin(segment.course) / segment.curvature)
    aside = y - (segment.y + math.cos(segment.course) / segment.curvature)
    turned = math.atan2(aside, ahead) + side * math.pi / 2 - segment.course - segment.curvature * near
    turned -= 2 * math.pi * math.floor((turned + math.pi) / (2 * math.pi))
    error = 1 / segment.curvature - side * math.sqrt(ahead * ahead + aside * aside)
    return near + turned / segment.curvature, error


@formula
def excess(law: GuidanceLaw, state: PathState, pose: POSE, sense: int) -> tuple[float, PathState]:
    """Compute σ(φ − φ_d) − h, which is zero at a flip, and find the place nearest to the pivot.

    The way comes before the reference: a robot that has reached its end may be found on it again.
    """
    way, leg, along, moved = law.way, state.leg, state.along, 0
    if leg == SEGMENTS:
        value, there = _excess_on_path(law, state, pose, sense)
        if there.step > law.target or (there.step == law.target and there.share >= 0):
            return value, there
        leg, along, moved = SEGMENTS - 1, way[SEGMENTS - 1].length, -1
    back = law.rod - law.offset
    x, y = pose[0] - back * math.cos(pose[2]), pose[1] - back * math.sin(pose[2])
    sideways, current_x, current_y = law.drift
    course = pose[2] + float(slip(sideways, current_x, current_y, pose[2]))
    while True:
        segment = way[leg]
        along, error = project(segment, x, y, along)
        if along > segment.length and moved >= 0:
            leg, along, moved = leg + 1, 0.0, 1
            if leg == SEGMENTS:
                at_target = placed(state, step=law.target, share=state.share, leg=leg, along=along, error=error)
                return _excess_on_path(law, at_target, pose, sense)
        elif along < 0 and leg > 0 and moved <= 0:
            leg, along, moved = leg - 1, way[leg - 1].length, -1
        else:
            break
    wanted = segment.course + segment.curvature * along - math.atan(error / law.way_ahead)
    there = placed(state, step=law.target, share=state.share, leg=leg, along=along, error=error)
    return sense * (course - wanted) - segment.hysteresis, there


@formula
def excess_after(
    law: GuidanceLaw, state: PathState, pose: POSE, sense: int, before: float, time: float
) -> tuple[float, PathState]:
    """Compute σ(φ − φ_d) − h after `time` in a dwell that began at `pose`."""
    return excess(law, state, pose_after(law, pose, sense, before, time), sense)


@formula
def has_ended(law: GuidanceLaw, state: PathState) -> bool:
    """Tell whether the path ends at a place."""
    return not law.around and state.leg == SEGMENTS and state.step >= law.last and state.share >= 1


@formula
def integrate(law: GuidanceLaw, state: PathState, pose: POSE, sense: int) -> PathState:
    """Add the mean error of the last two dwells to the integral; errors at flips alternate."""
    _, there = excess(law, state, pose, sense)
    reached = law.arc[there.step]
    mean, advance = (there.error + there.last_error) / 2, reached - there.reached
    bias = min(max(there.bias + mean * advance / (2 * law.ahead * law.ahead), -MOST_BIAS), MOST_BIAS)
    return PathState(there.step, there.share, there.leg, there.along, there.error, there.error, bias, reached)


@formula
def approach(
    law: GuidanceLaw, state: PathState, pose: POSE, sense: int, before: float, time: float
) -> tuple[float, float, PathState]:
    """Move the place with the robot from `pose`, where the dwell began, nearly until `time`.

    The nearest step is sought from the last one. Seen from across a circle another step may be nearer, so the
    place moves in turns of at most LARGEST_TURN.

    Returns:
        When to look next, `time` or an earlier one at which the path has ended; when it had not yet ended; and
        where the robot is then.
    """
    rate = abs(law.twist[side_of(sense)][2])
    count, low = math.ceil(time * rate / LARGEST_TURN), 0.0
    for n in range(1, count):
        high = n * (time / count)
        _, state = excess_after(law, state, pose, sense, before, high)
        if has_ended(law, state):
            return high, low, state
        low = high
    return time, low, state


@formula
def next_dwell(
    law: GuidanceLaw, state: PathState, pose: POSE, sense: int, before: float, elapsed: float
) -> NextFlip:
    """Compute the length of the dwell that began at `pose`, and whether the path ends in it.

    The last dwell is trimmed. If it were too short for the motor, it is the shortest one or none at all, whichever
    ends nearer to the path's end.
    """
    flip = _next_flip(law, state, pose, sense, before, elapsed)
    if flip.ended and flip.time < law.dwell and not math.isnan(before):
        return NextFlip(law.dwell if 2 * flip.time > law.dwell else 0.0, True, False, flip.state)
    return flip


@formula
def _next_flip(
    law: GuidanceLaw, state: PathState, pose: POSE, sense: int, before: float, elapsed: float
) -> NextFlip:
    """Find the first time at which the law asks for a flip, or the path ends."""
    rate = abs(law.twist[side_of(sense)][2])
    furthest, longest, largest = state.step, TURNS / rate, LARGEST_STEP / rate
    time, low, state = approach(law, state, pose, sense, before, max(law.dwell, elapsed))
    value, state = excess_after(law, state, pose, sense, before, time)
    low_value, slope = 1.0, rate  # above zero: there has been no evaluation before
    for _ in range(MOST_LOOKS):
        if has_ended(law, state):
            return _end(law, state, pose, sense, before, low, time)
        if value >= 0 and (low_value > 0 or value < EXACT):
            return NextFlip(time, False, False, state)
        if value >= 0:  # between two evaluations
            return _root(law, state, pose, sense, before, low, low_value, time, value)
        if -value < EXACT:
            return NextFlip(time, False, False, state)
        low, low_value = time, value
        time += min(-1.02 * value / max(slope, 0.1 * rate), largest)
        if time > longest:
            if state.step <= furthest:
                break
            furthest, longest = state.step, longest + TURNS / rate  # its circles lead along the path
        value, state = excess_after(law, state, pose, sense, before, time)
        slope = (value - low_value) / (time - low)
    return NextFlip(time, False, True, state)


@formula
def _root(
    law: GuidanceLaw,
    state: PathState,
    pose: POSE,
    sense: int,
    before: float,
    a: float,
    fa: float,
    b: float,
    fb: float,
) -> NextFlip:
    """Find the root between a value fa < 0 and a value fb > 0, by regula falsi (Illinois)."""
    time = b
    for _ in range(HALVINGS):
        time = a - fa * (b - a) / (fb - fa)
        value, state = excess_after(law, state, pose, sense, before, time)
        if abs(value) < EXACT:
            break
        if value < 0:
            a, fa, fb = time, value, fb / 2
        else:
            b, fb, fa = time, value, fa / 2
    return NextFlip(time, False, False, state)


@formula
def _end(
    law: GuidanceLaw, state: PathState, pose: POSE, sense: int, before: float, low: float, high: float
) -> NextFlip:
    """Find the time at which the path ends, by bisection between a time before its end and one after it."""
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        _, state = excess_after(law, state, pose, sense, before, middle)
        if has_ended(law, state):
            high = middle
        else:
            low = middle
    return NextFlip(high, True, False, state)


class FollowState(NamedTuple):
    """A schedule that is being made: where the robot is, and what has become of it."""

    pose: POSE
    sense: int
    before: float
    state: PathState
    furthest: int = 0  # step that was reached
    stalled: float = 0.0  # time since then
    done: int = 0  # dwells that the last call has written
    ended: bool = False
    lost: bool = False  # the robot turns in circles


@compiled
def follow_dwells(
    law: GuidanceLaw, start: FollowState, patience: float, dwells: Floats, poses: Floats
) -> FollowState:
    """Write dwells (n,) and the poses after them (n, 3), until the path ends or the robot does not get ahead.

    Args:
        law: what is followed.
        start: where to go on.
        patience: time that may pass without progress along the path.
        dwells: written to.
        poses: written to.
    """
    pose, sense, before, state, furthest, stalled = (
        start.pose,
        start.sense,
        start.before,
        start.state,
        start.furthest,
        start.stalled,
    )
    done = 0
    for _ in range(len(dwells)):
        flip = next_dwell(law, state, pose, sense, before, 0.0)
        state = flip.state
        if flip.lost:
            return FollowState(pose, sense, before, state, furthest, stalled, done, False, True)
        if flip.time > 0:
            pose = pose_after(law, pose, sense, before, flip.time)
            state = integrate(law, state, pose, sense)
            dwells[done] = flip.time
            for i, value in enumerate(pose):
                poses[done, i] = value
            done, sense, before = done + 1, -sense, flip.time
        if flip.ended:
            return FollowState(pose, sense, before, state, furthest, stalled, done, True, False)
        stalled = 0.0 if state.step > furthest else stalled + flip.time
        furthest = max(furthest, state.step)
        if stalled > patience:
            break
    return FollowState(pose, sense, before, state, furthest, stalled, done, False, False)
