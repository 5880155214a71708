"""The whole loop through the simulator: a hidden effect found, and the robot brought back on its path."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest

from calibration.swimmer.synthetic_table import make_table
from planner.paths.path import polygon
from sim.inputs import load_robot
from sim.io.errors import run_command
from sim.model.presets import PRESETS
from softflagella.replanning import draw_steered, gap_closed, steer
from tests.calibration.toy_tables import TRUTH


@pytest.mark.slow
def test_the_real_simulator_closes_a_table_with_a_hidden_effect(tmp_path: Path) -> None:
    """Truth on a finer mesh and step; the fitter is not told of the effect."""
    truth = replace(TRUTH, effects={"end_over_end_drag": 5.0})
    table = make_table(truth, seed=21, lengths_cm=(6.0, 9.0), title="")
    table.to_csv(tmp_path / "table.csv", index=False)
    from calibration.__main__ import main

    out = tmp_path / "out"
    words = ["calibrate", str(tmp_path / "table.csv"), "--robot", "paper-measured", "--out", str(out)]
    assert run_command(main, words) == 0
    verdict = json.loads((out / "verdict.json").read_text())
    assert verdict["verdict"] == "effect"
    assert verdict["effects"] == ["end_over_end_drag"]
    low, high = verdict["parameters"]["end_over_end_drag"]["interval"]
    assert low - 0.5 < 5.0 < high + 0.5
    assert verdict["error_after"] < 1.25 * verdict["noise_ceiling"]
    assert verdict["error_before"] > verdict["error_after"]  # numbers as given may take up much of an effect
    corrected = load_robot(out / "corrected.toml")
    assert corrected.effects["end_over_end_drag"] == verdict["parameters"]["end_over_end_drag"]["value_all_runs"]
    assert "data:image/png" in (out / "report.html").read_text()


@pytest.mark.slow
def test_the_right_model_brings_the_robot_back_on_its_path() -> None:
    """A robot with end-over-end drag: planned without it, nearly with it, and with the truth."""
    truth = replace(PRESETS["paper-control"], effects={"end_over_end_drag": 5.0})
    models = {
        "without": replace(truth, effects={}),
        "nearly": replace(truth, effects={"end_over_end_drag": 4.9}),
        "truth": truth,
    }
    found = steer(models, truth, polygon(4, 2.5))
    rms = [one.error.rms for one in found.values()]
    assert rms[0] > 5 * rms[2]
    assert gap_closed(*rms) > 0.8
    assert len(draw_steered(found).axes) == 3
