"""What a query asks of its compiled loops: motions in balance, how new they are to the table, and gaps."""

from __future__ import annotations

import numpy as np

from sim.arrays import Floats, Integers
from surrogate.networks.loops import BLOCK, Layers, evaluate, inner, kernel, product
from surrogate.table.outside import FAST_YAW, INSIDE, MAX_YAW_SHARE, NO_MOTION, NOVEL
from surrogate.table.support import SupportNumbers
from surrogate.wrench.balance import inputs_at, network_inputs_at, solve
from surrogate.wrench.heads import HEAD_LENGTH, HEAD_NUMBERS, SENSE

_END = 1.02  # of half an input's range


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
    limits: Floats, sizes: Floats, robots: Floats,
) -> tuple[Floats, Floats, Floats, Integers, Floats]:  # fmt: skip
    """Solve for the motions of robots whose tails have one network.

    Args:
        w0 to w5: `Layers` of the tails' wrench.
        g0 to g5: those of the gap.
        shift, scale, inverse, products: `SupportNumbers`.
        limits, sizes: least and greatest size of some inputs (2, P), and inputs of the robots (M, P).
        robots: (M, 39), see `surrogate.wrench.heads.pack_robots`.

    Returns:
        Motions (M, 5), `surrogate.wrench.tails.INPUTS` (M, 7), the novelty (M,), why a robot is outside, one of
        `surrogate.table.outside` (M,), and STEADY_OUTPUTS (M, 8).
    """
    network, gap = Layers(w0, w1, w2, w3, w4, w5), Layers(g0, g1, g2, g3, g4, g5)
    support, count = SupportNumbers(shift, scale, inverse, products), len(robots)
    motion, found = solve(network, robots)
    inputs, novelty, outputs = np.empty((count, 7)), np.empty(count), np.empty((count, 8))
    outside = np.empty(count, dtype=np.int64)
    own, of_gap, share = np.empty((BLOCK, len(shift))), np.empty((BLOCK, 8)), np.empty((BLOCK, 2))
    for begin in range(0, count, BLOCK):
        end = min(begin + BLOCK, count)
        for k in range(end - begin):
            tail = robots[begin + k, HEAD_NUMBERS:]
            network_inputs_at(tail, motion[begin + k], own[k])
            inputs_at(tail, motion[begin + k], inputs[begin + k])
            of_gap[k, :7], of_gap[k, 7] = inputs[begin + k], np.log(tail[4])
        _novelty(support, own[: end - begin], novelty[begin:end])
        evaluate(gap, of_gap[: end - begin], share[: end - begin])
        for k in range(end - begin):
            row = begin + k
            _put_outputs(robots[row], motion[row], share[k, 0], outputs[row])
            within = found[row]
            for i in range(sizes.shape[1]):
                within = within and limits[0, i] <= abs(sizes[row, i]) <= limits[1, i]
            fast = abs(motion[row, 2]) > MAX_YAW_SHARE * abs(motion[row, 4])
            outside[row] = FAST_YAW if fast else INSIDE
            if not within:
                outside[row] = NO_MOTION
            elif not novelty[row] <= 1:
                outside[row] = NOVEL
    return motion, inputs, novelty, outside, outputs


@inner
def _put_outputs(robot: Floats, motion: Floats, share: float, outputs: Floats) -> None:
    """Write STEADY_OUTPUTS for a gap that is this share of the distance of the clamps."""
    sense, tail = robot[SENSE], robot[HEAD_NUMBERS:]
    sway, surge, yaw = motion[0] + motion[2] * robot[HEAD_LENGTH] / 2, motion[1], motion[2]
    outputs[0], outputs[1], outputs[2] = sense * motion[4], sense * motion[3], sense * yaw
    outputs[3], outputs[4], outputs[5] = sense * sway, surge, np.hypot(sway, surge) / abs(yaw)
    outputs[6] = np.degrees(np.arctan2(abs(sway), surge))
    outputs[7] = share * tail[2] * np.sin(np.pi / tail[4]) / tail[3] if tail[4] > 1 else np.inf
