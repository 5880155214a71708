"""An Arduino library with the schedule of a plan and sketches that drive the motor; PlatformIO takes it, too.

The code is that of `planner/c/arduino`: softflagella.h drives an H-bridge and follows the schedule. Sketches are
the first test of the motor's sign, the schedule open loop, and the orders of a computer that tracks the robot.
"""

from __future__ import annotations

from pathlib import Path

from common.errors import InputError
from common.files import files_together, write_text
from common.keywords import checks_keywords
from common.provenance import __version__
from planner.files.headers import c_part, safe_name, schedule_header
from planner.planning.plan import Plan

_SKETCHES = ("first_turn", "open_loop", "tracked")
_CODE = {
    "src/softflagella.h": "softflagella.h",
    **{f"examples/{name}/{name}.ino": f"{name}.ino" for name in _SKETCHES},
}
_FILES = ("library.properties", "src/schedule.h", *_CODE)


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
    library = check_library(folder)
    contents = {
        "library.properties": _properties(result),
        "src/schedule.h": schedule_header(result, result.identity),
        **{name: c_part(f"arduino/{code}") for name, code in _CODE.items()},
    }
    with files_together(library, _FILES) as temporary:
        for name, text in contents.items():
            (temporary / name).parent.mkdir(parents=True, exist_ok=True)
            write_text(temporary / name, text)
    return library


def check_library(folder: str | Path) -> Path:
    """Return the path of a folder that a library can be written into.

    Raises:
        InputError: it is a file, or it has other files, one of which the message names.
    """
    library = Path(folder)
    if library.exists() and not library.is_dir():
        raise InputError(f"{library} is a file; give a folder for the library")
    for path in library.rglob("*"):
        name = path.relative_to(library).as_posix()
        if name not in _FILES and not path.is_dir():
            raise InputError(f"{library} has other files, such as {name}; give a folder of its own")
    return library


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
