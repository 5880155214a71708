"""Effects at their bounds, bent valleys, and noise that nobody declared: what is named, and with which numbers."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from scipy.optimize import minimize_scalar

import softflagella as sf
from calibration.attribution.claim_checks import transfer_p
from calibration.attribution.rules import SURE
from calibration.statistics.fit import fit
from calibration.statistics.study import Study, far_readings
from calibration.words.render import next_steps
from tests.calibration.own_model.test_faults import hand_made
from tests.calibration.statistics.test_fit import runs_of
from tests.shared import shared

Columns = Mapping[str, Any]


def bend(columns: Columns, p: Mapping[str, float]) -> dict[str, Any]:
    """Compute the deflection of a bar clamped at one end."""
    x, lever = columns["x_m"], 0.54 + p["lever"]
    return {"D_mm": 10 * p["c"] * (lever * x**2 - x**3 / 3)}


def bar(least: float = -0.1, sigma: float | None = 0.02) -> sf.Model:
    return sf.Model(
        bend,
        outputs={"D_mm": sf.Output("deflection", unit="mm", kind="difference", sigma=sigma)},
        numbers=[sf.Number("c", 1.3, unit="1/m^2", low=0.1, high=20)],
        effects=[sf.Effect("lever", "lever is another", low=least, high=0.1, unit="m", typical=0.01)],
    )


def bent(lever: float, seed: int = 3, c: float = 4.0) -> pd.DataFrame:
    x = np.round(np.linspace(0.03, 0.5, 28), 3)
    D = bend({"x_m": x}, {"c": c, "lever": lever})["D_mm"] + 0.02 * np.random.default_rng(seed).normal(size=28)
    return pd.DataFrame({"x_m": x, "D_mm": D.round(3)})


@shared
def bar_verdict(lever: float) -> sf.ModelVerdict:
    return sf.calibrate(bent(lever), bar(), progress=False)


@pytest.mark.parametrize("lever", [-0.195, -0.18])
def test_what_is_handed_on_at_a_bound_is_the_best_fit_there(lever: float, tmp_path: Path) -> None:
    verdict, table = bar_verdict(lever), bent(lever)
    assert verdict.corrected["lever"] == -0.1

    def rms(c: float) -> float:
        left = bend(table, {"c": c, "lever": -0.1})["D_mm"] - table["D_mm"]
        return float(np.sqrt(np.mean(left**2)))

    best = minimize_scalar(rms, bounds=(0.1, 20), method="bounded", options={"xatol": 1e-6})
    assert rms(verdict.corrected["c"]) < 1.001 * best.fun
    verdict.save(tmp_path)
    saved = json.loads((tmp_path / "corrected.json").read_text())
    assert saved["numbers"]["c"]["value"] == pytest.approx(best.x, rel=0.005)
    assert saved["numbers"]["c"]["interval"] == verdict.facts["parameters"]["c"]["interval"]


def test_a_form_at_its_bound_that_leaves_more_than_noise_is_no_explanation() -> None:
    verdict = bar_verdict(-0.195)
    assert verdict.verdict == "partial"
    assert "consistent with" not in verdict.sentence
    low, high = verdict.facts["nearest"]["interval"]
    assert low == -0.1 < high < 0
    assert any(
        "lever is another (lever) is held at the end of its range, -0.1" in line for line in verdict.caveats
    )


def test_within_its_range_the_same_effect_is_claimed() -> None:
    verdict = sf.calibrate(bent(-0.195), bar(-0.3), progress=False)
    assert verdict.effects == ("lever",)
    low, high = verdict.facts["parameters"]["lever"]["interval"]
    assert low < -0.195 < high


def water(columns: Columns, p: Mapping[str, float]) -> dict[str, Any]:
    """Compute the temperature of a mug of water that cools by Newton's law, or faster while it is hot."""
    t = columns["time_min"]
    a, e = p["T0"] - p["room"], np.exp(-p["k"] * t)
    y = a * e + p["mug"] * (np.exp(-t / 3) - 1) * e
    return {"temperature_C": p["room"] + p["drift"] * t / 100 + y / (1 + p["hot"] * a / 40 * (1 - e))}


