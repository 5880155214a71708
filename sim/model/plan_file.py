"""plan.json as both sides read it: the format, finite numbers, and the robot that it is for.

The planner writes the file and reads it again, and the simulator replays it. So both check the same things here.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from sim.io.errors import InputError
from sim.io.reading import ContentError, read_json
from sim.io.seals import digest_of

FORMAT = 2
_ID = re.compile("p[0-9a-f]{11}")  # ids of older versions have another form
FASTEST = 1e4  # ω̄ above which the file is taken for edited


def read_plan_file(path: str | Path) -> dict[str, Any]:
    """Read the content of a plan.json.

    Raises:
        InputError: the file cannot be read, is no plan.json of this format, has a number that is not finite, a
            motor speed that cannot be, or an id that is not that of its content.
    """
    if Path(path, "plan.json").is_file():
        raise InputError(f"{path} is the folder of a plan; give {Path(path, 'plan.json')}")
    try:
        content = read_json(path, parse_constant=_finite, parse_float=_finite)
    except ContentError as unreadable:
        reason = str(unreadable).removeprefix(f"{path} ")
        raise InputError(f"{path} is not a plan.json of the planner ({reason}); plan again") from None
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
    if not isinstance(content, dict) or "format" not in content:
        raise InputError(f"{name} is not a plan.json of the planner (it has no format); plan again")
    if content["format"] != FORMAT:
        raise InputError(f"{name} has format {content['format']}, this version reads {FORMAT}: plan again")
    if isinstance(content.get("robot"), dict) and "vehicle" in content["robot"]:  # that was measured
        return
    try:
        speed = float(content["robot"]["groups"]["omega_bar"])
    except (KeyError, TypeError, ValueError, OverflowError) as broken:
        raise InputError(f"{name} is not a plan.json of the planner ({broken}); plan again") from None
    if not 0 < abs(speed) <= FASTEST:
        raise InputError(f"{name}: omega_bar is not between 0 and {FASTEST:g}; plan again")


def _finite(text: str) -> float:
    value = float(text)
    if not math.isfinite(value):
        raise ValueError(f"{text} is no finite number")
    return value
