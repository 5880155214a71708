"""Read goal.json, which holds `Trip.to_dict` and the identity of the plan beside it."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from planner.goal.trip import FORMAT
from planner.paths.obstacles import FreeSpace
from sim.io.errors import InputError
from sim.io.keywords import checks_keywords
from sim.io.reading import ContentError, read_json

_NUMBERS = ("end_error_over_l", "end_error_rad", "length_over_l", "margin_over_l")
_POSES = ("start", "goal", "predicted_end")


@checks_keywords
def load_goal(path: str | Path) -> dict[str, Any]:
    """Read and check the content of a goal.json, which is that of `Trip.to_dict`.

    Args:
        path: the file, written by `write_plan`.

    Returns:
        The content, and in `plan_id` the `id` of the plan.json that was written with it.

    Raises:
        InputError: the file is no goal.json of this version, or it has a value that cannot be.

    Example:
        >>> import tempfile
        >>> from pathlib import Path
        >>> from softflagella import load_goal, load_plan, to_goal, write_plan
        >>> trip = to_goal((0, 0, 0), (3, 1, 1), "paper-control")
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     paths = write_plan(trip, folder)
        ...     goal = load_goal(Path(folder, "goal.json"))
        ...     goal["goal"], goal["plan_id"] == load_plan(Path(folder, "plan.json"))["id"]
        ([3.0, 1.0, 1.0], True)
    """
    try:
        content = read_json(path)
        _check(content)
    except ContentError as unreadable:
        reason = str(unreadable).removeprefix(f"{path} ")
    except InputError as impossible:
        raise InputError(f"{path}: {impossible}; plan again") from None
    except (KeyError, TypeError, ValueError, OverflowError) as broken:
        reason = str(broken)
    else:
        return dict(content)
    raise InputError(f"{path} is not a goal.json of the planner ({reason}); plan again")


def _check(content: Any) -> None:
    """Check what a goal.json has in it.

    Raises:
        InputError: another format, a number that is not finite, or a region that is none.
        KeyError, TypeError, ValueError, OverflowError: it is no goal.json.
    """
    if content["format"] != FORMAT:
        raise InputError(f"format {content['format']}, this version reads {FORMAT}")
    clearance = content["predicted_clearance_over_l"]
    numbers = [*(content[name] for name in _NUMBERS), 0.0 if clearance is None else clearance]
    for name in _POSES:
        numbers += _row(content[name], 3)
    for place in content["via"]:
        numbers += _row(place, 2)
    for number in numbers:
        if not math.isfinite(number):
            raise InputError(f"{number} is no finite number")
    FreeSpace.from_dict(content)
    if not isinstance(content["plan_id"], str):
        raise ValueError("plan_id is no text")


def _row(values: list[float], count: int) -> list[float]:
    """Return a list of numbers of a given length."""
    if len(values) != count:
        raise ValueError(f"{values} should have {count} numbers")
    return [float(value) for value in values]