def mug(sigma: float | None = None) -> sf.Model:
    return sf.Model(
        water,
        outputs={"temperature_C": sf.Output("temperature", unit="C", kind="difference", sigma=sigma)},
        numbers=[
            sf.Number("T0", 95, unit="C", low=60, high=100),
            sf.Number("k", 0.02, unit="1/min", low=1e-3, high=0.2),
            sf.Number("room", 23, unit="C", low=15, high=30),
        ],
        effects=[
            sf.Effect("hot", "larger loss while hot", low=0, high=10, typical=0.2),
            sf.Effect("mug", "heat taken by the mug", low=0, high=30, unit="K", typical=3),
            sf.Effect("drift", "room gets warmer", low=-10, high=10, unit="K/100 min", typical=1),
        ],
    )


def cooled(changed: Callable[[Any], Any] = lambda t: 0.0, seed: int = 2, **p: float) -> pd.DataFrame:
    t = np.arange(0.0, 222.0)
    values = {"T0": 97.0, "k": 0.004, "room": 20.0, "hot": 0.0, "mug": 0.0, "drift": 0.0} | p
    noise = 0.1 * np.random.default_rng(seed).normal(size=len(t))
    y = water({"time_min": t}, values)["temperature_C"] + changed(t) + noise
    return pd.DataFrame({"time_min": t, "temperature_C": y.round(2)})


def named(verdict: sf.ModelVerdict) -> list[str]:
    return [turn.named for turn in verdict.attribution.turns if turn.named]


def test_a_flat_valley_that_ends_at_a_bound_is_a_fit() -> None:
    """The mug takes heat in another form than that of the catalogue."""
    heat = lambda t: 5 * (np.exp(-t / 3) - 1) * np.exp(-t / 40)  # noqa: E731
    table = cooled(heat, k=0.0013, room=16.5, hot=10.0)
    verdict = sf.calibrate(table, mug(0.2), progress=False)
    assert named(verdict)[:2] == ["larger loss while hot", "heat taken by the mug"]
    assert verdict.error_after < 0.2 * verdict.error_before
    assert not verdict.not_fitted


@pytest.mark.parametrize("seed", [2, 5])
def test_without_a_declared_noise_the_same_forms_are_named(seed: int) -> None:
    table = cooled(seed=seed, hot=3.0, mug=4.0)
    known, unknown = (sf.calibrate(table, mug(sigma), progress=False) for sigma in (0.1, None))
    assert not unknown.runs.noise_known
    assert set(named(unknown)) == {"larger loss while hot", "heat taken by the mug"}
    assert unknown.corrected["mug"] == pytest.approx(4.0, abs=0.6)
    assert unknown.error_after < 1.5 * known.error_after
    conditions = unknown.errors.of_conditions
    assert conditions is not None
    assert conditions.after < conditions.before


def test_a_pair_of_forms_is_none_where_one_of_them_is_at_the_end_of_its_range() -> None:
    """Of an unknown noise: the other one takes what is left, and everything comes out wrong."""
    narrow = [replace(effect, high=0.5) if effect.name == "hot" else effect for effect in mug().effects]
    table = cooled(seed=2, hot=3.0, mug=4.0)
    verdict = sf.calibrate(table, replace(mug(), effects=narrow), progress=False)
    assert len(named(verdict)) < 2


def test_few_repeats_are_too_few_not_missing() -> None:
    weights, rng = np.repeat([20.0, 50.0, 100.0], [7, 9, 7]), np.random.default_rng(4)
    steps = np.geomspace(15, 300, 9)
    viscosity = np.concatenate([steps[:7], steps, steps[3:], steps[8:]])
    time = 30 * viscosity / (weights - 3.0) * np.exp(0.01 * rng.normal(size=23))
    model = sf.Model(
        lambda c, p: {"time_s": p["constant"] * c["viscosity"] / (c["weight_g"] - p["friction"])},
        outputs={"time_s": sf.Output("time", unit="s")},
        numbers=[sf.Number("constant", 20.0, low=1, high=100)],
        effects=[sf.Effect("friction", "friction", low=-5, high=20, unit="g", typical=2)],
    )
    table = pd.DataFrame({"weight_g": weights, "viscosity": viscosity, "time_s": time})
    verdict = sf.calibrate(table, model, progress=False)
    assert not verdict.runs.noise_known
    assert "of the runs that are fitted are repeats, and without a declared noise 8 are needed" in " ".join(
        verdict.caveats
    )


def diode(columns: Columns, p: Mapping[str, float]) -> dict[str, Any]:
    """Compute the current of a diode in series with an ammeter, whose resistance may be in the reading."""
    current = p["saturation"] * np.expm1(columns["volts_V"] / 0.05)
    return {"current_uA": current / (1 + p["ammeter"] * current * 2e-5)}


