"""Replay of any switching schedule: the robot's track in the lab, simulated.

A schedule is the motor's first direction and the dwell times between flips. The robot starts from rest
with straight tails at the schedule's start pose; dwells end where a step ends.
Track of the head's centre, seen from above; lengths in l, time in μ0 l⁴/EI and seconds.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from sim.arrays import Floats
from sim.inputs import check_columns
from sim.io.errors import InputError
from sim.mechanics import planar
from sim.model.groups import Groups
from sim.motion.resolution import MOST_REPLAY_WORK, Resolution
from sim.motion.run import Run
from sim.solve.assembly import bodies
from sim.solve.march import YAW, X, Y

_SAMPLES = 12  # track points a dwell, at most


@dataclass(frozen=True)
class Schedule:
    """What the motor does, for which robot."""

    robot: dict[str, float]  # dimensionless groups by column name; ω̄ is a magnitude
    first_direction: int  # +1 or −1
    dwells: Floats  # (M,), in time units
    start: tuple[float, float, float]  # x, y [l], heading [rad] of the head's centre
    time_scale: float  # seconds a time unit

    def __post_init__(self) -> None:
        if self.first_direction not in (-1, 1):
            raise InputError(f"first_direction = {self.first_direction}; it must be 1 or -1")
        if not len(self.dwells):
            raise InputError("the schedule has no dwell times; give at least one")
        if not np.isfinite(self.dwells).all() or (self.dwells <= 0).any():
            raise InputError("the schedule has a dwell time that is not a positive number; mend it")
        if not np.isfinite(self.start).all():
            raise InputError(f"the schedule starts at {self.start}; give finite numbers")
        if not (np.isfinite(self.time_scale) and self.time_scale > 0):
            raise InputError(f"time_scale_s = {self.time_scale}; it must be a finite number above 0")


def load_schedule(path: str | Path) -> Schedule:
    """The schedule in a plan.json."""
    try:
        content = json.loads(Path(path).read_text())
        return Schedule(
            robot={str(k): float(v) for k, v in content["robot"]["groups"].items()},
            first_direction=int(content["first_direction"]),
            dwells=np.asarray(content["dwell_bar"], dtype=float),
            start=tuple(float(content["start"][k]) for k in ("x_over_l", "y_over_l", "heading_rad")),  # type: ignore[arg-type]
            time_scale=float(content["robot"]["time_scale_s"]),
        )
    except (json.JSONDecodeError, UnicodeDecodeError) as broken:
        raise InputError(f"{path} is not JSON: {broken}; give a plan.json of the planner") from None
    except KeyError as missing:
        raise InputError(f"{path} has no entry {missing}; give a plan.json of the planner") from None
    except (TypeError, ValueError, AttributeError, OverflowError) as wrong:
        raise InputError(f"{path}: {wrong}; give a plan.json of the planner") from None


def replay(
    schedules: Sequence[Schedule],
    *,
    resolution: Resolution | None = None,
    progress: Callable[[int], object] | None = None,
) -> list[pd.DataFrame]:
    """Simulate schedules, one after the other.

    Args:
        schedules: any robots.
        resolution: mesh and step; default `Resolution.for_tracks`.
        progress: called with the number of dwells done, counted over all schedules.

    Returns:
        A track for each schedule: time_bar, time_s, x_over_l, y_over_l, heading_rad, direction,
        dwell (index of the dwell that ends at or after the sample).
    """
    return [_replay(schedule, resolution, progress) for schedule in schedules]


def _replay(
    schedule: Schedule, resolution: Resolution | None, progress: Callable[[int], object] | None
) -> pd.DataFrame:
    values = check_columns({name: np.array([value]) for name, value in schedule.robot.items()})
    groups = Groups.from_columns(values)
    body = bodies(groups)[0]
    body = body._replace(omega=schedule.first_direction * abs(body.omega))
    chosen = resolution or Resolution.for_tracks(body.omega)
    run = Run(body, groups.N, chosen, most_work=MOST_REPLAY_WORK)
    if not run.can_afford(float(schedule.dwells.sum()), flips=len(schedule.dwells)):
        raise InputError(
            f"the schedule asks for more time steps than a replay may take ({len(schedule.dwells)} dwells, "
            f"{schedule.dwells.sum():g} time units, omega_bar = {body.omega:g}); shorten it or slow the motor down"
        )
    direction, time = schedule.first_direction, 0.0
    rows: list[tuple[float, ...]] = [(0.0, 0.0, 0.0, 0.0, direction, 0)]
    for index, dwell in enumerate(schedule.dwells.tolist()):
        if index:
            run.flip()
            direction = -direction
        times, poses = run.go(dwell)
        if run.failed:
            raise InputError(f"the simulation failed in dwell {index + 1} of the schedule; a finer step may help")
        count = len(poses)
        stride = max(1, count // _SAMPLES)
        for i in range(1, count + 1):
            if i % stride == 0 or i == count:
                x, y, yaw = poses[i - 1, [X, Y, YAW]].tolist()
                rows.append((time + times[i - 1], x, y, yaw, direction, index))
        time += dwell
        if progress is not None:
            progress(1)
    return _track(schedule, rows)


@np.errstate(over="ignore")  # seconds of an absurd time scale
def _track(schedule: Schedule, rows: list[tuple[float, ...]]) -> pd.DataFrame:
    table = np.array(rows)
    pose = planar.compose(np.array(schedule.start), table[:, 1:4])
    return pd.DataFrame(
        {
            "time_bar": table[:, 0],
            "time_s": table[:, 0] * schedule.time_scale,
            "x_over_l": pose[:, 0],
            "y_over_l": pose[:, 1],
            "heading_rad": pose[:, 2],
            "direction": table[:, 4].astype(int),
            "dwell": table[:, 5].astype(int),
        }
    )
