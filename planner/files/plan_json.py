"""Read plan.json, which holds `Plan.to_dict()`. `sim.model.plan_file` checks what the simulator needs, too."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from planner.planning.plan import GUARANTEE
from sim.io.errors import InputError
from sim.io.keywords import checks_keywords
from sim.model.plan_file import read_plan_file

_NUMBERS = ("stated_error_over_l", "feedback_error_over_l", "predicted_rms_over_l", "predicted_max_over_l",
            "offset_over_l", "minimum_dwell_bar")  # fmt: skip
LARGEST = 1e100  # of a number, so that sums and squares of them are finite
_TABLES = {"reference": 2, "raw_path": 2, "predicted_poses": 3}


@checks_keywords
def load_plan(path: str | Path) -> dict[str, Any]:
    """Read and check the content of a plan.json, which is that of `Plan.to_dict`.

    Args:
        path: the file, written by `write_plan`.

    Raises:
        InputError: the file is no plan.json of this version, or it has a value that cannot be.

    Example:
        >>> import tempfile
        >>> from pathlib import Path
        >>> from softflagella import circle, load_plan, load_robot, plan, write_plan
        >>> result = plan(circle(2.0), load_robot("paper-control"))
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     paths = write_plan(result, folder)
        ...     load_plan(paths[0])["id"] == result.to_dict()["id"]
        True
    """
    content = read_plan_file(path)
    check_numbers(content, path)
    return content


def check_numbers(content: dict[str, Any], name: str | Path) -> None:
    """Check the errors and tables of a plan.json; `name` is that of the file in messages.

    Raises:
        InputError: one is missing, or has a value that cannot be.
    """
    try:
        for key in (*_NUMBERS, *([] if content[GUARANTEE] is None else [GUARANTEE])):
            if not abs(float(content[key])) < LARGEST:
                raise InputError(
                    f"{name}: {key} = {content[key]} is no finite number below {LARGEST:g}; plan again"
                )
        for key, width in _TABLES.items():
            table = np.array(content[key], dtype=float)
            if table.ndim != 2 or table.shape[1] != width or len(table) < 2 or not (np.abs(table) < LARGEST).all():
                raise InputError(f"{name}: {key} must have two or more rows of {width} finite numbers; plan again")
        content["point"]
    except (KeyError, TypeError, ValueError, OverflowError) as broken:
        raise InputError(f"{name} is not a plan.json of the planner ({broken}); plan again") from None