def test_as_given_is_not_advised_while_an_effect_halves_the_error() -> None:
    model = sf.Model(
        diode,
        outputs={"current_uA": sf.Output("current", unit="uA")},
        numbers=[sf.Number("saturation", 0.01, unit="uA")],
        effects=[sf.Effect("ammeter", "resistance of the ammeter", low=0, high=1e4, unit="ohm", typical=10)],
    )
    volts = np.linspace(0.05, 0.6, 32)
    true = diode({"volts_V": volts}, {"saturation": 0.012, "ammeter": 100.0})["current_uA"]
    table = pd.DataFrame(
        {"volts_V": volts, "current_uA": true * np.exp(0.1 * np.random.default_rng(1).normal(size=32))}
    )
    verdict = sf.calibrate(table, model, progress=False)
    assert not verdict.runs.noise_known
    assert named(verdict) == ["resistance of the ammeter"]
    low, high = verdict.facts["nearest"]["interval"]
    assert low < 100 < high
    assert verdict.advice == "corrected"
    record = verdict.facts
    worse = {**record, "error_corrected": 1.0, "error_uncalibrated": 0.5}
    halved = replace(verdict, errors=replace(verdict.errors, rms={**verdict.errors.rms, "uncalibrated": 0.0}))
    assert halved.advice == "wait"
    assert "Check the units" not in " ".join(next_steps({**worse, "advice": "wait"}))


def test_a_single_reading_far_off_is_pointed_at() -> None:
    table = bent(0.0)
    clean = sf.calibrate(table, bar(sigma=None), progress=False)
    assert not any("single readings" in line for line in clean.caveats)
    table.loc[11, "D_mm"] += 0.3
    (line,) = (c for c in sf.calibrate(table, bar(sigma=None), progress=False).caveats if "single readings" in c)
    assert "row 12" in line


def test_noise_alone_points_at_no_reading() -> None:
    """In 400 tables of 8 to 60 readings."""
    rng, said = np.random.default_rng(0), 0
    for count in range(8, 60):
        for _ in range(8):
            residual = rng.normal(size=(count, 1))
            said += bool(far_readings(runs_of(residual, np.zeros(count, dtype=np.int64)), residual))
    assert said <= 6


def test_a_claim_of_a_model_of_ones_own_must_carry_over_to_the_other_half_of_its_settings() -> None:
    model = hand_made()
    every = np.ones(len(model.runs.y), dtype=bool)
    (near,) = model.runs.nearer(every)
    assert model.runs.inputs[near].max() < model.runs.inputs[~near].min()
    for far, carries in ((0.0, True), (0.3, False)):
        changed = hand_made(y=model.runs.y + far * ~near[:, None])
        claim = fit(changed, {"v1": 100.0, "wall": 0.5}, ("v1", "wall"), every, title="")
        assert (transfer_p(Study.fitted_to(changed, every, seed=1), claim) >= SURE) == carries


def test_conditions_that_alone_determine_a_size_refute_no_claim() -> None:
    """Without the first minutes, which are held out as an end of the settings, the mug may be any."""
    table = cooled(seed=0, T0=82.31, k=0.01698, room=22.41, mug=6.46, drift=3.44)
    verdict = sf.calibrate(table, mug(0.1), progress=False)
    assert set(verdict.effects) == {"mug", "drift"}
    assert not verdict.withdrawn


@pytest.mark.parametrize(
    ("sigma", "seed", "truth"),
    [
        (0.1, 4, {"T0": 92.16, "k": 0.0093, "room": 20.18, "hot": 2.40, "drift": 2.07}),
        (None, 1, {"T0": 95.92, "k": 0.02168, "room": 24.64, "hot": 2.58, "drift": -2.55}),
    ],
    ids=["a valley that a linear step leaves", "a valley of an earlier turn"],
)
def test_what_is_handed_on_is_fitted_to_all_runs(sigma: float | None, seed: int, truth: dict[str, float]) -> None:
    table = cooled(seed=seed, **truth)
    corrected = sf.calibrate(table, mug(sigma), progress=False).corrected
    left = (
        water(table, {"hot": 0.0, "mug": 0.0, "drift": 0.0, **corrected})["temperature_C"] - table["temperature_C"]
    )
    assert set(corrected) >= {"hot", "drift"}
    assert np.sqrt(np.mean(left**2)) < 0.11  # of noise 0.1
