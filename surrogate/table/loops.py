"""What a query asks of its compiled loops: motions in balance, their novelty, gaps, flips, and intervals.

Robots are packed as in `surrogate.wrench.heads.pack_robots`, (M, 39). Outputs are those of
`surrogate.table.errors.OUTPUTS`, (12, M): eight of the steady motion, then four of the response to a flip.
Not np.isfinite: it asks whether x − x = 0, which is always so where sums may be reordered.
"""

from __future__ import annotations

import numpy as np

from sim.arrays import Flags, Floats, Integers
from surrogate.networks.loops import BLOCK, Layers, evaluate, inner, kernel, product
from surrogate.table.errors import ITSELF, ONE, SPEED, SURGE
from surrogate.table.intervals import HALVED, PARTS
from surrogate.table.response_table import OF_HEAD, SMALL_SURGE
from surrogate.table.support import FAST_YAW, INSIDE, MAX_YAW_SHARE, NO_MOTION, NO_RESPONSE, NOVEL, SupportNumbers
from surrogate.table.wrench_table import SPREAD, TINY_SPREAD
from surrogate.wrench.balance import inputs_at, network_inputs_at, solve
from surrogate.wrench.heads import HEAD_LENGTH, HEAD_NUMBERS, SENSE

_END = 1.02  # of half an input's range
_INPUTS, _OUTPUTS, _FLIP = 7, 12, 8  # inputs of the tails, all outputs, and the place of the first of a flip
_YAW_RATE, _V_X, _V_Z = 2, 3, 4  # among the outputs
_FLIP_INPUTS = _INPUTS + len(OF_HEAD) + 2
_FEATURES = _INPUTS + 4  # that widths of intervals depend on
_CLIPPED = 5.0  # standard deviations of a feature


@inner
def _novelty(support: SupportNumbers, inputs: Floats, novelty: Floats) -> None:
    """Write `Support.novelty` at inputs (M, F) of a block to novelty (M,)."""
    count, size = inputs.shape
    terms = len(support.inverse)
    features, solved = np.empty((count, terms)), np.empty((count, terms))
    x = (inputs - support.shift) / support.scale
    for k in range(count):
        features[k, 0] = 1.0
        for p in range(1, terms):
            features[k, p] = features[k, support.products[0, p]] * x[k, support.products[1, p]]
    product(support.inverse, np.zeros(terms), features, solved, True)
    for k in range(count):
        total, away = 0.0, 0.0
        for p in range(terms):
            total += solved[k, p] * solved[k, p]
        for i in range(size):
            away = max(away, abs(x[k, i]))
        novelty[k] = max(total, away) if away > _END else total


@kernel
def novelty_of(shift: Floats, scale: Floats, inverse: Floats, products: Integers, inputs: Floats) -> Floats:
    """Return `Support.novelty` at inputs (M, F), (M,)."""
    novelty = np.empty(len(inputs))
    for begin in range(0, len(inputs), BLOCK):
        end = begin + BLOCK
        _novelty(SupportNumbers(shift, scale, inverse, products), inputs[begin:end], novelty[begin:end])
    return novelty


@kernel
def motions_of(
    w0: Floats, w1: Floats, w2: Floats, w3: Floats, w4: Floats, w5: Floats, g0: Floats, g1: Floats, g2: Floats,
    g3: Floats, g4: Floats, g5: Floats, shift: Floats, scale: Floats, inverse: Floats, products: Integers,
    limits: Floats, groups: Floats, robots: Floats,
) -> tuple[Floats, Floats, Floats, Integers, Floats]:  # fmt: skip
    """Solve for the motions of robots whose tails have one network.

    Args:
        w0 to w5: `Layers` of the tails' wrench.
        g0 to g5: those of the gap.
        shift, scale, inverse, products: `SupportNumbers`.
        limits, groups: least and greatest size of each of `surrogate.input_ranges.ROBOT` (2, 9), and the robots'
            (M, 9).
        robots: packed.

    Returns:
        Motions (M, 5), `surrogate.wrench.tails.INPUTS` (M, 7), what widths depend on (M, 11) without a spread of
        members, why a robot is outside, one of `surrogate.table.support` (M,), and outputs, NaN of a flip.
    """
    network, gap = Layers(w0, w1, w2, w3, w4, w5), Layers(g0, g1, g2, g3, g4, g5)
    support, count = SupportNumbers(shift, scale, inverse, products), len(robots)
    motion, found = solve(network, robots)
    inputs, outputs = np.empty((count, _INPUTS)), np.full((_OUTPUTS, count), np.nan)
    features, outside = np.empty((count, _FEATURES)), np.empty(count, dtype=np.int64)
    own, of_gap, share = np.empty((BLOCK, len(shift))), np.empty((BLOCK, 8)), np.empty((BLOCK, 2))
    novelty = np.empty(BLOCK)
    for begin in range(0, count, BLOCK):
        end = min(begin + BLOCK, count)
        for k in range(end - begin):
            tail = robots[begin + k, HEAD_NUMBERS:]
            network_inputs_at(tail, motion[begin + k], own[k])
            inputs_at(tail, motion[begin + k], inputs[begin + k])
            of_gap[k, :7], of_gap[k, 7] = inputs[begin + k], np.log(tail[4])
        _novelty(support, own[: end - begin], novelty)
        evaluate(gap, of_gap[: end - begin], share[: end - begin])
        for k in range(end - begin):
            row = begin + k
            _put_outputs(robots[row], motion[row], share[k, 0], outputs[:, row])
            features[row, :_INPUTS] = inputs[row]
            features[row, _INPUTS], features[row, SPREAD] = np.log(novelty[k] + 1e-12), np.log(TINY_SPREAD)
            features[row, SPREAD + 1], features[row, SPREAD + 2] = of_gap[k, 7], 1.0 if of_gap[k, 7] == 0 else 0.0
            for i in range(_FEATURES):
                value = features[row, i]
                features[row, i] = 0.0 if np.isnan(value) else min(max(value, -1e300), 1e300)
            within = found[row]
            for i in range(groups.shape[1]):
                within = within and limits[0, i] <= abs(groups[row, i]) <= limits[1, i]
            fast = abs(motion[row, 2]) > MAX_YAW_SHARE * abs(motion[row, 4])
            outside[row] = FAST_YAW if fast else INSIDE
            if not within:
                outside[row] = NO_MOTION
            elif not novelty[k] <= 1:
                outside[row] = NOVEL
    return motion, inputs, features, outside, outputs


