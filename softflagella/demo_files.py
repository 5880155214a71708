"""The files that the demo's page links to: those of a plan, and the pages of the documentation."""

from __future__ import annotations

import os
import re
from pathlib import Path

_DOCS = Path(__file__).parents[1] / "docs"
_PAGES = (  # of the documentation: name without suffix, title, what it is
    ("tutorial/schedule", "From a robot to a schedule", "the first tutorial, ten minutes"),
    ("tutorial/calibration", "Calibrating the model", "the second tutorial"),
    ("howto/tank", "Calibrate your tank", "which runs to make"),
    ("reference/signs", "Signs and frames", "which way +1 turns, and a check on the bench"),
    ("howto/tracker", "Keep a robot on its path with a camera", "a schedule with feedback"),
)
ROBOT_PAGE = "robot.html"  # the page that plans, beside the demo's page
ROBOT_PICTURE = _DOCS / "page.png"  # of it; there is none without a checkout
PLAN_FILES = {
    "schedule.h": "the schedule for a microcontroller, open loop",
    "tracker.h": "the same with feedback from a camera",
    "plan.csv": "dwells and poses as a table",
    "plan.json": "everything about the plan",
    "plan.svg": "a drawing of it",
    "track.csv": "the replayed track",
}


def header_excerpt(header: str) -> list[str]:
    """Return the numbers that a schedule.h defines, and the first line of its dwells."""
    lines = header.splitlines()
    defined = [line for line in lines if re.match(r"#define SCHEDULE_\w+ [-(\d]", line)]
    dwells = next(place for place, line in enumerate(lines) if line.strip()[:1].isdigit())
    return [*defined, *lines[dwells - 1 : dwells + 1], "    …"]


def documentation(folder: Path) -> list[tuple[str, str, str]]:
    """List pages of the documentation, relative to a folder: HTML if it was built; none without a checkout."""
    built = _DOCS / "_build" / "html"
    root, suffix = (built, ".html") if (built / "index.html").is_file() else (_DOCS, ".md")
    return [
        (os.path.relpath(path, folder), title, words)
        for name, title, words in _PAGES
        if (path := root / f"{name}{suffix}").is_file()
    ]
