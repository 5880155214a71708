"""A plan with the right model brings the robot back on its path."""

from __future__ import annotations

from dataclasses import replace

import pytest

from planner.paths.path import polygon
from sim.model.presets import PRESETS
from softflagella.demo_figures import draw_steered
from softflagella.replanning import gap_closed, steer


@pytest.mark.rest
def test_the_right_model_brings_the_robot_back_on_its_path() -> None:
    """A robot with end-over-end drag: planned without it, nearly with it, and with the truth."""
    truth = replace(PRESETS["paper-control"], effects={"end_over_end_drag": 5.0})
    models = {
        "without": replace(truth, effects={}),
        "nearly": replace(truth, effects={"end_over_end_drag": 4.9}),
        "truth": truth,
    }
    steered = steer(models, truth, polygon(4, 2.5))
    rms = [each.error.rms for each in steered.values()]
    assert rms[0] > 5 * rms[2]
    assert gap_closed(*rms) > 0.8
    assert [len(draw_steered(run).axes[0].get_lines()) for run in steered.values()] == [3, 3, 3]