@inner
def _put_outputs(robot: Floats, motion: Floats, share: float, outputs: Floats) -> None:
    """Write STEADY_OUTPUTS for a gap that is this share of the distance of the clamps."""
    sense, tail = robot[SENSE], robot[HEAD_NUMBERS:]
    sway, surge, yaw = motion[0] + motion[2] * robot[HEAD_LENGTH] / 2, motion[1], motion[2]
    outputs[0], outputs[1], outputs[_YAW_RATE] = sense * motion[4], sense * motion[3], sense * yaw
    outputs[_V_X], outputs[_V_Z], outputs[5] = sense * sway, surge, np.hypot(sway, surge) / abs(yaw)
    outputs[6] = np.degrees(np.arctan2(abs(sway), surge))
    outputs[7] = share * tail[2] * np.sin(np.pi / tail[4]) / tail[3] if tail[4] > 1 else np.inf


@inner
def _put_flip_inputs(robot: Floats, motion: Floats, inputs: Floats, x: Floats, speeds: Floats) -> None:
    """Write the inputs of the networks of a flip (15,), and what their curves are multiplied by (3,)."""
    tail = robot[HEAD_NUMBERS:]
    x[:_INPUTS] = inputs
    for i, place in enumerate(OF_HEAD):
        x[_INPUTS + i] = tail[6 + place]
    x[_FLIP_INPUTS - 2], x[_FLIP_INPUTS - 1] = np.log(tail[4]), 1.0 if tail[4] == 2 else 0.0
    sway = motion[0] + motion[2] * robot[HEAD_LENGTH] / 2
    speeds[0], speeds[1], speeds[2] = np.hypot(motion[1], SMALL_SURGE * sway), sway, motion[2]


@kernel
def flip_inputs_of(robots: Floats, motion: Floats, inputs: Floats) -> tuple[Floats, Floats]:
    """Return inputs of the networks of a flip (M, 15), and (w, v_x, ω_yr) of the head's centre (M, 3)."""
    x, speeds = np.empty((len(robots), _FLIP_INPUTS)), np.empty((len(robots), 3))
    for row in range(len(robots)):
        _put_flip_inputs(robots[row], motion[row], inputs[row], x[row], speeds[row])
    return x, speeds


@kernel
def put_flips(
    l0: Floats, l1: Floats, l2: Floats, l3: Floats, l4: Floats, l5: Floats, m0: Floats, m1: Floats, m2: Floats,
    m3: Floats, m4: Floats, m5: Floats, mean: Floats, vectors: Floats, components: int, knots: Floats,
    robots: Floats, motion: Floats, inputs: Floats, dwells: Floats, outside: Integers, outputs: Floats,
) -> None:  # fmt: skip
    """Write the response to flips with equal dwells, and mark robots whose response was not learned.

    A lag between the dwells of its curve is cubic in ln T̄ through four knots, and constant after the last one.

    Args:
        l0 to l5, m0 to m5: `Layers` of the lag and of the memory.
        mean, vectors: of lag and memory at equal dwells, (D 3,) and (C, D 3).
        components: number of vectors of the lag, which come first.
        knots: ln T̄ of the curves, (D,).
        robots, motion, inputs: of M robots, see `motions_of`.
        dwells: (M,).
        outside, outputs: written to.
    """
    lag, memory = Layers(l0, l1, l2, l3, l4, l5), Layers(m0, m1, m2, m3, m4, m5)
    x, of_lag = np.empty((BLOCK, _FLIP_INPUTS)), np.empty((BLOCK, lag.rest.shape[1]))
    speeds, of_memory, near = np.empty((BLOCK, 3)), np.empty((BLOCK, memory.rest.shape[1])), np.empty(12)
    own = np.empty(3)
    for begin in range(0, len(robots), BLOCK):
        count = min(BLOCK, len(robots) - begin)
        for k in range(count):
            _put_flip_inputs(robots[begin + k], motion[begin + k], inputs[begin + k], x[k], speeds[k])
        evaluate(lag, x[:count], of_lag[:count])
        evaluate(memory, x[:count], of_memory[:count])
        for k in range(count):
            row = begin + k
            place = min(np.log(dwells[row]), knots[-1])
            first = min(max(np.searchsorted(knots, place) - 2, 0), len(knots) - 4)
            near[:] = mean[3 * first : 3 * first + 12]
            for c in range(len(vectors)):
                size = of_lag[k, c] if c < components else of_memory[k, c - components]
                for i in range(12):
                    near[i] += size * vectors[c, 3 * first + i]
            own[:] = 0.0
            for i in range(4):
                weight = 1.0
                for j in range(4):
                    if j != i:
                        weight *= (place - knots[first + j]) / (knots[first + i] - knots[first + j])
                for axis in range(3):
                    own[axis] += weight * near[3 * i + axis] * speeds[k, axis]
            outputs[_FLIP, row] = _net_speed(own, motion[row, 1], speeds[k, 1], speeds[k, 2], dwells[row])
            outputs[_FLIP + 1, row], outputs[_FLIP + 2, row], outputs[_FLIP + 3, row] = own[2], own[1], own[0]
            if outside[row] == INSIDE and not abs(own.sum()) < np.inf:
                outside[row] = NO_RESPONSE


