"""Draw the picture of the start page: three paths, planned from the look-up table and replayed in the simulator.

Usage: python docs/draw_plans.py

Takes a minute.
"""

from __future__ import annotations

from pathlib import Path

from matplotlib.figure import Figure

import softflagella as sf
from tracking.tracks import draw_overlay

PATHS = {"circle:1.5l": "paper-control", "square:3l": "paper-control", "triangle:4l": "paper-triangle"}


def main() -> None:
    figure = Figure(figsize=(13, 4.6))
    for axes, (path, robot) in zip(figure.subplots(1, len(PATHS)), PATHS.items(), strict=True):
        plan = sf.plan(path, robot)
        title = f"{path.partition(':')[0]}, N = {sf.load_robot(robot).tails}"
        draw_overlay(axes, plan.to_dict(), sf.check(plan, sf.replay(plan)), title)
    figure.axes[0].legend(fontsize=7, frameon=False, loc="center")
    figure.tight_layout()
    figure.savefig(Path(__file__).with_name("plans.png"), dpi=90, bbox_inches="tight")


if __name__ == "__main__":
    main()
