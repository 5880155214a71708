"""A query as one compiled loop over robots: from their groups to outputs, widths of intervals and reasons.

The steps are those of `surrogate.table.lookup`: head and tails (`surrogate.wrench.heads`), motion in balance
(`surrogate.wrench.balance`), domain (`surrogate.table.support`), outputs (`surrogate.table.wrench_table`), lag at
equal dwells (`surrogate.table.response_table`), half-widths (`surrogate.table.intervals`). A single robot takes
about as long as one of many, since nothing is done array by array. Units: l, μ0 l⁴/EI, EI/l².
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from sim.arrays import Floats, Integers
from sim.compiling import compiled, formula
from sim.mechanics.drag import head_resistance, tail_coefficients
from sim.model.groups import LEAST_SLENDERNESS, MOST_TAILS
from sim.model.response import DWELLS
from sim.object_code import COUNT, FLOATS, INTEGERS, array_at, kept
from surrogate.input_ranges import ROBOT
from surrogate.networks.compiled import evaluate
from surrogate.table.errors import ITSELF, ONE, OUTPUTS, SCALES, SPEED, SURGE
from surrogate.table.flat_table import (
    CURVES,
    DESIGN,
    FEATURES,
    GAP,
    LAG,
    MEMORY,
    NETWORK,
    PRODUCTS,
    RANGES,
    SINGLE_PRODUCTS,
    SUPPORT,
    WIDTHS,
    WRENCH,
)
from surrogate.table.intervals import PARTS
from surrogate.table.support import monomial_count, novelty_at, support_room
from surrogate.wrench.balance import MATRICES, SINGLE, inputs_at, network_inputs_at, solve
from surrogate.wrench.heads import HEAD_LENGTH, HEAD_NUMBERS, RESISTANCE, ROBOT_NUMBERS, SENSE, YAW_COUPLE
from surrogate.wrench.tails import INPUTS, SINGLE_INPUTS, inputs_of_head

GROUPS = len(ROBOT)  # in the order of ROBOT
MOTION, INPUT, NOVELTY, REASON, STEADY, RESPONSE, HALF = 0, 5, 12, 13, 14, 22, 26  # rows of the answer
ANSWERS = HALF + len(OUTPUTS)
WITH_DWELL, WITH_WIDTHS, ASSEMBLED = 1, 2, 4  # what is wanted; whether the robots are given as heads and tails
INSIDE, NOT_LEARNED, NO_MOTION, STRANGE, QUICK, IMPOSSIBLE = range(6)  # reasons
BRANCHES = 0.6  # |ω_yr/ω_t| from which a robot may have several motions
_C_T, _C_R, _C_YR, _LENGTH, _HEAD, _SLENDERNESS, _SPEED, _NUMBER, _OFFSET = range(GROUPS)
_KNOTS = len(DWELLS)
_SHORTEST, _LONGEST = float(DWELLS[0]) * (1 - 1e-9), float(DWELLS[-1])
_POINTS = 3 * _KNOTS  # of a lag curve
_SMALL_SURGE = 0.1  # of v_x
WIDTH_FEATURES = 11
_TERMS, _SINGLE_TERMS = monomial_count(len(INPUTS)), monomial_count(len(SINGLE_INPUTS))
_SUPPORT_ROOM = max(support_room(len(INPUTS)), support_room(len(SINGLE_INPUTS)))
_MOST = 1.7976931348623157e308
_SCALES = np.array([SCALES[name] for name in OUTPUTS])


@kept(FLOATS, INTEGERS, COUNT, COUNT, COUNT, FLOATS, FLOATS, FLOATS, COUNT, FLOATS, FLOATS, COUNT, FLOATS)
def query_rows(
    numbers: Any, places: Any, many: int, several: int, count: int, groups: Any, robots: Any, dwells: Any,
    wanted: int, answers: Any, room: Any, space: int, matrices: Any,
) -> None:  # fmt: skip
    """Write the answers (ANSWERS, M) for M robots.

    Args:
        numbers, places: `surrogate.table.flat_table.FlatTable`, so many numbers and so many places.
        groups: (GROUPS, M), the columns ROBOT.
        robots: (M, ROBOT_NUMBERS), see `surrogate.wrench.heads.pack_robots`; written to unless ASSEMBLED.
        dwells: (M,), read if WITH_DWELL.
        wanted: sum of WITH_DWELL, WITH_WIDTHS and ASSEMBLED.
        room, matrices: to work in.
    """
    table, at = array_at(numbers, many), array_at(places, several)
    group, robot = array_at(groups, (GROUPS, count)), array_at(robots, (count, ROBOT_NUMBERS))
    dwell, answer = array_at(dwells, count), array_at(answers, (ANSWERS, count))
    work, squares = array_at(room, space), array_at(matrices, (MATRICES, 4, 4))
    for row in range(count):
        if not wanted & ASSEMBLED:
            assemble(group[:, row], robot[row])
        _motion(table, at, group[:, row], robot[row], answer[:, row], work, squares)
        _steady(table, at, robot[row], answer[:, row], work)
        if wanted & WITH_DWELL:
            _response(table, at, robot[row], dwell[row], answer[:, row], work)
        if wanted & WITH_WIDTHS:
            _half_widths(table, at, robot[row], answer[:, row], work)


@compiled
def _possible(group: Floats) -> bool:
    """Tell whether `sim.model.groups.checked_values` would take the groups of a robot."""
    for i in range(GROUPS):
        if not np.isfinite(group[i]):
            return False
    count = group[_NUMBER]
    positive = group[_C_T] > 0 and group[_C_R] > 0 and group[_LENGTH] > 0 and group[_HEAD] > 0
    slender = group[_OFFSET] > 0 and group[_SLENDERNESS] > LEAST_SLENDERNESS
    tails = count == np.floor(count) and 1 <= count <= MOST_TAILS
    return positive and slender and tails and group[_SPEED] != 0


@formula
def assemble(group: Floats, robot: Floats) -> None:
    """Write head and tails of a robot without effects, as `surrogate.wrench.heads.pack_robots` packs them.

    A formula, so that its products are not reordered: the rows of a head with much drag nearly cancel.
    """
    radius = 1 / group[_LENGTH]
    length, offset, count = group[_HEAD] * radius, group[_OFFSET] * radius, group[_NUMBER]
    parallel, perp = tail_coefficients(group[_SLENDERNESS])
    rows = head_resistance(group[_C_T], group[_C_R], group[_C_YR], radius, length)
    robot[0], robot[1] = abs(group[_SPEED]), 1.0
    resistance, tail = robot[RESISTANCE:HEAD_LENGTH], robot[HEAD_NUMBERS:]
    for j in range(5):
        resistance[j], resistance[5 + j] = rows[0][j], rows[1][j]
        resistance[10 + j], resistance[15 + j] = rows[2][j], rows[3][j]
    robot[HEAD_LENGTH] = length
    robot[SENSE] = 1.0 if group[_SPEED] > 0 else -1.0
    tail[0], tail[1], tail[2], tail[3] = perp, parallel, offset, 1 / group[_SLENDERNESS]
    tail[4], tail[5] = count, resistance[18]
    tail[6], tail[7], tail[8], tail[9], tail[10], tail[11], tail[12], tail[13], tail[14] = inputs_of_head(
        resistance[0], resistance[6], resistance[12], resistance[18],
        resistance[2], resistance[3], resistance[19], resistance[14], length, robot[1], count * perp, offset,
    )  # fmt: skip


@compiled
def _motion(
    table: Floats, places: Integers, group: Floats, robot: Floats, answer: Floats, room: Floats, matrices: Floats
) -> None:
    """Write the motion, the inputs of the networks, the novelty, and why the robot is outside."""
    possible = _possible(group)
    kind = int(min(group[_NUMBER], 3.0)) - 1 if possible else 0
    sizes = places[WRENCH + NETWORK * kind : WRENCH + NETWORK * (kind + 1)]
    motion, x = room[:5], room[5 : 5 + sizes[1]]
    work, solution = room[5 + SINGLE : 5 + SINGLE + _SUPPORT_ROOM], room[5 + SINGLE + _SUPPORT_ROOM :]
    novelty, reason = 0.0, NOT_LEARNED
    for i in range(5):
        motion[i] = np.nan
    converged = False
    if possible and sizes[0] >= 0:
        converged = solve(table, sizes, robot, motion, solution, matrices)
    at = places[SUPPORT + kind]
    if sizes[0] >= 0 and at >= 0:
        network_inputs_at(robot[HEAD_NUMBERS:], motion, x)
        novelty = novelty_at(table[at : at + support_numbers(kind)], products_at(places, kind), x, work)
        reason = judged(table, places, group, motion, novelty, converged)
    if not possible:
        reason = IMPOSSIBLE
    for i in range(5):
        answer[MOTION + i] = motion[i]
    inputs_at(robot[HEAD_NUMBERS:], motion, answer[INPUT : INPUT + 7])
    answer[NOVELTY], answer[REASON] = novelty, reason


@compiled
def support_numbers(kind: int) -> int:
    """Return how many numbers the support of one of the classes of tails has."""
    if kind == 0:
        return 2 * SINGLE + 1 + _SINGLE_TERMS * _SINGLE_TERMS
    return 2 * len(INPUTS) + 1 + _TERMS * _TERMS


@compiled
def products_at(places: Integers, kind: int) -> Integers:
    """Return the monomials of the support of one of the classes of tails."""
    if kind == 0:
        return places[SINGLE_PRODUCTS : SINGLE_PRODUCTS + 2 * _SINGLE_TERMS]
    return places[PRODUCTS : PRODUCTS + 2 * _TERMS]


@compiled
def judged(table: Floats, places: Integers, group: Floats, motion: Floats, novelty: float, converged: bool) -> int:
    """Return why a robot whose number of tails was learned is outside."""
    if not (converged and _within(table, places, group)):
        return NO_MOTION
    if not novelty <= 1:
        return STRANGE
    if abs(motion[2]) > BRANCHES * abs(motion[4]):
        return QUICK
    return INSIDE


@compiled
def _within(table: Floats, places: Integers, group: Floats) -> bool:
    """Tell whether tails and motor speed are within the learned ranges; heads may be any."""
    ranges = table[places[RANGES] : places[RANGES] + 8]
    values = (abs(group[_SPEED]), abs(group[_LENGTH]), abs(group[_SLENDERNESS]), abs(group[_OFFSET]))
    within = True
    for i in range(4):
        within = within and ranges[2 * i] * (1 - 1e-9) <= values[i] <= ranges[2 * i + 1] * (1 + 1e-9)
    return within


@compiled
def _steady(table: Floats, places: Integers, robot: Floats, answer: Floats, room: Floats) -> None:
    """Write STEADY_OUTPUTS."""
    x, share, work = room[:8], room[8:9], room[9:]
    for i in range(7):
        x[i] = answer[INPUT + i]
    x[7] = np.log(robot[HEAD_NUMBERS + 4])
    evaluate(table, places[GAP : GAP + NETWORK], x, share, work)
    put_steady(robot, answer, share[0])


@compiled
def put_steady(robot: Floats, answer: Floats, share: float) -> None:
    """Write STEADY_OUTPUTS for a gap that is this share of the clamps' distance."""
    sense, number = robot[SENSE], robot[HEAD_NUMBERS + 4]
    yaw, surge = sense * answer[MOTION + 2], answer[MOTION + 1]
    sway = sense * (answer[MOTION] + answer[MOTION + 2] * robot[HEAD_LENGTH] / 2)
    answer[STEADY], answer[STEADY + 1] = sense * answer[MOTION + 4], sense * answer[MOTION + 3]
    answer[STEADY + 2], answer[STEADY + 3], answer[STEADY + 4] = yaw, sway, surge
    answer[STEADY + 5] = np.hypot(sway, surge) / abs(yaw)
    answer[STEADY + 6] = np.arctan2(abs(sway), surge) * (180 / math.pi)
    clamps = 2 * robot[HEAD_NUMBERS + 2] * np.sin(math.pi / max(number, 2.0))
    answer[STEADY + 7] = share * clamps / (2 * robot[HEAD_NUMBERS + 3]) if number > 1 else np.inf


