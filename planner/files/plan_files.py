"""The files of a plan: plan.json, plan.csv, plan.svg, and schedule.h for a microcontroller.

They appear together, and each has the identity of the plan, so files of two plans cannot be taken for one.
"""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

from common.figure_files import write_figure
from common.files import files_together, write_csv, write_text
from common.keywords import checks_keywords
from common.provenance import code_version
from planner.files.headers import schedule_header
from planner.planning.plan import KINDS, Plan

FILES = ("plan.json", "plan.csv", "schedule.h", "plan.svg")
EXTRA = tuple(f"{kind}.{ending}" for kind in KINDS for ending in ("json", "svg"))  # planned before


@checks_keywords
def write_plan(result: Plan, folder: str | Path) -> list[Path]:
    """Write the files of a plan, all or none, and return their paths.

    Args:
        result: a plan; that of a job has goal.json, tour.json and so on, and a picture besides.
        folder: it is made if it is missing.

    Raises:
        InputError: a dwell is too short for whole milliseconds, or a file cannot be written.

    Example:
        >>> import tempfile
        >>> from softflagella import circle, plan, write_plan
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     [path.name for path in write_plan(plan(circle(2.0), "paper-control"), folder)]
        ['plan.json', 'plan.csv', 'schedule.h', 'plan.svg']
    """
    with files_together(folder, (*FILES, *EXTRA)) as temporary:
        names = _write_files(result, temporary)
    return [Path(folder, name) for name in names]


def _write_files(result: Plan, folder: Path) -> list[str]:
    """Write the files of a plan into a folder, one after the other, and return their names."""
    from planner.files.pictures import draw_plan  # loads matplotlib

    content, names = result.to_dict(), list(FILES)
    identity = content["id"]
    write_text(folder / "plan.json", json.dumps({**content, "code_version": code_version()}) + "\n")
    columns = {name: values.tolist() for name, values in result.columns().items()}
    write_csv({**columns, "plan_id": [identity] * len(result.dwells)}, folder / "plan.csv")
    write_text(folder / "schedule.h", schedule_header(result, identity))
    write_figure(draw_plan(replace(result, job=None)), folder / "plan.svg", identity)
    if result.job is not None:
        names += [f"{result.job.kind}.json", f"{result.job.kind}.svg"]
        content = {**result.job.to_dict(result), "plan_id": identity}
        write_text(folder / names[-2], json.dumps(content) + "\n")
        write_figure(draw_plan(result), folder / names[-1], identity)
    return names
