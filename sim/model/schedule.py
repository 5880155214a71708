"""A schedule: when the motor flips, for which robot, from which pose. Plans contain one; replays need one.

The planner writes a schedule into plan.json and reads it again, and the simulator replays it. Both check the file
here: its format, finite numbers, the speed of its motor, and its id, a digest of the content.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from common.arrays import Floats
from common.errors import InputError
from common.keywords import checks_keywords
from common.reading import digest_of, expecting, read_json

if TYPE_CHECKING:
    import pandas as pd

    from sim.model.robot import Robot

FORMAT = 2
PLAN_FILE = "a plan.json of the planner"
_ID = re.compile("p[0-9a-f]{11}")  # ids of older versions have another form
FASTEST = 1e4  # ω̄ above which the file is taken for edited


@dataclass(frozen=True)
class Schedule:
    """Dwell times between flips of the motor, for one robot.

    Attributes:
        robot: dimensionless groups by column name; ω̄ is a magnitude.
        first_direction: of the motor, +1 or −1.
        dwells: times between flips, (M,), in units of μ0 l⁴/EI.
        start: x, y [l] and heading [rad] of the head's centre.
        time_scale: the unit of time in seconds.

    Raises:
        InputError: a direction, dwell, pose or time scale is not possible.

    Example:
        >>> import numpy as np
        >>> from softflagella import Schedule, load_robot
        >>> robot = load_robot("paper-control")
        >>> groups = robot.group_values()
        >>> float(Schedule(groups, 1, np.array([0.8, 1.2]), (0.0, 0.0, 0.0), robot.time_scale).dwells.sum())
        2.0
    """

    robot: Mapping[str, float]  # dimensionless groups and sizes of effects
    first_direction: int  # of the motor, +1 or −1
    dwells: Floats  # (M,) [μ0 l⁴/EI]
    start: tuple[float, float, float]  # x, y [l] and heading [rad] of the head's centre
    time_scale: float  # μ0 l⁴/EI [s]
    tail_length: float | None = None  # l [m]; without it tracks are in l alone
    plan_id: str | None = None  # of the plan that it is of, for its tracks

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
        if self.tail_length is not None and not (np.isfinite(self.tail_length) and self.tail_length > 0):
            raise InputError(f"tail_length_m = {self.tail_length}; it must be a finite number above 0")

    def swum_by(self, robot: Robot) -> Schedule:
        """Return the schedule as another robot carries it out, in its units: seconds and metres stay.

        Raises:
            InputError: the schedule has no tail length.
        """
        if self.tail_length is None:
            raise InputError("the schedule has no tail length that another robot could use; plan it again")
        time, length = self.time_scale / robot.time_scale, self.tail_length / robot.tail_length
        x, y, heading = self.start
        return replace(
            self, robot=robot.group_values(), dwells=self.dwells * time, start=(x * length, y * length, heading),
            time_scale=robot.time_scale, tail_length=robot.tail_length,
        )  # fmt: skip

    def in_own_units(self, track: pd.DataFrame) -> pd.DataFrame:
        """Return the track of a robot that has carried it out with times and lengths in this schedule's units."""
        if self.tail_length is None:
            return track
        cm = 100 * self.tail_length
        return track.assign(
            time_bar=track["time_s"] / self.time_scale, x_over_l=track["x_cm"] / cm, y_over_l=track["y_cm"] / cm
        )


@checks_keywords
def load_schedule(path: str | Path) -> Schedule:
    """Load the schedule in a plan.json.

    Raises:
        InputError: the file is not a plan.

    Example:
        >>> import tempfile
        >>> from softflagella import circle, load_robot, load_schedule, plan, write_plan
        >>> result = plan(circle(2.0), load_robot("paper-control"))
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     same = load_schedule(write_plan(result, folder)[0])
        >>> bool((same.dwells == result.dwells).all())
        True
    """
    content = read_plan_file(path)
    with expecting(PLAN_FILE, path, "plan again"):
        if "vehicle" in content["robot"]:
            raise InputError(f"{path} is the plan of a measured vehicle; only robots can be simulated")
        schedule = Schedule(
            robot={str(k): float(v) for k, v in content["robot"]["groups"].items()},
            first_direction=content["first_direction"],
            dwells=np.asarray(content["dwell_bar"], dtype=float),
            start=tuple(float(content["start"][k]) for k in ("x_over_l", "y_over_l", "heading_rad")),  # type: ignore[arg-type]
            time_scale=float(content["robot"]["time_scale_s"]),
            tail_length=None if (length := content["robot"].get("tail_length_m")) is None else float(length),
            plan_id=str(content["id"]),
        )
    return schedule


def read_plan_file(path: str | Path) -> dict[str, Any]:
    """Read the content of a plan.json.

    Raises:
        InputError: the file cannot be read, is no plan.json of this format, has a number that is not finite, a
            motor speed that cannot be, or an id that is not that of its content.
    """
    if Path(path, "plan.json").is_file():
        raise InputError(f"{path} is the folder of a plan; give {Path(path, 'plan.json')}")
    with expecting(PLAN_FILE, path, "plan again"):
        content = read_json(path, parse_constant=_finite, parse_float=_finite)
    check_format(content, path)
    found = plan_id(content)
    if content.setdefault("id", found) != found and _ID.fullmatch(str(content["id"])):
        raise InputError(
            f"{path} was edited or damaged after it was written: the id of its content is {found}, not "
            f"{content['id']}; plan again, or delete the id to read the file as it is"
        )
    return dict(content)


def plan_id(content: Mapping[str, Any]) -> str:
    """Return the `id` of the content of a plan.json: a digest of all the rest but the version of the code."""
    rest = {name: value for name, value in content.items() if name not in ("id", "code_version")}
    return f"p{digest_of(json.dumps(rest))}"  # a letter first: no reader of plan.csv takes it for a number


def check_format(content: Any, name: str | Path) -> None:
    """Check the format of a plan.json, and the speed of its motor; `name` is that of the file in messages.

    Raises:
        InputError: it is no plan.json of this format, or has a motor speed that cannot be.
    """
    with expecting(PLAN_FILE, name, "plan again"):
        if content["format"] != FORMAT:
            raise InputError(f"{name} has format {content['format']}, this version reads {FORMAT}: plan again")
        robot = content["robot"]
        if "vehicle" not in robot and not 0 < abs(float(robot["groups"]["omega_bar"])) <= FASTEST:
            raise InputError(f"omega_bar is not between 0 and {FASTEST:g}; plan again")


def _finite(text: str) -> float:
    value = float(text)
    if not math.isfinite(value):
        raise ValueError(f"{text} is no finite number")
    return value