@compiled
def _response(table: Floats, places: Integers, robot: Floats, dwell: float, answer: Floats, room: Floats) -> None:
    """Write net speed and lag at equal dwells, in the order of RESPONSE_OUTPUTS."""
    components, shifts = places[LAG + 2], places[MEMORY + 2]
    x, terms = room[:15], room[22 : 22 + components + shifts]
    work = room[22 + components + shifts :]
    response_inputs(robot, answer, x)
    evaluate(table, places[LAG : LAG + NETWORK], x, terms[:components], work)
    evaluate(table, places[MEMORY : MEMORY + NETWORK], x, terms[components:], work)
    put_response(table, places, robot, dwell, answer, terms, room[15:22])


@compiled
def response_inputs(robot: Floats, answer: Floats, x: Floats) -> None:
    """Write the inputs of the response's networks to x (15,)."""
    number, tail = robot[HEAD_NUMBERS + 4], robot[HEAD_NUMBERS:]
    for i in range(7):
        x[i] = answer[INPUT + i]
    for i in range(4):
        x[7 + i] = tail[6 + i]
    x[11], x[12] = tail[11], tail[12]
    x[13] = np.log(number)
    x[14] = 1.0 if number == 2 else 0.0


@compiled
def put_response(
    table: Floats, places: Integers, robot: Floats, dwell: float, answer: Floats, terms: Floats, room: Floats
) -> None:
    """Write net speed and lag for the networks' terms (C,)."""
    components, shifts = places[LAG + 2], places[MEMORY + 2]
    lag, weights = room[:3], room[3:7]
    knots = table[places[CURVES] : places[CURVES] + _KNOTS]
    mean = table[places[CURVES] + _KNOTS : places[CURVES] + _KNOTS + _POINTS]
    vectors = places[CURVES] + _KNOTS + _POINTS
    first = _weights(knots, np.log(min(dwell, _LONGEST)), weights)
    yaw, surge = answer[MOTION + 2], answer[MOTION + 1]
    sway = answer[MOTION] + yaw * robot[HEAD_LENGTH] / 2
    for axis in range(3):
        lag[axis] = 0.0
        for i in range(4):
            point = 3 * (first + i) + axis
            curve = mean[point]
            for k in range(components + shifts):
                curve += terms[k] * table[vectors + k * _POINTS + point]
            lag[axis] += weights[i] * curve
    lag[0] *= np.hypot(surge, _SMALL_SURGE * sway)
    lag[1] *= sway
    lag[2] *= yaw
    answer[RESPONSE] = _net_speed(surge, sway, yaw, lag, dwell)
    answer[RESPONSE + 1], answer[RESPONSE + 2], answer[RESPONSE + 3] = lag[2], lag[1], lag[0]


