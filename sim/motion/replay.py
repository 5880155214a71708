"""Replay of any switching schedule: the robot's track in the lab, simulated.

A schedule is the motor's first direction and the dwell times between flips. The robot starts from rest with
straight tails, at the schedule's start pose. Every dwell ends at the end of a time step. The track is that of the
head's centre, seen from above. Lengths are in l, times in μ0 l⁴/EI and in seconds.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from itertools import groupby
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from common.arrays import Floats
from common.errors import InputError
from sim.inputs import check_columns
from sim.mechanics import planar
from sim.model.groups import Groups
from sim.model.schedule import Schedule
from sim.motion.run import COARSER, MOST_REPLAY_WORK, Resolution, SteppedRobot
from sim.motion.segments import simulate_segments
from sim.solve.assembly import bodies
from sim.solve.march import YAW, X, Y

if TYPE_CHECKING:
    import pandas as pd

_SAMPLES = 12  # track points in a dwell, or up to twice as many where it has few steps
_NONE = np.empty(0)


class SimulatedStretch(NamedTuple):
    """A stretch of a simulated schedule."""

    run: SteppedRobot  # at the end of the stretch, until the next one is simulated
    dwell: int  # index
    direction: int  # of the motor
    times: Floats  # (K,) of the steps, from the start of the schedule
    poses: Floats  # (K, 6) after the steps, see `sim.solve.march`
    stops: bool  # it ends at a stop, else at the end of the dwell


def replay(
    schedule: Schedule,
    *,
    resolution: Resolution | None = None,
    progress: Callable[[int], object] | None = None,
) -> pd.DataFrame:
    """Simulate a schedule.

    Args:
        schedule: of any robot.
        resolution: mesh and step; default `Resolution.for_tracks`.
        progress: called after each dwell with the number of dwells done since the last call.

    Returns:
        The track: time_s, x_cm and y_cm (if the schedule has a tail length), heading_deg,
        time_bar, x_over_l, y_over_l, heading_rad, direction, dwell (index of the dwell that ends at or after the
        sample), plan_id (if the schedule is that of a plan).
    """
    return track_of(schedule, stretches(schedule, resolution=resolution, progress=progress))


def replay_error(
    schedule: Schedule, track: pd.DataFrame, *, progress: Callable[[int], object] | None = None
) -> float:
    """Estimate the error of a replayed track [l]: the largest one of its positions at the flips and at the end.

    The schedule is simulated once more, with two thirds of the edges and of the steps. Errors go as the square of
    edge and step, so that of the track is 4/5 of the difference (Richardson).

    Args:
        schedule: the schedule.
        track: its track, as `replay` gives it by default.
        progress: as for `replay`.
    """
    coarse = replay(schedule, resolution=_resolution(schedule).coarser(), progress=progress)
    ends = [part.groupby("dwell").last()[["x_over_l", "y_over_l"]].to_numpy() for part in (track, coarse)]
    return float(np.hypot(*(ends[0] - ends[1]).T).max() / (COARSER**2 - 1))


def _resolution(schedule: Schedule) -> Resolution:
    """Choose the mesh and step of a schedule's track."""
    return Resolution.for_tracks(schedule.robot["omega_bar"])


def run_at_rest(schedule: Schedule, resolution: Resolution | None = None) -> SteppedRobot:
    """Make the run of a schedule's robot, at rest, with the motor in the schedule's first direction.

    Raises:
        InputError: the robot cannot be simulated, or the schedule asks for too many time steps.
    """
    groups = Groups.from_columns(check_columns(schedule.robot))
    body, reverse = bodies(groups)[0], bodies(groups.reversed())[0]
    if body.omega * schedule.first_direction < 0:
        body, reverse = reverse, body
    chosen = resolution or _resolution(schedule)
    run = SteppedRobot(body, groups.N, chosen, reverse=reverse, most_work=MOST_REPLAY_WORK)
    if not run.can_afford(float(schedule.dwells.sum()), flips=len(schedule.dwells)):
        raise InputError(
            f"the schedule asks for more time steps than a replay may take ({len(schedule.dwells)} dwells, "
            f"{schedule.dwells.sum():g} time units, omega_bar = {body.omega:g}); shorten it or slow the motor down"
        )
    return run


