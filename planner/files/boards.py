"""Folders for boards: an Arduino library, or MicroPython modules, with a plan's schedule.

The code is that of `planner/c/arduino`, which PlatformIO takes, too, and of `planner/micropython`: the first test
of the motor's sign, the schedule open loop, and the orders of a computer that tracks the robot.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from common.errors import InputError
from common.files import files_together, write_text
from common.keywords import checks_keywords
from common.provenance import __version__
from planner.files.headers import c_part, milliseconds, safe_name, schedule_header
from planner.planning.plan import Plan

_SKETCHES = ("first_turn", "open_loop", "tracked")
_ARDUINO = {
    "src/softflagella.h": "softflagella.h",
    **{f"examples/{name}/{name}.ino": f"{name}.ino" for name in _SKETCHES},
}
_FILES = {
    "arduino": ("library.properties", "src/schedule.h", *_ARDUINO),
    "micropython": ("schedule.py", "motor.py"),
}
_MOTOR = Path(__file__).parents[1] / "micropython" / "motor.py"
_A_LINE = 24  # bytes of the schedule


@checks_keywords
def write_arduino(result: Plan, folder: str | Path) -> Path:
    """Write an Arduino library with the schedule of a plan, all of it or nothing, and return its folder.

    Args:
        result: a plan.
        folder: it is made if it is missing; a library that was written into it before is replaced.

    Raises:
        InputError: a dwell is too short for whole milliseconds, or the folder holds other files.

    Example:
        >>> import tempfile
        >>> from softflagella import circle, plan, write_arduino
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     library = write_arduino(plan(circle(2.0), "paper-control"), folder)
        ...     sorted(path.name for path in library.iterdir())
        ['examples', 'library.properties', 'src']
    """
    code = {name: c_part(f"arduino/{source}") for name, source in _ARDUINO.items()}
    header = schedule_header(result, result.identity)
    properties = {"library.properties": _properties(result), "src/schedule.h": header}
    return _write("arduino", folder, properties | code)


@checks_keywords
def write_micropython(result: Plan, folder: str | Path) -> Path:
    """Write MicroPython modules with the schedule of a plan, all or none, and return their folder.

    Args:
        result: a plan.
        folder: it is made if it is missing; modules that were written into it before are replaced.

    Raises:
        InputError: a dwell is too short for whole milliseconds, or the folder holds other files.

    Example:
        >>> from softflagella import circle, plan, write_micropython
        >>> write_micropython(plan(circle(2.0), "paper-control"), "modules")  # doctest: +SKIP
    """
    modules = {"schedule.py": _schedule_module(result), "motor.py": _MOTOR.read_text()}
    return _write("micropython", folder, modules)


def _write(board: str, folder: str | Path, contents: Mapping[str, str]) -> Path:
    """Write the files of a board into a folder, all or none, and return it."""
    target = check_folder(board, folder)
    with files_together(target, _FILES[board]) as temporary:
        for name, text in contents.items():
            (temporary / name).parent.mkdir(parents=True, exist_ok=True)
            write_text(temporary / name, text)
    return target


def check_folder(board: str, folder: str | Path) -> Path:
    """Return the path of a folder that the files of a board, arduino or micropython, can be written into.

    Raises:
        InputError: it is a file, or it has other files, one of which the message names.
    """
    target = Path(folder)
    if target.exists() and not target.is_dir():
        raise InputError(f"{target} is a file; give a folder for --{board}")
    for path in target.rglob("*"):
        name = path.relative_to(target).as_posix()
        if name not in _FILES[board] and not path.is_dir():
            raise InputError(f"{target} has other files, such as {name}; give a folder of its own for --{board}")
    return target


def _properties(result: Plan) -> str:
    """Write library.properties; PlatformIO reads it, too."""
    lines = {
        "name": "softflagella plan",
        "version": __version__,
        "author": "softflagella",
        "maintainer": "softflagella",
        "sentence": f"Plan {result.identity} of the robot {safe_name(result)}.",
        "paragraph": "The schedule of a soft flagellated robot's motor, and sketches that follow it.",
        "category": "Device Control",
        "url": "https://arxiv.org/abs/2103.05712",
        "architectures": "*",
        "includes": "softflagella.h",
    }
    return "".join(f"{key}={value}\n" for key, value in lines.items())


def _schedule_module(result: Plan) -> str:
    """Write schedule.py: words, numbers and entries of schedule.h; an entry is two bytes, the lower one first."""
    header = schedule_header(result, result.identity)
    words = header.removeprefix("/* ").partition("\n * Checkpoints")[0].replace("\n * ", "\n# ")
    numbers = dict(re.findall(r"^#define SCHEDULE_(\w+) \(?(-?[\d.]+)", header, re.MULTILINE))
    del numbers["CHECKPOINTS"]
    numbers["REPEATS"] = str(result.lap is not None)
    entries = np.array(milliseconds(result.seconds), "<u2").tobytes()
    lines = [f"    {entries[i : i + _A_LINE]!r}" for i in range(0, len(entries), _A_LINE)]
    constants = [f"{name} = {value}" for name, value in numbers.items()]
    return "\n".join([f"# {words}", *constants, "ENTRIES = (", *lines, ")", ""])
