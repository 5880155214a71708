"""Tables that come with the tests, and measured ones where they are on the machine: each gets its verdict."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from calibration.linear.gls import repeat_covariance
from calibration.own_model.function_model import FunctionModel
from calibration.report.report import write_report
from calibration.swimmer.measured_table import read_measurements
from calibration.swimmer.swimmer import SwimmerModel
from calibration.verdict.calibrate import calibrate
from calibration.verdict.verdict import Verdict
from common.errors import run_command
from common.units import Sigma
from sim.inputs import load_robot
from sim.model.uncertainty import DEFAULTS
from softflagella.__main__ import main
from tests.calibration.toy_tables import DRAG, FEW_CANDIDATES, FEW_DRAWS, START, install_few_candidates
from tests.oracles.falling_balls import spheres
from tests.reference.make import GIVEN, HERE, TABLES


def calibrated(name: str, draws: int = FEW_DRAWS) -> Verdict:
    data = read_measurements(HERE / f"{name}.csv")
    return calibrate(SwimmerModel(load_robot(HERE / "robot.toml"), data), draws=draws, progress=False)


@pytest.mark.rest
@pytest.mark.parametrize("name", TABLES)
def test_the_files_are_what_make_writes(name: str) -> None:
    assert load_robot(HERE / "robot.toml") == GIVEN
    pd.testing.assert_frame_equal(pd.read_csv(HERE / f"{name}.csv"), TABLES[name](), rtol=1e-4, check_dtype=False)


@pytest.mark.slow
def test_nothing_is_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    install_few_candidates(monkeypatch)
    result = calibrated("none")
    assert result.verdict == "none"
    assert result.effects == ()
    for name, truth in {"C_t": 3.1, "C_r": 2.4, "C_yr": 4.4}.items():
        assert result.final.parameters[name] == pytest.approx(truth, rel=0.1)


@pytest.mark.slow
@pytest.mark.parametrize("few", [True, pytest.param(False, marks=pytest.mark.rates)], ids=["few", "all"])
def test_one_effect_is_named_sized_and_handed_on(
    few: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Through the command. The truth was simulated on a finer mesh; the command is not told of the effect."""
    if few:
        install_few_candidates(monkeypatch, (DRAG, "tail_spin_drag"))
    words = ["calibrate", str(HERE / "effect.csv"), "--robot", str(HERE / "robot.toml"), "--out", str(tmp_path)]
    assert run_command(main, [*words, "--no-path", "--no-laws"]) == 0
    record = json.loads((tmp_path / "verdict.json").read_text())
    assert record["verdict"] == "effect"
    assert record["effects"] == [DRAG]
    size = record["parameters"][DRAG]
    low, high = size["interval"]
    assert low < 5.0 < high
    assert record["error_after"] < 1.25 * record["noise_ceiling"] < record["error_before"]
    corrected = load_robot(tmp_path / "corrected.toml").effects[DRAG]
    assert corrected == pytest.approx(size["value_all_runs"], abs=0.05 * (high - low) / 4)
    assert "<svg" in (tmp_path / "report.html").read_text()