def stretches(
    schedule: Schedule,
    *,
    stops: Floats = _NONE,
    resolution: Resolution | None = None,
    progress: Callable[[int], object] | None = None,
) -> Iterator[SimulatedStretch]:
    """Simulate a schedule in stretches that end at the stops, (F,) and increasing, and where dwells end.

    Raises:
        InputError: the schedule cannot be simulated.
    """
    run = run_at_rest(schedule, resolution)
    ends, now = np.cumsum(schedule.dwells), 0.0
    dwell_of_stop = np.minimum(np.searchsorted(ends, stops, side="right"), len(ends) - 1)
    spans = []
    for index, end in enumerate(ends.tolist()):
        marks = np.maximum.accumulate([now, *stops[dwell_of_stop == index], end])
        now = marks[-1]
        # A dwell of length 0 keeps its stops, and has no steps.
        spans.append(
            np.diff(marks).tolist() if now > marks[0] else [0.0] * (len(marks) - 2) + [schedule.dwells[index]]
        )
    simulated = simulate_segments(
        run,
        [[span for span in dwell if span > 0] for dwell in spans],
        progress or (lambda _: None),
        exact=len(stops) > 0,
    )
    now = 0.0
    for index, dwell in enumerate(spans):
        try:
            parts = iter(next(simulated))
        except StopIteration:
            raise InputError(
                f"the simulation failed in dwell {index + 1} of the schedule; a finer step may help"
            ) from None
        if index:
            # The flip comes before the first part: `run` is handed out with the motor as it is in the stretch.
            run.flip()
        for part, span in enumerate(dwell):
            times, poses = _NONE, np.empty((0, 6))
            if span > 0:
                times, poses, run.state = next(parts)
                run.jumped = False
            direction = schedule.first_direction * (-1) ** index
            yield SimulatedStretch(run, index, direction, now + times, poses, part < len(dwell) - 1)
            now += span


@np.errstate(over="ignore")  # seconds of an absurd time scale
def track_of(schedule: Schedule, simulated: Iterable[SimulatedStretch]) -> pd.DataFrame:
    """Tabulate the track of a schedule, see `replay`, with about 12 samples in each dwell and one at its end."""
    import pandas as pd  # slow to import, and batches of steady motions need no track

    rows = [np.array([[0.0, 0.0, 0.0, 0.0, schedule.first_direction, 0]])]
    for index, parts in groupby(simulated, lambda stretch: stretch.dwell):
        dwell = list(parts)
        times = np.concatenate([part.times for part in dwell])
        poses = np.concatenate([part.poses for part in dwell])
        step = np.arange(1, len(times) + 1)
        kept = (step % max(1, len(times) // _SAMPLES) == 0) | (step == len(times))
        said = np.broadcast_to([dwell[0].direction, index], (len(times), 2))
        rows.append(np.column_stack([times, poses[:, [X, Y, YAW]], said])[kept])
    table = np.concatenate(rows)
    pose = planar.compose(np.array(schedule.start), table[:, 1:4])
    lab = {}
    if schedule.tail_length is not None:
        cm = 100 * schedule.tail_length
        lab = {"x_cm": cm * pose[:, 0], "y_cm": cm * pose[:, 1]}
    return pd.DataFrame(
        {
            "time_s": table[:, 0] * schedule.time_scale,
            **lab,
            "heading_deg": np.degrees(pose[:, 2]),
            "time_bar": table[:, 0],
            "x_over_l": pose[:, 0],
            "y_over_l": pose[:, 1],
            "heading_rad": pose[:, 2],
            "direction": table[:, 4].astype(int),
            "dwell": table[:, 5].astype(int),
            **({} if schedule.plan_id is None else {"plan_id": schedule.plan_id}),
        }
    )
