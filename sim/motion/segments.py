"""A schedule in segments that are simulated side by side, in lanes (`sim.lanes`) and in threads.

A robot soon forgets its past, but for its pose and the phase of its disc. So each segment starts some dwells
early, from rest, and its changes of the pose are composed. That the past is forgotten is not assumed: the last
early dwell must move the robot as the same dwell does at the end of the segment before. Where it does not, because
the phase matters or the memory is long, the segment is simulated once more, from the shape and the phase that the
segment before has found. Where that does not help, dwells are simulated in order.

Where a schedule is cut depends on the schedule alone, so its track does not depend on the number of threads. With
one tail the phase matters so much that passes do not pay.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from common.arrays import Floats
from sim.lanes import width
from sim.mechanics import planar
from sim.motion.run import SteppedRobot, copied, steps_for, steps_in, times_of
from sim.solve.march import PHASE, YAW, Marcher, State, X, Y, joined, side_by_side
from sim.threads import in_threads

_FEWEST, _AT_ONCE = 32, 1024  # dwells that are cut, and dwells of which memory holds all steps
_DWELLS, _MULTIPLE = 24, 16  # of a segment; of the number of segments, so that lanes are full
_LEAST_EARLY, _MEMORY = 3, 3.0  # dwells, time units
_SAME, _SAME_PHASE = 1e-6, 1e-4  # l and rad in a dwell; of the disc, in rad
_LEAST_GAIN = 30.0  # of a pass: how many times less segments must differ
_MOST_PASSES = 4
_PLACE = [X, Y, YAW]
_IN_ORDER = "the motion depends on the past for long: dwells are simulated in order"

Dwells = Sequence[Sequence[float]]  # durations of the parts of each dwell


class Spell(NamedTuple):
    """A part of a dwell, at constant motor speed."""

    times: Floats  # of its steps, (K,), from its start
    poses: Floats  # (K, 6)
    end: State


class _Segment(NamedTuple):
    """Some dwells, simulated from a state before some early ones."""

    first: int  # dwell
    end: int  # dwell after the last one
    early: int
    start: State
    dwells: Sequence[list[Spell]] = ()  # with early ones, up to where the simulation failed

    def covers(self, dwell: int) -> bool:
        """Tell whether it was simulated up to the start of a dwell."""
        return len(self.dwells) >= dwell - self.first + self.early

    def before(self, dwell: int) -> State:
        """Return the state before a dwell."""
        index = dwell - self.first + self.early
        return self.dwells[index - 1][-1].end if index else self.start


def simulate_segments(
    run: SteppedRobot, dwells: Dwells, progress: Callable[[int], object], *, exact: bool = False
) -> Iterator[list[Spell]]:
    """Simulate a schedule; yield the parts of each dwell, in order, up to one that fails.

    Args:
        run: at rest, with its motor in the schedule's first direction.
        dwells: of the schedule.
        progress: called with the number of dwells done since the last call.
        exact: shapes and the phase of the disc are wanted, too.
    """
    run, state, told, cut = run.copy(), copied(run.state), 0, True

    def tell(count: int) -> None:
        nonlocal told
        told += count
        progress(count)

    for begin, end in pairwise(_cuts(np.ones(len(dwells)), -(-len(dwells) // _AT_ONCE))):
        done, long = begin, end - begin >= _FEWEST
        for segment in _agreeing(run, dwells, begin, end, state, exact, tell) if cut and long else ():
            base, start = state.pose, segment.before(segment.first).pose
            for dwell in segment.dwells[segment.early :]:
                parts = [
                    part._replace(poses=_onto(base, _change(start, part.poses), part.poses)) for part in dwell
                ]
                parts = [part._replace(end=part.end._replace(pose=part.poses[-1])) for part in parts]
                done, state = done + 1, parts[-1].end
                tell(int(done > told))
                yield parts
        cut = cut and (done == end or not long)
        for index in range(done, end):
            (alone,) = _simulated(run, dwells, [_Segment(index, index + 1, 0, state)])
            if not alone.covers(index + 1):
                return
            state = alone.before(index + 1)
            tell(int(index >= told))
            yield alone.dwells[0]


def _agreeing(
    run: SteppedRobot,
    dwells: Dwells,
    begin: int,
    end: int,
    state: State,
    exact: bool,
    tell: Callable[[int], object],
) -> list[_Segment]:
    """Simulate dwells from a state in segments; return those up to the first that fails or does not agree.

    With `exact` the phase of the disc must be right, too, even if the robot moves alike at any phase.
    """
    steps = np.array([sum(steps_in(part, run.time_step) for part in parts) for parts in dwells[begin:end]])
    count = _MULTIPLE * max(1, round(len(steps) / _MULTIPLE / _DWELLS))
    segments: list[_Segment] = []
    for low, high in pairwise(_cuts(steps, count if len(steps) >= 6 * count else count // 2)):
        first, last, early = begin + low, begin + high, 0
        time = 0.0
        while segments and early < first - begin and (early < _LEAST_EARLY or time < _MEMORY):
            early += 1
            time += sum(dwells[first - early])
        segments.append(_Segment(first, last, early, run.state if segments else state))
    # With one tail the phase matters too much; early dwells that begin before the last segment have no partner.
    too_short = (a.first - a.early < b.first - b.early for b, a in pairwise(segments))
    if run.state.x.shape[1] == 1 or any(too_short):
        print(f"{_IN_ORDER}, which takes longer", file=sys.stderr)
        return []
    todo, largest = list(range(len(segments))), float(np.inf)
    for number in range(_MOST_PASSES):
        groups = [todo[i : i + width()] for i in range(0, len(todo), width())]
        tasks = [[segments[k] for k in group] for group in groups]
        done = in_threads(lambda task: _simulated(run, dwells, task), tasks)
        for group, simulated in zip(groups, done, strict=True):
            for k, segment in zip(group, simulated, strict=True):
                segments[k] = segment
                tell(0 if number else (segment.end - segment.first) // 2)
        judged = _misfits(segments)
        # Once a segment has to be simulated again, it is from a shape and a phase, so the phase must be right.
        exact = exact or any(apart >= _SAME for apart, _ in judged)
        todo = [
            k for k, (apart, off) in enumerate(judged, 1) if apart >= _SAME or (exact and abs(off) >= _SAME_PHASE)
        ]
        previous, largest = largest, max((apart for apart, _ in judged), default=0.0)
        # Phases are handed on from segment to segment; a pass that does not bring them nearer will not end.
        if not todo or largest > max(previous / _LEAST_GAIN, _SAME):
            break
        for k in todo:
            before, later = segments[k - 1 : k + 1]
            start = copied(before.before(later.first - later.early))
            start.pose[PHASE] += judged[k - 2][1] if k > 1 else 0.0
            segments[k] = later._replace(start=start)
    if todo:
        print(f"{_IN_ORDER} from dwell {segments[todo[0]].first + 1} on, which takes longer", file=sys.stderr)
    # What follows a wrong segment begins in a wrong state, even where its own seam agrees.
    good = segments[: todo[0]] if todo else segments
    whole = [segment.covers(segment.end) for segment in good]
    return good[: whole.index(False)] if False in whole else good


def _cuts(weights: Floats, count: int) -> list[int]:
    """Cut a row into parts of about equal weight: indices from 0 to its end, (count + 1,)."""
    sums = np.append(0.0, np.cumsum(weights))
    return np.abs(sums[:, None] - np.linspace(0.0, sums[-1], count + 1)).argmin(0).tolist()


def _misfits(segments: Sequence[_Segment]) -> list[tuple[float, float]]:
    """Compare each segment but the first with the one before, up to one that failed.

    Returns:
        How differently they move in the last dwell that they share, infinite where the later one failed there, and
        how far the disc of the later one is behind at its first dwell.
    """
    misfits, phase = [], segments[0].start.pose[PHASE]
    for before, later in pairwise(segments):
        if not before.covers(before.end):
            break
        phase += before.before(before.end).pose[PHASE] - before.before(before.first).pose[PHASE]
        apart, off = np.inf, 0.0
        if later.covers(later.first):
            moves = [
                _change(one.before(later.first - 1).pose, one.before(later.first).pose[None])[0, _PLACE]
                for one in (before, later)
            ]
            apart, off = (
                float(np.abs(moves[0] - moves[1]).max()),
                float(phase - later.before(later.first).pose[PHASE]),
            )
        misfits.append((apart, off))
    return misfits


def _change(start: Floats, poses: Floats) -> Floats:
    """Return the changes from a pose (6,) to others (K, 6): place and heading as seen from it."""
    change = poses - start
    change[:, _PLACE] = planar.between(start[_PLACE], poses[:, _PLACE])
    return change


def _onto(start: Floats, change: Floats, found: Floats) -> Floats:
    """Return the poses (K, 6) that changes lead to from a pose (6,); phases stay as found, with the shapes."""
    poses = start + change
    poses[:, _PLACE], poses[:, PHASE] = planar.compose(start[_PLACE], change[:, _PLACE]), found[:, PHASE]
    return poses


def _simulated(run: SteppedRobot, dwells: Dwells, segments: Sequence[_Segment]) -> list[_Segment]:
    """Simulate segments side by side, each in its lane."""
    plans, swims = [], []
    for segment in segments:
        begin = segment.first - segment.early
        plan = [[(steps_for(part, run.time_step, i == 0), part) for i, part in enumerate(dwell)]
                for dwell in dwells[begin : segment.end]]  # fmt: skip
        for dwell in plan:
            dwell[0][0].flips[0] = True
            for steps, _ in dwell:
                steps.kept[-1] = True
        bodies = (run.reverse, run.body) if begin % 2 == 0 else (run.body, run.reverse)  # before the first flip
        swims.append(
            Marcher(*bodies, copied(segment.start), joined([steps for dwell in plan for steps, _ in dwell]))
        )
        plans.append(plan)
    simulated = []
    for segment, plan, done in zip(segments, plans, side_by_side(swims), strict=True):
        made: list[list[Spell]] = []
        first = 0
        for dwell in plan:
            made.append([])
            for steps, duration in dwell:
                last = first + len(steps.lengths)
                if last > done.done:
                    break
                end = State(*(part[sum(len(parts) for parts in made)] for part in done.kept))
                made[-1].append(Spell(times_of(steps, duration), done.poses[first:last], end))
                first = last
            if last > done.done:
                made.pop()
                break
        simulated.append(segment._replace(dwells=made))
    return simulated
