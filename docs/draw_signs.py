"""Draw the pictures of docs/reference/signs.md: the robot from above and from behind, and a camera's picture.

The robot is the paper's control robot (`sim.pictures.robot_views`). Each picture can be read on a screen 390
pixels wide. A test compares the files in docs with the drawings.

Usage: python docs/draw_signs.py [FOLDER]
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import matplotlib
from matplotlib.figure import Figure
from matplotlib.patches import Polygon

from sim.model.presets import PRESETS
from sim.pictures.robot_views import (
    INK,
    PALE,
    SIZE,
    TURN,
    RobotScene,
    arrow,
    draw_from_above,
    draw_from_behind,
    scene,
)

WIDTH = 4.4  # inches, of a picture


def draw_camera(axes: Any) -> None:
    """Draw the axes of a picture beside those of the lab."""
    corners = [(0, 0), (3.2, 0), (3.2, -2.1), (0, -2.1)]
    axes.add_patch(Polygon(corners, facecolor="#f4f4f1", edgecolor=PALE, lw=1.0))
    text = {"fontsize": SIZE, "va": "center"}
    for start, end, place, name, colour in (
        ((0.25, -0.25), (1.15, -0.25), (1.23, -0.25), "x of the picture", TURN),
        ((0.25, -0.25), (0.25, -1.15), (0.13, -1.35), "y of the picture", TURN),
        ((1.75, -1.85), (2.65, -1.85), (2.73, -1.85), "x", INK),
        ((1.75, -1.85), (1.75, -0.95), (1.83, -0.8), "y", INK),
    ):
        arrow(axes, start, end, colour, 1.3)
        axes.text(*place, name, color=colour, **text)
    axes.text(1.6, -2.42, "$y = -y_{picture}$,  $ψ = -ψ_{picture}$", color=INK, ha="center", **text)
    axes.set_title("a camera above the tank", fontsize=SIZE + 1.5)
    axes.set_xlim(-0.3, 3.5)
    axes.set_ylim(-2.7, 0.2)


def draw(shown: RobotScene) -> dict[str, Figure]:
    """Draw the three views, by the names of their files."""
    views: dict[str, tuple[float, Callable[[Any], None]]] = {  # file -> height over width, what draws it
        "signs-from-above.svg": (0.67, lambda axes: draw_from_above(axes, shown)),
        "signs-from-behind.svg": (0.8, lambda axes: draw_from_behind(axes, shown)),
        "signs-camera.svg": (0.72, draw_camera),
    }
    figures = {}
    for name, (height, draw_view) in views.items():
        figures[name] = Figure(figsize=(WIDTH, height * WIDTH + 0.3), layout="constrained")
        axes = figures[name].add_subplot()
        draw_view(axes)
        axes.set_aspect("equal")
        axes.axis("off")
    return figures


def write(folder: Path) -> None:
    """Write the pictures as SVG."""
    with matplotlib.rc_context({"svg.hashsalt": "signs"}):
        for name, figure in draw(scene(PRESETS["paper-control"])).items():
            figure.savefig(folder / name, format="svg", metadata={"Date": None})


if __name__ == "__main__":
    write(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent)
