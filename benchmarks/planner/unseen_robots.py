"""Stated errors of robots and paths that the look-up table has never seen.

Robots are drawn from the domain of the shipped table as labs have them: two to five tails of 7 to 13 cm. Paths of
5 to 250 l are race tracks, fields, handwriting, coasts, polygons, circles and eights. Each plan is made as by
default, and carried out by the robot's own table, which is simulated with a tenth of the tolerance; the motion
within a revolution of the disc is added. Some that take little work are replayed in time steps, too. A stated
error must hold in 95 % of the plans, and in 90 % in each third of the robots by their novelty: the distance from
the middle of what the table has learned. The error stated with the robot's own table is that of the same schedule.

Usage: python -m benchmarks unseen_robots [PLANS] [FIRST SEED] [REPLAYS] [RECORDS]     (60, 9000 and 10)

Takes 3 seconds of processor time a plan, and 5 a replay.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np

from benchmarks.common import Records, as_they_end, heading, per_cent, row, two_quantiles
from common.errors import InputError
from sim.motion.replay import replay, replay_error
from sim.motion.warm import compile_once
from surrogate.table_file import load
from tests.oracles.unseen_robots import KINDS, LONG, carried
from tracking.tracks import tracking_error

_LITTLE = 1e5  # radians that tails turn in a replay
_NOVELTY = 7  # its place in `NeuralTable.width_features`


class PlanOutcome(NamedTuple):
    """A plan and what became of it; lengths in l."""

    seed: int
    tails: int
    kind: str  # of the path
    flips: int
    length: float  # of the path as drawn
    novelty: float
    predicted: float  # largest distance that the plan predicts
    stated: float
    own: float  # largest distance, by the table of the robot itself
    own_stated: float  # stated error of the same schedule with that table
    replayed: float  # largest distance in time steps; NaN: not replayed
    replay_error: float  # of the simulator itself


def outcome(seed: int, in_time_steps: bool) -> PlanOutcome | str:
    """Plan and carry out one seed; or say why there is no plan."""
    lookup = load()
    try:
        kind, result, own_stated, found = carried(seed, lookup)
    except InputError as refused:
        return f"{seed}: {refused}"
    schedule = result.schedule()
    columns = {name: np.array([value]) for name, value in schedule.robot.items()}
    features = lookup.width_features(lookup.solve(columns))
    replayed = error = float("nan")
    if in_time_steps and schedule.dwells.sum() * schedule.robot["omega_bar"] * schedule.robot["N"] < _LITTLE:
        track = replay(schedule)
        replayed, error = tracking_error(result.to_dict(), track).largest, replay_error(schedule, track)
    return PlanOutcome(
        seed, int(schedule.robot["N"]), kind, len(result.dwells), result.drawn.length,
        float(features[0, _NOVELTY]), result.predicted_max, result.stated_error, found, own_stated, replayed,
        error,
    )  # fmt: skip


def line(name: str, some: list[PlanOutcome], found: Callable[[PlanOutcome], float]) -> str:
    """Format the figures of a class of plans."""
    held = sum(found(one) <= one.stated for one in some)
    ratio = np.median([one.stated / found(one) for one in some])
    own_ratio = np.median([one.own_stated / found(one) for one in some])
    values = [two_quantiles(part) for part in (
        [one.predicted for one in some], [one.stated for one in some], [found(one) for one in some],
        [one.own_stated for one in some],
    )]  # fmt: skip
    return row(name, len(some), per_cent(held, len(some)), f"{ratio:.2f}", f"{own_ratio:.2f}", *values)


def classes(plans: list[PlanOutcome]) -> Iterator[tuple[str, list[PlanOutcome]]]:
    """Yield classes of plans by name: all, by tails, length, kind of path and novelty."""
    yield "all", plans
    for tails in sorted({one.tails for one in plans}):
        yield f"N = {tails}", [one for one in plans if one.tails == tails]
    yield from thirds(plans, "paths", lambda one: one.length, ("shortest", "middle", "longest"))
    yield f"paths of more than {LONG:g} l", [one for one in plans if one.length > LONG]
    for kind in KINDS:
        yield kind, [one for one in plans if one.kind == kind]
    yield from thirds(plans, "robots", lambda one: one.novelty, ("least novel", "middle", "most novel"))


def thirds(
    plans: list[PlanOutcome], what: str, key: Callable[[PlanOutcome], float], names: tuple[str, str, str]
) -> Iterator[tuple[str, list[PlanOutcome]]]:
    """Yield the thirds of the plans ordered by a key."""
    ordered = sorted(plans, key=key)
    for k, name in enumerate(names):
        some = ordered[len(ordered) * k // 3 : len(ordered) * (k + 1) // 3]
        ends = f", {key(some[0]):.0f} to {key(some[-1]):.0f} l" if some and what == "paths" else ""
        yield f"{name} {what}{ends}", some


def main(count: str = "60", first: str = "9000", replays: str = "10", file: str = "") -> None:
    compile_once()
    records = Records(file)
    seeds = range(int(first), int(first) + int(count))
    cases = [(seed, index < int(replays)) for index, seed in enumerate(seeds) if seed not in records]
    for result in as_they_end(outcome, cases):
        if isinstance(result, str):
            print(result, flush=True)
        else:
            records.add(result._asdict())
    plans = [PlanOutcome(**record) for record in records.all]
    print(heading("carried out by the robot's own table", "plans", "held", "stated / found",
                  "the same with the own table", "predicted: median / 95 %", "stated", "found",
                  "stated with the own table"))  # fmt: skip
    for name, some in classes(plans):
        if some:
            print(line(name, some, lambda one: one.own))
    simulated = [one for one in plans if np.isfinite(one.replayed)]
    if simulated:
        for name, some in classes(simulated):
            if some:
                print(line(f"replayed in time steps: {name}", some, lambda one: one.replayed))
        print(f"the simulator's own error of a track: {np.median([one.replay_error for one in simulated]):.4f} l "
              f"at the median, {max(one.replay_error for one in simulated):.4f} l at most")  # fmt: skip
    for one in sorted((one for one in plans if one.own > one.stated), key=lambda one: one.seed):
        print(f"not held: seed {one.seed}, N = {one.tails}, {one.kind}, {one.flips} dwells, {one.own:.3f} l, "
              f"stated {one.stated:.3f} l")  # fmt: skip
