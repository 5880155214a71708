"""Robots of a fleet from a TOML file, and the files of their plans.

    apart = "10cm"            # least distance between bodies; or --apart
    robot = "paper-control"   # robot.toml or the name of a preset, of members without their own
    unit = "cm"               # options of the planning commands, too

    [[member]]
    path = "right.csv"        # what `softflagella plan` takes

    [[member]]
    name = "second"           # of its folder; default: robot-2
    robot = "second.toml"
    goal = [60, 20, 90]       # what `softflagella goal` takes: x, y and degrees, with start = [0, 0, 0]
    delay_s = 60              # it does not begin before

Instead of path or goal, a robot may have `places = [[0, 0], [40, 0]]` of a tour or a `region` to cover. All other
keys are options of the command for such a plan, with _ for -, except those of what it writes: out, arduino and
trade_off. Files are sought beside the TOML file first.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

from planner.files.plan_files import EXTRA, FILES, write_plan_files
from planner.jobs.fleet_plan import FleetPlan
from sim.io.errors import InputError
from sim.io.files import files_together, write_text
from sim.io.reading import read_json, read_toml

_JOBS = {"path": "plan", "goal": "goal", "places": "tour", "region": "cover"}  # key -> command
_OWN = ("robot", "name", "delay_s")
_OF_ALL = ("apart", "feedback")
_OF_NONE = ("out", "arduino", "trade_off")  # what is written for one plan alone
_MEMBERS = ("member", "robot")  # what the array of robots is called, and what it was called before
_FILES = ("robot", "path", "region", "lookup", "model", "walls", "keep_out", "hole")  # may be files
_NAME = re.compile(r"\w[\w-]*")
_WRITTEN = ("fleet.json", "fleet.svg")


class FleetRobot(NamedTuple):
    """A robot of the file."""

    name: str
    command: str  # that plans for it
    words: tuple[str, ...]  # of this command
    delay: float  # [s]


class FleetFile(NamedTuple):
    """What the file says."""

    robots: tuple[FleetRobot, ...]
    apart: str | None  # with its unit, or in the unit of all
    unit: str | None
    feedback: bool


def read_fleet(path: str | Path) -> FleetFile:
    """Read the robots of a fleet.

    Raises:
        InputError: the file cannot be read, or a robot has no plan, or several.
    """
    content = read_toml(path)
    array = next((key for key in _MEMBERS if isinstance(content.get(key), list)), _MEMBERS[0])
    entries = content.pop(array, None)
    if not (isinstance(entries, list) and entries and all(isinstance(entry, dict) for entry in entries)):
        raise InputError(f"{path}: no robots; write a table [[{_MEMBERS[0]}]] for each")
    feedback = content.get("feedback", False)
    if not isinstance(feedback, bool):
        raise InputError(f"{path}: feedback = {feedback!r}; write true or false")
    common = {key: value for key, value in content.items() if key not in _OF_ALL}
    robots = tuple(
        _robot(path, number, {**common, **({"feedback": True} if feedback else {}), **entry})
        for number, entry in enumerate(entries, 1)
    )
    names = [robot.name for robot in robots]
    for name in names:
        if names.count(name) > 1:
            raise InputError(f"{path}: two robots are named {name}; give each a name of its own")
    apart, unit = content.get("apart"), content.get("unit")
    return FleetFile(robots, None if apart is None else str(apart), None if unit is None else str(unit), feedback)


def _robot(path: str | Path, number: int, entry: Mapping[str, Any]) -> FleetRobot:
    """Read one robot."""
    name, delay = entry.get("name", f"robot-{number}"), entry.get("delay_s", 0.0)
    if not (isinstance(name, str) and _NAME.fullmatch(name)):
        raise InputError(f"{path}: name = {name!r}; a name has letters, digits, _ and -, as it names a folder")
    if isinstance(delay, bool) or not isinstance(delay, int | float):
        raise InputError(f"{path}: {name}: delay_s = {delay!r}; give seconds, 0 or more")
    for key in _OF_NONE:
        if key in entry:
            raise InputError(f"{path}: {name}: {key} is of a plan on its own, not of a fleet's; leave it out")
    jobs = [key for key in _JOBS if key in entry]
    if len(jobs) != 1 or not isinstance(entry.get("robot"), str):
        raise InputError(f"{path}: {name}: give robot, and one of {', '.join(_JOBS)}")
    folder = Path(path).parent
    words = ["--robot", _beside(folder, "robot", entry["robot"])]
    for key, value in entry.items():
        if key not in (*_OWN, *jobs):
            words += _option(folder, key, value)
    (job,) = jobs
    if job == "goal":
        words += [] if "start" in entry else ["--start", "0", "0", "0"]
        words += _option(folder, "goal", entry["goal"])
    elif job == "places":
        words += ["--", *_places(folder, entry["places"])]
    else:
        words += ["--", _beside(folder, job, entry[job])]
    return FleetRobot(name, _JOBS[job], tuple(words), float(delay))


def _option(folder: Path, key: str, value: Any) -> list[str]:
    """Write a key as an option of a command."""
    option = f"--{key.replace('_', '-')}"
    if isinstance(value, bool):
        return [option] if value else []
    if not isinstance(value, list):
        return [option, _beside(folder, key, value)]
    if any(isinstance(each, list | str) for each in value):  # given again for each
        return [word for each in value for word in _option(folder, key, each)]
    return [option, *map(str, value)]


def _places(folder: Path, places: Any) -> list[str]:
    """Write the places of a tour as words."""
    if not isinstance(places, list):
        return [_beside(folder, "path", places)]
    return [",".join(map(str, place)) if isinstance(place, list) else str(place) for place in places]


def _beside(folder: Path, key: str, value: Any) -> str:
    """Return a value as a word; the name of a file that is beside the TOML file with its folder."""
    beside = folder / str(value)
    return str(beside) if key in _FILES and beside.is_file() else str(value)


def write_fleet(fleet: FleetPlan, folder: str | Path) -> list[Path]:
    """Write a folder for each robot with the files of its plan, fleet.json and a picture, all or none."""
    from planner.files.pictures import draw_fleet_plan, write_svg

    before = [name for name in _written_before(Path(folder)) if name not in fleet.names]
    files = [f"{name}/{file}" for name in (*fleet.names, *before) for file in (*FILES, *EXTRA)]
    with files_together(folder, (*files, *_WRITTEN)) as temporary:
        for name, plan in zip(fleet.names, fleet.plans, strict=True):
            (temporary / name).mkdir()
            write_plan_files(plan, temporary / name)
        content = fleet.to_dict()
        write_text(temporary / "fleet.json", json.dumps(content) + "\n")
        write_svg(
            draw_fleet_plan(fleet),
            temporary / "fleet.svg",
            ", ".join(each["plan_id"] for each in content["robots"]),
        )
    for name in before:
        if not any(Path(folder, name).iterdir()):
            Path(folder, name).rmdir()
    return [Path(folder, name) for name in (*fleet.names, *_WRITTEN)]


def _written_before(folder: Path) -> list[str]:
    """List the robots of the fleet that was written into a folder before."""
    try:
        names = [str(robot["name"]) for robot in read_json(folder / "fleet.json")["robots"]]
    except (InputError, KeyError, TypeError):
        return []
    return [name for name in names if _NAME.fullmatch(name) and (folder / name).is_dir()]