@pytest.mark.parametrize(
    "few",
    [pytest.param(True, marks=pytest.mark.rest), pytest.param(False, marks=pytest.mark.rates)],
    ids=["few", "all"],
)
def test_what_no_effect_does_is_left_unexplained(few: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    if few:
        install_few_candidates(monkeypatch, (*FEW_CANDIDATES, "disc_drag", "surface_couple", "inertia"))
    result = calibrated("unexplained")
    assert result.verdict == "unexplained"
    assert result.effects == ()
    assert "no effect and no pair" in result.sentence


@pytest.mark.rest
def test_rivals_are_all_named_with_the_runs_that_would_tell_them_apart(tmp_path: Path) -> None:
    """The verdict, the first rival's size, and the page that a lab reads; the robot is as given."""
    data = read_measurements(HERE / "ambiguous.csv")
    known = replace(load_robot(HERE / "robot.toml"), sigmas=dict.fromkeys(DEFAULTS, Sigma(0.0, False)))
    lab = {"l_cm": (5.0, 8.0, 11.0)}  # the table has one length, with which no runs tell the rivals apart
    result = calibrate(SwimmerModel(known, data, own=lab), draws=FEW_DRAWS, progress=False)
    assert result.verdict == "ambiguous"
    assert "tail_spin_drag" in result.effects
    assert len(result.effects) > 1
    assert result.next_runs
    page = tmp_path / "report.html"
    write_report(result, result.to_dict(), page)
    text = page.read_text()
    assert "Runs to make next" in text
    for run in result.next_runs:
        for value in run.settings.values():
            assert str(value) in text


@pytest.mark.rest
def test_where_tolerances_are_wide_a_wrong_number_comes_ahead_of_those_rivals() -> None:
    """With default tolerances a stiffness 40 % off does what the spin drag does: these runs cannot say which."""
    result = calibrated("ambiguous")
    assert result.verdict == "number"
    assert result.effects == ()
    assert "tail_spin_drag" in {e.name for c in result.attribution.rival_effects for e in c.added}
    assert "If the number is right, " in result.sentence
    assert re.fullmatch("the stated value of .* is wrong", result.explanations[0].title)


MEASURED = Path(__file__).parents[4] / "shared" / "measured"
measured = pytest.mark.skipif(not MEASURED.is_dir(), reason="the measured tables are not on this machine")


@measured
@pytest.mark.parametrize("name", ["run01.csv", "run02.csv"])
def test_measured_tables_are_read_whole(name: str) -> None:
    data = read_measurements(MEASURED / name)
    assert len(data) == 192
    assert data.excluded == ()
    assert data.session_names == ("N = 2", "N = 3", "N = 4", "N = 5")
    spread = np.sqrt(np.diag(repeat_covariance(data.y, data.condition)))
    assert ((spread > 0.01) & (spread < 0.05)).all()


def median_error(model: FunctionModel, verdict: Verdict, effects: dict[str, float]) -> float:
    """The relative rms of the beads' median speeds, the viscosity fitted to them, with given `effects`."""
    residual = (model.runs.y - model.predict([{**verdict.base.parameters, **effects}])[0])[:, 0]
    medians = np.array([np.median(residual[model.runs.condition == c]) for c in np.unique(model.runs.condition)])
    return float(medians.std())


@measured
def test_spheres_in_glycerine_need_the_wall() -> None:
    """5.1 % to 1.3 %; inertia does as well, so the verdict names both. One bead of ZK2026 is odd."""
    source = MEASURED / "published" / "falling_sphere_glycerine.csv"
    model = spheres(source, "KW2023")
    result = calibrate(model, progress=False)
    assert set(result.effects) >= {"wall"}
    assert result.verdict == "ambiguous"
    assert median_error(model, result, {}) == pytest.approx(0.051, abs=0.002)
    assert median_error(model, result, {"wall": 1.0}) == pytest.approx(0.0135, abs=0.002)
    assert calibrate(spheres(source, "ZK2026"), progress=False).verdict == "unexplained"


@measured
@pytest.mark.rates
@pytest.mark.parametrize(
    ("name", "effect", "size"),
    [
        ("run04.csv", "natural_curvature", -0.295),
        ("run05.csv", "viscosity_with_time", 0.0444),
    ],
)
def test_what_came_out_of_the_measured_tables(name: str, effect: str, size: float) -> None:
    """docs/results-calibration.md; the others take longer and are written down there."""
    result = calibrate(SwimmerModel(START, read_measurements(MEASURED / name)), progress=False)
    assert result.effects == (effect,)
    assert result.final.parameters[effect] == pytest.approx(size, rel=0.05)
    assert result.error_after < 1.15 * result.noise_ceiling
