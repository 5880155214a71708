"""Replay of any switching schedule: the robot's track in the lab, simulated.

A schedule is the motor's first direction and the dwell times between flips. The robot starts from rest
with straight tails at the schedule's start pose; each dwell is an integer number of equal steps.
Track of the head's centre, seen from above; lengths in l, time in μ0 l⁴/EI and seconds.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
import torch
from numpy.typing import NDArray

from sim import planar
from sim.balance import assemble
from sim.errors import InputError
from sim.resolution import Resolution, time_step
from sim.robot import Groups
from sim.stepper import YAW, State, X, Y, at_rest, step

_SAMPLES = 12  # track points a dwell, at most


@dataclass(frozen=True)
class Schedule:
    """What the motor does, for which robot."""

    robot: dict[str, float]  # dimensionless groups by column name; ω̄ is a magnitude
    first_direction: int  # +1 or −1
    dwells: NDArray[np.float64]  # (M,), in time units
    start: tuple[float, float, float]  # x, y [l], heading [rad] of the head's centre
    time_scale: float  # seconds a time unit

    def __post_init__(self) -> None:
        if self.first_direction not in (-1, 1):
            raise InputError(f"first_direction = {self.first_direction}; it must be 1 or -1")
        if not len(self.dwells):
            raise InputError("the schedule has no dwell times; give at least one")
        if not np.isfinite(self.dwells).all() or (self.dwells <= 0).any():
            raise InputError("the schedule has a dwell time that is not a positive number; mend it")


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
    except (TypeError, ValueError, AttributeError) as wrong:
        raise InputError(f"{path}: {wrong}; give a plan.json of the planner") from None


def replay(
    schedules: Sequence[Schedule],
    *,
    resolution: Resolution | None = None,
    progress: Callable[[int], object] | None = None,
) -> list[pd.DataFrame]:
    """Simulate schedules, those of equal N side by side.

    Args:
        schedules: any robots; equal N run as one batch.
        resolution: mesh and step; default `Resolution.fitting`.
        progress: called with the number of dwells done, counted over all schedules.

    Returns:
        A track for each schedule: time_bar, time_s, x_over_l, y_over_l, heading_rad, direction,
        dwell (index of the dwell that ends at or after the sample).
    """
    tracks: list[pd.DataFrame | None] = [None] * len(schedules)
    for count in sorted({int(s.robot["N"]) for s in schedules}):
        places = [i for i, s in enumerate(schedules) if int(s.robot["N"]) == count]
        done = _replay_batch([schedules[i] for i in places], resolution, progress)
        for place, track in zip(places, done, strict=True):
            tracks[place] = track
    return [track for track in tracks if track is not None]


def _replay_batch(
    schedules: list[Schedule],
    resolution: Resolution | None,
    progress: Callable[[int], object] | None,
) -> list[pd.DataFrame]:
    names = sorted({name for s in schedules for name in s.robot})
    groups = Groups.from_columns(
        {k: np.array([s.robot.get(k, 1.0 if k == "a_over_R" else 0.0) for s in schedules]) for k in names}
    )
    speed = groups.omega_bar.abs()
    chosen = resolution or Resolution.fitting(float(speed.max()))
    swimmer = assemble(groups, edges=chosen.edges)
    state = at_rest(swimmer)
    direction = torch.tensor([float(s.first_direction) for s in schedules], dtype=torch.float64)
    alive = torch.arange(len(schedules))
    samples: list[list[tuple[float, ...]]] = [[(0.0, 0.0, 0.0, 0.0, d, 0)] for d in direction.tolist()]
    for index in range(max(len(s.dwells) for s in schedules)):
        keep = [k for k, i in enumerate(alive.tolist()) if index < len(schedules[i].dwells)]
        if len(keep) < len(alive):
            lanes = torch.tensor(keep)
            alive, state, swimmer = alive[lanes], state.select(lanes), swimmer.select(lanes)
        dwell = torch.tensor([schedules[i].dwells[index] for i in alive.tolist()], dtype=torch.float64)
        omega = direction[alive] * speed[alive] * (-1.0) ** index
        limit = time_step(omega, chosen)
        count = max(1, math.ceil(float((dwell / limit).max()) - 1e-9))
        stride = max(1, count // _SAMPLES)
        if index:
            state = state.flipped()
        for i in range(1, count + 1):
            state = step(swimmer, state, omega, dwell / count)
            if i % stride == 0 or i == count:
                _sample(samples, alive, state, torch.sign(omega), index)
        if bool(state.failed.any()):
            raise InputError(f"the simulation failed in dwell {index + 1} of the schedule; a finer step may help")
        if progress is not None:
            progress(len(alive))
    return [_track(s, rows) for s, rows in zip(schedules, samples, strict=True)]


def _sample(
    samples: list[list[tuple[float, ...]]],
    alive: torch.Tensor,
    state: State,
    direction: torch.Tensor,
    index: int,
) -> None:
    table = torch.stack([state.time, *state.pose[[X, Y, YAW]], direction]).T.tolist()
    for lane, row in zip(alive.tolist(), table, strict=True):
        samples[lane].append((*row, index))


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