@compiled
def _weights(knots: Floats, place: float, weights: Floats) -> int:
    """Write the weights of a cubic through four knots at a place; return the first of these knots."""
    first = 0
    while first < len(knots) and knots[first] < place:
        first += 1
    first = min(max(first - 2, 0), len(knots) - 4)
    for i in range(4):
        weights[i] = 1.0
        for j in range(4):
            if j != i:
                weights[i] *= (place - knots[first + j]) / (knots[first + i] - knots[first + j])
    return first


@compiled
def _net_speed(surge: float, sway: float, yaw: float, lag: Floats, dwell: float) -> float:
    """Return `sim.mechanics.planar.net_speed` of a steady twist, a lag (3,) and a dwell."""
    angle = yaw * dwell
    half = angle / 2
    along = dwell * _sinc(angle)
    across = dwell * _sinc(half) * np.sin(half)
    forward, left = along * surge - across * sway, across * surge + along * sway
    c, s, heading = np.cos(lag[2]), np.sin(lag[2]), lag[2] + angle
    x, y = lag[0] + c * forward - s * left, lag[1] + s * forward + c * left
    c, s = np.cos(heading), np.sin(heading)
    return np.hypot(x + c * x + s * y, y + s * x - c * y) / (2 * dwell)


@compiled
def _sinc(angle: float) -> float:
    """Return sin(angle)/angle."""
    return np.sin(angle) / angle if angle != 0 else 1.0


