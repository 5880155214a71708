"""Partial verdicts, on falling balls: a form that is not exact, or whose size differs, is adopted, not claimed."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from calibration.attribution.nearest import sizes_of, varying
from calibration.statistics.forward import by_differences, derivatives
from calibration.statistics.shifted import Shift, Shifted
from calibration.statistics.statistical_model import start_values
from calibration.verdict.calibrate import calibrate
from calibration.verdict.verdict import Verdict
from calibration.words.render import next_steps
from softflagella.__main__ import main
from tests.oracles.falling_balls import AIR, DRAGS, GRAVITY, NULLS, OUTSIDE, balls, falls
from tests.shared import shared

MODELS = Path(__file__).parents[2] / "docs/models"
MEASURED = Path(__file__).parents[3] / "shared/measured/published/falling_balls.csv"


@shared
def verdict(truth: str, seed: int, *, without: tuple[str, ...] = ()) -> Verdict:
    """The verdict on a table with a hidden truth."""
    return calibrate(balls(falls(truth, seed), without), draws=200, progress=False)


def differing(seed: int = 3) -> Verdict:
    return verdict("linear drag, differs", seed)


@pytest.mark.parametrize(
    ("effect", "size"), [("linear_drag", 0.4), ("linear_drag", 1e-4), ("quadratic_drag", 0.45)]
)
def test_speeds_are_those_of_the_equation_of_motion(effect: str, size: float) -> None:
    model = balls(falls("nothing", 0))
    depth = model.columns["depth_m"]
    row = int(np.argmax(depth))
    area = np.pi * model.columns["radius_m"][row] ** 2 / model.columns["mass_kg"][row]
    c = size * AIR * area / 2 if effect == "quadratic_drag" else 0.0
    k = size if effect == "linear_drag" else 0.0
    fall = solve_ivp(
        lambda _, y: (y[1], GRAVITY - k * y[1] - c * y[1] ** 2), (0, 20), (0, 0),
        events=lambda _, y: y[0] - depth[row], rtol=1e-10, atol=1e-10,
    )  # fmt: skip
    speed = np.exp(model.predict([{**start_values(model), effect: size}])[0, row, 0])
    assert speed == pytest.approx(fall.y_events[0][0][1], rel=1e-6)


@pytest.mark.parametrize("effect", ["linear_drag", "release"])
def test_a_varying_size_has_the_derivatives_of_differences(effect: str) -> None:
    model = balls(falls("nothing", 0))
    differing = varying(model, next(e for e in model.effects if e.name == effect), 0.5)
    departures = {s.change.name: 0.1 * (i - 4) for i, s in enumerate(differing.shifts)}
    at = {**start_values(model), effect: 0.3, **departures}
    names = ("gravity", effect, *departures)
    close = by_differences(differing, at, names)[1]
    assert derivatives(differing, at, names)[1] == pytest.approx(close, abs=0.02 * np.abs(close).max())
    one_sign = effect == "linear_drag"
    assert sizes_of(differing, at)[0] == pytest.approx(0.3 * np.exp(-0.4) if one_sign else 0.3 - 0.4)


def test_a_size_at_its_bound_has_a_derivative() -> None:
    model = balls(falls("nothing", 0))
    drag = next(e for e in model.effects if e.name == "quadratic_drag")
    differing = Shifted(model, (Shift(drag, np.arange(len(model.runs)) < 80, "here"),))
    at = {**start_values(differing), drag.name: drag.bounds[0]}
    _, J = derivatives(differing, at, [drag.name, differing.shifts[0].change.name])
    assert J[:80, :, 1] == pytest.approx(J[:80, :, 0], rel=1e-6)
    assert J[:80, :, 0] == pytest.approx(by_differences(model, at, [drag.name])[1][:80, :, 0], rel=1e-6)


def test_a_form_whose_size_differs_is_adopted_and_not_claimed() -> None:
    result = differing()
    nearest = result.nearest
    assert (result.verdict, result.effects) == ("partial", ())
    assert nearest.effect.name == "linear_drag"
    assert result.error_after < 1.5 * result.noise_ceiling < 0.5 * result.error_before
    true_sizes = 0.4 * np.exp(0.6 * hidden_normals(3))
    low, high = nearest.evidence.interval
    assert low < np.exp(np.log(true_sizes).mean()) < high
    inside = [
        low < size < high for size, (_, low, high) in zip(true_sizes, nearest.evidence.sizes.values(), strict=True)
    ]
    assert sum(inside) >= len(inside) - 2
    refit = result.final_refit  # of a new specimen: the mean size, with the spread in its variance
    place = [p.name for p in refit.fitted].index("linear_drag")
    assert refit.covariance[place, place] > (nearest.evidence.spread * refit.parameters["linear_drag"]) ** 2
    assert not any(" of " in name for name in refit.parameters)


def hidden_normals(seed: int) -> np.ndarray:
    """The normal draws behind the sizes of `falls`."""
    rng = np.random.default_rng(seed)
    rng.uniform(size=20)
    return rng.normal(size=10)


def test_its_error_before_and_after_stands_in_sentence_record_and_report(tmp_path: Path) -> None:
    table = tmp_path / "falls.csv"
    falls("linear drag, differs", 3).to_csv(table, index=False)
    words = ["calibrate", str(table), "--model", str(MODELS / "balls.py"), "--session", "drop"]
    main([*words, "--specimen", "ball", "--out", str(tmp_path / "out")])
    record = json.loads((tmp_path / "out" / "verdict.json").read_text())
    page = (tmp_path / "out" / "report.html").read_text()
    before, after = (f"{100 * record[f'error_{name}']:.2f} %" for name in ("before", "after"))
    assert f"falls from {before} to {after}" in record["sentence"]
    assert "This is no claim about the cause." in record["sentence"]
    assert record["nearest"]["effect"] == "linear_drag"
    assert len(record["nearest"]["sizes"]) == 10
    assert record["error_after"] < record["error_new_specimen"] < record["error_before"]
    assert "The nearest effect" in page
    assert before in page
    assert after in page
    assert not any("corrected.toml" in step for step in record["next_steps"])


def test_a_form_that_the_held_out_runs_refute_is_withdrawn() -> None:
    model = balls(falls("linear drag, differs", 3))
    test = differing().split.test
    ruined = replace(model, runs=replace(model.runs, y=np.where(test[:, None], model.runs.y + 0.9, model.runs.y)))
    result = calibrate(ruined, draws=200, progress=False)
    assert (result.verdict, result.nearest) == ("unexplained", None)
    first, *_ = withdrawn = result.facts["withdrawn"]
    assert (first["effects"], first["on"]) == (["linear_drag"], result.split.names)
    assert all(claim["error_after"] > claim["error_before"] for claim in withdrawn)
    assert "linear_drag" not in {p.name for p in result.final_refit.fitted}
    assert next_steps(result.facts) != next_steps(differing().facts)


@pytest.mark.parametrize("truth", [*NULLS, *OUTSIDE])
def test_nothing_is_adopted_where_no_form_is_like_it(truth: str) -> None:
    for seed in (0, 1):
        result = verdict(truth, seed, without=("quadratic_drag",))
        assert result.nearest is None
        assert result.to_dict()["nearest"] is None


@pytest.mark.parametrize("truth", ["linear drag, one rate", "quadratic drag, one C_D"])
def test_an_exact_form_is_claimed(truth: str) -> None:
    assert verdict(truth, 1).effects == (truth.split(",")[0].replace(" ", "_"),)


@pytest.mark.rates
@pytest.mark.parametrize("truth", [*NULLS, *DRAGS, *OUTSIDE])
def test_adoptions_are_right_or_rare(truth: str) -> None:
    results = [verdict(truth, seed, without=("quadratic_drag",)) for seed in range(100, 130)]
    adopted = [r for r in results if r.nearest]
    assert (
        len(adopted) <= 1
        if truth in (*NULLS, *OUTSIDE)
        else len(adopted) + sum(map(bool, (r.effects for r in results))) >= 28
    )
    assert sum(not r.held_out_error_falls for r in adopted) <= 1


@pytest.mark.skipif(not MEASURED.exists(), reason="the measured table of falling balls is not here")
@pytest.mark.parametrize("without", [(), ("quadratic_drag",)])
def test_of_real_balls_drag_is_adopted(without: tuple[str, ...]) -> None:
    """Falls from a bridge (de Silva, Higdon, Brunton, Kutz 2020)."""
    result = calibrate(balls(MEASURED, without), progress=False)
    assert result.verdict == "partial"
    assert result.error_before > 0.2
    assert result.error_after < 0.06


def test_a_law_that_is_not_looked_for_is_said() -> None:
    """Beside what differs between repeats none is."""
    table = falls("a bump in depth", 0)
    table["watch"] = np.where(np.random.default_rng(0).random(len(table)) < 0.4, "B", "A")
    table["speed_m_s"] *= np.where(table["watch"] == "B", 1.3, 1.0)

    def describe(*_: object, **__: object) -> None:
        pytest.fail("a law was looked for")

    result = calibrate(balls(table), describe=describe, draws=200, progress=False)
    assert "the speed of watch B is" in result.sentence
    assert "no law was looked for: laws are not fitted beside what differs between repeats" in result.caveats