@inner
def _net_speed(lag: Floats, surge: float, sway: float, yaw: float, dwell: float) -> float:
    """Return `sim.mechanics.planar.net_speed` of a lag (3,) and a twist (surge, sway, yaw).

    A dwell and its mirror image, p + Rot(ψ) M p, are 2 |p · (cos ψ/2, sin ψ/2)|; on an arc p is a chord.
    """
    half, turn = yaw * dwell / 2, lag[2] / 2
    chord = dwell * np.sin(half) / half if half != 0 else dwell
    along = chord * (surge * np.cos(turn) - sway * np.sin(turn))
    return abs(lag[0] * np.cos(turn + half) + lag[1] * np.sin(turn + half) + along) / dwell


@inner
def _put_design(features: Floats, shift: Floats, scale: Floats, x: Floats, design: Floats) -> None:
    """Write 1, x and all products of two, (P,), for features as x (F,), held to five standard deviations."""
    count, place = len(x), 1 + len(x)
    design[0] = 1.0
    for i in range(count):
        x[i] = min(max((features[i] - shift[i]) / scale[i], -_CLIPPED), _CLIPPED)
        design[1 + i] = x[i]
    for i in range(count):
        for j in range(i, count):
            design[place] = x[i] * x[j]
            place += 1


@kernel
def designs_of(features: Floats, shift: Floats, scale: Floats) -> Floats:
    """Return the terms of the logarithm of a local width, (M, P), for features (M, F)."""
    count, size = features.shape
    designs, x = np.empty((count, 1 + size + size * (size + 1) // 2)), np.empty(size)
    for row in range(count):
        _put_design(features[row], shift, scale, x, designs[row])
    return designs


@kernel
def intervals_of(
    shift: Floats, scale: Floats, weights: Floats, bounds: Floats, middle: Floats, factors: Floats,
    kinds: Integers, places: Integers, features: Floats, couples: Flags, outputs: Floats,
) -> tuple[Floats, Floats, Integers]:  # fmt: skip
    """Return the ends of intervals, (O, M) each, and the part of each robot, (M,).

    Args:
        shift, scale, weights, bounds, middle, factors: as in `surrogate.table.intervals`, stacked over O outputs.
        kinds: what errors are relative to, (O,).
        places: of these among the outputs, (O,).
        features: (M, F).
        couples: (M,).
        outputs: their intervals have no width where they are not finite.
    """
    count, size = features.shape
    low, high = np.empty((len(places), count)), np.empty((len(places), count))
    parts, design, x = np.empty(count, dtype=np.int64), np.empty(weights.shape[1]), np.empty(size)
    for row in range(count):
        own, part = features[row], 0
        for i, feature in enumerate(HALVED):
            part += int(own[feature] > middle[i]) << i
        part = PARTS - 1 if own[size - 1] > 0.5 else part
        parts[row] = part
        _put_design(own, shift, scale, x, design)
        for o in range(len(places)):
            value, total = outputs[places[o], row], 0.0
            for p in range(len(design)):
                total += weights[o, p] * design[p]
            half = factors[o, part + PARTS * int(couples[row])]
            half *= np.exp(min(max(total, bounds[0, o]), bounds[1, o]))
            if kinds[o] == ITSELF:
                half *= abs(value)
            elif kinds[o] == SPEED:
                half *= np.hypot(outputs[_V_X, row], outputs[_V_Z, row])
            elif kinds[o] != ONE:
                half *= abs(outputs[_V_Z if kinds[o] == SURGE else _YAW_RATE, row])
            half = half if abs(value) < np.inf else 0.0
            low[o, row], high[o, row] = value - half, value + half
    return low, high, parts
