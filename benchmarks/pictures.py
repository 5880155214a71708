"""Pictures of planned and replayed tracks for the pages."""

from __future__ import annotations

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from planner.planning.picture import REPLAYED
from planner.planning.planned import Plan
from sim.arrays import Floats
from sim.io.files import whole_file
from sim.motion.replay import replay


def replayed(plan: Plan) -> Floats:
    """Replay a plan in the simulator, and return the track (S, 2) of the head's centre [l]."""
    return replay([plan.schedule()])[0][["x_over_l", "y_over_l"]].to_numpy(float)


def draw_replayed(axes: Axes, plan: Plan, track: Floats, width: float = 0.8) -> None:
    """Draw a replayed track (S, 2) [l] on axes in cm."""
    axes.plot(*(100 * plan.robot.tail_length * track.T), color=REPLAYED, lw=width, label="replayed")


def save_picture(figure: Figure, path: str) -> None:
    """Write a picture as PNG, whole or not at all, and print its name."""
    with whole_file(path) as part:
        figure.savefig(part, format="png", dpi=110)
    print(f"-> {path}")
