"""The steady motion of robots from the networks of their tails: what is in balance, how novel it is, all outputs.

Robots are packed as in `surrogate.tails.pack_robots`, (M, ROBOT_NUMBERS). Outputs are those of
`surrogate.held_out.OUTPUTS`, (12, M): eight of the steady motion, then four of the response to a flip.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from common.arrays import Floats, Integers
from sim.jit import compiled_fast
from sim.linear.lane_arrays import copy
from sim.motion.steady_motion import STEADY_OUTPUTS
from surrogate.balance import inputs_at, network_inputs_at, solve
from surrogate.domain import FAST_YAW, INSIDE, MAX_YAW_SHARE, NO_MOTION, NOVEL, SupportNumbers, put_novelty
from surrogate.network import BLOCK, Ensemble, Layers, evaluate
from surrogate.tails import INPUTS, PAIR_INPUTS, PLACES, SINGLE_INPUTS

CLASSES = (1, 2, 3)  # networks for N = 1, N = 2, and three or more tails
# Of these networks; that of two tails has the latter number where it learned from few rows.
INPUT_COUNTS = ((len(SINGLE_INPUTS),), (len(PAIR_INPUTS), len(INPUTS)), (len(INPUTS),))
SPREAD, TINY_SPREAD = 8, 1e-9  # the spread of the members among what widths depend on, as a logarithm
_INPUTS, _OUTPUTS = len(INPUTS), 12
FEATURES = _INPUTS + 4  # that widths of intervals depend on
_YAW_RATE, _V_X, _V_Z = 2, 3, 4  # among the outputs


@dataclass(frozen=True)
class WrenchTable:
    """Mean wrench and gap of tails, one network for each of CLASSES."""

    wrench: tuple[Ensemble | None, ...]  # None where no robots were learned
    gap: Ensemble


@dataclass(frozen=True)
class Motions:
    """What a query works with, for M robots."""

    robots: Floats  # (M, ROBOT_NUMBERS), see `surrogate.tails.pack_robots`
    motion: Floats  # (M, 5): (v_x of J, v_z, ω_yr, ω_h, ω_t), for a positive motor
    inputs: Floats  # (M, 7) of the networks, see `surrogate.tails.network_inputs`
    features: Floats  # (M, 11): inputs, ln novelty, ln spread of the members, ln N, whether N = 1
    outside: Integers  # (M,), see `surrogate.domain`
    outputs: Floats  # OUTPUTS, (12, M); NaN of a flip before there was one

    @property
    def steady(self) -> dict[str, Floats]:
        """STEADY_OUTPUTS, (M,) each."""
        return dict(zip(STEADY_OUTPUTS, self.outputs, strict=False))


def network_index(count: Floats) -> Integers:
    """Return the index in CLASSES of robots with N tails, (M,)."""
    return np.minimum(count, CLASSES[-1]).astype(np.int64) - 1


def rows_by_network(kind: Integers) -> Iterator[tuple[int, Integers | slice]]:
    """Yield each index that is there, with its rows: all of them as a slice where there is one index only."""
    present = sorted(set(kind.tolist()))
    for k in present:
        yield k, slice(None) if len(present) == 1 else np.flatnonzero(kind == k)


@compiled_fast
def motions_of(
    network: Layers, gap: Layers, support: SupportNumbers, limits: Floats, groups: Floats, robots: Floats,
) -> tuple[Floats, Floats, Floats, Integers, Floats]:  # fmt: skip
    """Solve for the motions of robots whose tails have one network.

    Not np.isfinite: it asks whether x − x = 0, which is always so where sums may be reordered.

    Args:
        network, gap: of the tails' wrench and of the gap.
        support: where the network has learned.
        limits, groups: least and greatest size of each of `surrogate.domain.ROBOT` (2, 9), and the robots'
            (M, 9).
        robots: packed.

    Returns:
        Motions (M, 5), `surrogate.tails.INPUTS` (M, 7), what widths depend on (M, 11) without a spread of
        members, why a robot is outside, one of `surrogate.domain` (M,), and outputs, NaN of a flip.
    """
    count, (motion, found) = len(robots), solve(network, robots)
    inputs, outputs = np.empty((count, _INPUTS)), np.full((_OUTPUTS, count), np.nan)
    features, outside = np.empty((count, FEATURES)), np.empty(count, dtype=np.int64)
    own, of_gap, share = np.empty((BLOCK, len(support.shift))), np.empty((BLOCK, 8)), np.empty((BLOCK, 2))
    novelty = np.empty(BLOCK)
    for begin in range(0, count, BLOCK):
        end = min(begin + BLOCK, count)
        for k in range(end - begin):
            robot = robots[begin + k]
            network_inputs_at(robot, motion[begin + k], own[k])
            inputs_at(robot, motion[begin + k], inputs[begin + k])
            copy(of_gap[k, :7], inputs[begin + k])
            of_gap[k, 7] = np.log(robot[PLACES.number])
        put_novelty(support, own[: end - begin], novelty)
        evaluate(gap, of_gap[: end - begin], share[: end - begin])
        for k in range(end - begin):
            row = begin + k
            _put_outputs(robots[row], motion[row], share[k, 0], outputs[:, row])
            copy(features[row, :_INPUTS], inputs[row])
            features[row, _INPUTS], features[row, SPREAD] = np.log(novelty[k] + 1e-12), np.log(TINY_SPREAD)
            features[row, SPREAD + 1], features[row, SPREAD + 2] = of_gap[k, 7], 1.0 if of_gap[k, 7] == 0 else 0.0
            for i in range(FEATURES):
                value = features[row, i]
                # Widths are sums of products: an infinite feature would make them NaN even where its weight is 0.
                features[row, i] = 0.0 if np.isnan(value) else min(max(value, -1e300), 1e300)
            within = found[row]
            for i in range(groups.shape[1]):
                within = within and limits[0, i] <= abs(groups[row, i]) <= limits[1, i]
            # The last reason counts: outside the learned motions, speeds mean nothing.
            fast = abs(motion[row, 2]) > MAX_YAW_SHARE * abs(motion[row, 4])
            outside[row] = FAST_YAW if fast else INSIDE
            if not within:
                outside[row] = NO_MOTION
            elif not novelty[k] <= 1:
                outside[row] = NOVEL
    return motion, inputs, features, outside, outputs


@compiled_fast
def _put_outputs(robot: Floats, motion: Floats, share: float, outputs: Floats) -> None:
    """Write STEADY_OUTPUTS for a gap that is this share of the distance of the clamps."""
    sense, number = robot[PLACES.sense], robot[PLACES.number]
    sway, surge, yaw = motion[0] + motion[2] * robot[PLACES.head_length] / 2, motion[1], motion[2]
    outputs[0], outputs[1], outputs[_YAW_RATE] = sense * motion[4], sense * motion[3], sense * yaw
    outputs[_V_X], outputs[_V_Z], outputs[5] = sense * sway, surge, np.hypot(sway, surge) / abs(yaw)
    outputs[6] = np.degrees(np.arctan2(abs(sway), surge))
    gap = share * robot[PLACES.offset] * np.sin(np.pi / number) / robot[PLACES.radius]
    outputs[7] = gap if number > 1 else np.inf
