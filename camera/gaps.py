"""Gaps in a track: times without a new pose, and how far the robot turned meanwhile.

A heading is known up to whole turns. Across a gap in which the robot may turn by more than a quarter of a turn,
the yaw rates before and after it must predict the same number of turns; otherwise that number is unknown.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from camera.correlation import correlation_time
from common.arrays import Floats

_LONG = 5.0  # median times between poses; a longer time is told
_LEAST = 0.05  # share of the whole time; what is less is not told
_CLEAR = 2.0  # median times between poses; after a longer time the rate may be needed
_QUARTER = math.pi / 2
_SURE = 3.0  # standard errors of a rate
_FREE = 4  # degrees of freedom that the scatter of headings needs


def seen_poses(
    time: Floats, poses: Floats, least: float = 0.0, *, share: float = _LEAST
) -> tuple[NDArray[np.bool_], list[str]]:
    """Tell which poses are new, and say for how long there are none.

    Args:
        time: in s (m,), in order.
        poses: (m, 3).
        least: a shorter time is not told [s].
        share: of the whole time; if all such times together are less, they are not told, and no pose is left out.

    Returns:
        False for a pose that a frozen camera repeats (m,); lines such as "no pose for 150 s (12 % of the time)".
    """
    new = np.r_[True, (np.diff(poses, axis=0) != 0).any(axis=1)]
    starts = np.flatnonzero(new)
    ends = np.r_[starts[1:], len(time)] - 1
    typical, whole = _median_step(np.diff(time[starts])), np.ptp(time)
    missing, held = np.diff(time) - typical, time[ends] - time[starts]
    long = max(_LONG * typical, least)
    frozen = held > long
    totals = {"no pose": missing[missing > long].sum(), "the same pose": held[frozen].sum()}
    told = {words: total for words, total in totals.items() if total > share * whole}
    kept = new | ~np.repeat(frozen, ends - starts + 1) | ("the same pose" not in told)
    lines = [
        f"{words} for {total:.{0 if total >= 10 else 1}f} s ({100 * total / whole:.0f} % of the time)"
        for words, total in told.items()
    ]
    return kept, lines


def unwrapped(time: Floats, heading: Floats) -> tuple[Floats, slice]:
    """Return headings without jumps [rad] (m,), and the longest stretch in which the number of turns is known."""
    turns, steps = np.unwrap(heading), np.diff(time)
    gaps = steps > _CLEAR * _median_step(steps)
    rate, error = _rate(time, turns, np.r_[0, np.cumsum(gaps)])
    long = np.flatnonzero(gaps & (steps * (abs(rate) + _SURE * error) > _QUARTER)) + 1
    parts = [slice(*ends) for ends in zip([0, *long], [*long, len(time)], strict=True)]
    rates = [_rate(time[part], turns[part], np.zeros(len(time[part]), dtype=int)) for part in parts]
    unknown = [0]
    for start, (before, error_before), (after, error_after) in zip(long, rates, rates[1:], strict=False):
        gap = steps[start - 1]
        jump = turns[start] - turns[start - 1]
        expected = gap * (before + after) / 2
        missing = math.tau * round((expected - jump) / math.tau)
        turns[start:] += missing
        doubt = gap * (abs(after - before) + _SURE * math.hypot(error_before, error_after)) / 2
        if not max(doubt, abs(expected - jump - missing)) < _QUARTER:
            unknown.append(int(start))
    stretches = [slice(*ends) for ends in zip(unknown, [*unknown[1:], len(time)], strict=True)]
    return turns, max(stretches, key=lambda stretch: stretch.stop - stretch.start)


def _median_step(steps: Floats) -> float:
    """Return the median of the times between poses that are above 0; infinity where none is."""
    return float(np.median(steps[steps > 0])) if (steps > 0).any() else math.inf


def _rate(time: Floats, heading: Floats, part: NDArray[np.intp]) -> tuple[float, float]:
    """Fit one yaw rate to all parts of a track, each with a zero of its own; return it and its standard error."""
    count = np.bincount(part)
    spread, turn = (v - (np.bincount(part, v) / count)[part] for v in (time, heading))
    free, size = len(time) - len(count) - 1, float(spread @ spread)
    if free < _FREE or not size > 0:
        return 0.0, math.inf
    rate = float(spread @ turn) / size
    residual = turn - rate * spread
    return rate, math.sqrt(float(residual @ residual) / free * correlation_time(residual) / size)