@compiled
def _half_widths(table: Floats, places: Integers, robot: Floats, answer: Floats, room: Floats) -> None:
    """Write the half-widths of the intervals of steady outputs and response; the members of a network are one."""
    features, design = room[:WIDTH_FEATURES], room[WIDTH_FEATURES : WIDTH_FEATURES + DESIGN]
    part = scaled_features(table, places, robot, answer, features)
    design[0], place = 1.0, 1 + WIDTH_FEATURES
    for i in range(WIDTH_FEATURES):
        design[1 + i] = features[i]
    for i in range(WIDTH_FEATURES):
        for j in range(i, WIDTH_FEATURES):
            design[place] = design[1 + i] * design[1 + j]
            place += 1
    for k in range(len(_SCALES)):
        begin, logarithm = places[WIDTHS + k], 0.0
        if begin >= 0:
            for i in range(DESIGN):
                logarithm += design[i] * table[begin + i]
        put_half_width(table, begin, k, answer, logarithm, part)


@compiled
def scaled_features(table: Floats, places: Integers, robot: Floats, answer: Floats, features: Floats) -> int:
    """Write the scaled features of the intervals (WIDTH_FEATURES,); return which of the factors is theirs."""
    at, number = places[FEATURES], robot[HEAD_NUMBERS + 4]
    for i in range(7):
        features[i] = _finite(answer[INPUT + i])
    features[7], features[8] = _finite(np.log(answer[NOVELTY] + 1e-12)), np.log(1e-9)
    features[9], features[10] = np.log(number), 1.0 if number == 1 else 0.0
    middle = table[at + 2 * WIDTH_FEATURES : at + 2 * WIDTH_FEATURES + 3]
    part = PARTS - 1
    if number != 1:
        part = int(features[0] > middle[0]) + 2 * int(features[3] > middle[1]) + 4 * int(features[5] > middle[2])
    for i in range(WIDTH_FEATURES):
        scaled = (features[i] - table[at + i]) / table[at + WIDTH_FEATURES + i]
        features[i] = min(max(scaled, -5.0), 5.0)
    return part + PARTS * int(robot[YAW_COUPLE] != 0)


@compiled
def put_half_width(table: Floats, begin: int, output: int, answer: Floats, logarithm: float, part: int) -> None:
    """Write the half-width of an output for its logarithm before the bounds; none if the table has none."""
    answer[HALF + output] = np.nan
    if begin >= 0:
        bounded = min(max(logarithm, table[begin + DESIGN]), table[begin + DESIGN + 1])
        speed = np.hypot(answer[STEADY + 3], answer[STEADY + 4])
        half = table[begin + DESIGN + 2 + part] * np.exp(bounded) * _scale(output, answer, speed)
        answer[HALF + output] = half if np.isfinite(answer[STEADY + output]) else 0.0


@compiled
def _finite(x: float) -> float:
    """Return `np.nan_to_num` of a number."""
    return min(max(x, -_MOST), _MOST) if x == x else 0.0


@compiled
def _scale(output: int, answer: Floats, speed: float) -> float:
    """Return what the error of an output is relative to, see `surrogate.table.errors.error_scale`."""
    kind = _SCALES[output]
    if kind == ITSELF:
        return abs(answer[STEADY + output])
    if kind == ONE:
        return 1.0
    if kind == SPEED:
        return speed
    return abs(answer[STEADY + (4 if kind == SURGE else 2)])
