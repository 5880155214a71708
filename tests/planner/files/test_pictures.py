"""Pictures of goals and jobs: the legend stands clear of the axes, and a swath has no gaps."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import PatchCollection
from matplotlib.figure import Figure

import softflagella as sf
from planner.files.pictures import legend_below
from planner.jobs.coverage_picture import draw_swath


@pytest.mark.parametrize(("width", "height"), [(90.0, 40.0), (40.0, 40.0), (30.0, 90.0)])
def test_the_legend_is_below_the_label_of_the_axis(width: float, height: float) -> None:
    """On flat axes it used to cover the label."""
    figure = Figure(figsize=(6, 6))
    canvas = FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    axes.plot([0, width], [0, height], label="predicted")
    axes.set_aspect("equal")
    axes.set_xlabel("x [cm]")
    legend_below(axes)
    canvas.draw()
    legend = axes.get_legend()
    assert legend is not None
    box = legend.get_window_extent()
    assert box.y1 < axes.xaxis.label.get_window_extent().y0
    assert box.y1 > axes.xaxis.label.get_window_extent().y0 - 30


def test_a_swath_is_smooth_where_a_track_has_few_samples() -> None:
    """Its edge used to be scalloped in turns, where a dwell is long."""
    axes = Figure().add_subplot()
    draw_swath(axes, np.array([[0.0, 0.0], [1.0, 0.0], [3.0, 0.0]]), 0.5, 0.11)
    (swath,) = [artist for artist in axes.collections if isinstance(artist, PatchCollection)]
    centres = np.array([path.vertices.mean(0) for path in swath.get_paths()])
    assert np.ptp(centres[:, 0]) == pytest.approx(33.0, rel=0.02)
    assert np.hypot(*np.diff(centres, axis=0).T).max() < 0.5 * 11 / 10


def test_a_long_dwell_is_drawn_as_a_curve() -> None:
    """Eight samples a dwell would be a polygon."""
    tour = sf.tour([(0, 0), (4, 0), (2, 1)], "paper-control", objective="time")
    (line,) = [line for line in tour.plot(Figure().add_subplot()).lines if line.get_label() == "predicted"]
    steps = np.diff(np.asarray(line.get_xydata()), axis=0)
    turns = np.diff(np.unwrap(np.arctan2(steps[:, 1], steps[:, 0])))
    assert (np.abs(turns) > np.radians(8)).sum() <= len(tour.plan.dwells)  # only at the flips
