"""Curves along an input: the test of the power law, the smooth curve with its band, and the names."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from functools import cache

import numpy as np
import pandas as pd
import pytest

from calibration.laws import laws
from calibration.laws.curves import Curve, _curve, chosen, find_curves, named_curves
from calibration.laws.group_factors import GroupFactors, _linear_models, _LinearModel
from calibration.laws.law_model import SIZE, LawModel
from calibration.laws.laws import dependences
from calibration.laws.places import place_named
from calibration.report.figures import draw_dependences
from calibration.report.report import figures_of_laws
from calibration.report.robot_verdict import find_robot_laws
from calibration.statistics.fit import Fit, fit
from calibration.statistics.gls import SESSION_SHARE, Noise, repeat_covariance
from calibration.statistics.statistical_model import precisions, start_values
from calibration.statistics.study import Study, middle_session
from common.arrays import Floats
from sim.model.laws import Powers
from tests.calibration.toy_tables import START, on_the_toy, toy_swimmer, toy_table
from tests.shared import shared

SPEEDS = (80.0, 90.0, 100.0, 110.0, 120.0, 130.0, 140.0, 150.0)
VALUES = 1000
PLACE = "My_wt"
SIZES = {"resonance": 2.0, "threshold": 12.0, "power": 1.0}


def groups(factor: Floats, *, is_term: bool = True, error: float = 0.02, exponent: float = 0.0) -> GroupFactors:
    """Factors without noise at the speeds, over those of a law with an exponent."""
    x = np.log(SPEEDS) - np.log(SPEEDS).mean()
    ratio = factor / np.exp(exponent * x)
    information = np.eye(len(x)) / error**2
    if not is_term:  # nothing is known about a common factor
        information -= 1 / len(x) / error**2
    shifts = ratio - 1 if is_term else np.log(ratio) - np.log(ratio).mean()
    return GroupFactors("ω", x, float(np.log(SPEEDS).mean()), exponent, is_term, shifts, information, 99.0, 0.001)


def table_of(kind: str) -> pd.DataFrame:
    """A couple on the head from the spin of the tails: a resonance at 112 rpm, a threshold at 95, or a power."""
    name = place_named(PLACE).law(Powers()).name
    u = np.array(SPEEDS)
    shapes = {"resonance": 100 / ((u - 112) ** 2 + 100), "threshold": np.maximum(u / 95 - 1, 0), "power": u / 110}
    sizes, design = (SIZES[kind] * shapes[kind]).tolist(), {"motor_rpm": SPEEDS}
    tables = [toy_table(5, lengths_cm=(6.0, 9.0), design=design, **{name: size}) for size in sizes]
    whole = tables[0].copy()
    for speed, table in zip(SPEEDS, tables, strict=True):
        rows = whole["omega_rpm"].abs() == speed
        whole[rows] = table[rows]
    return whole


@shared
def fitted(kind: str) -> tuple[Study, Fit]:
    """The power law at the true place."""
    with on_the_toy():
        model = LawModel.of(toy_swimmer(table_of(kind)), place_named(PLACE), 1.0)
        names = tuple(p.name for p in (*model.coefficients, *model.nuisances, *model.effects))
        start = {**start_values(model), SIZE: SIZES[kind] / 2}
        used = ~middle_session(model.runs)
        return Study.fitted_to(model, used), fit(model, start, names, used, title="")


@cache
def curves(kind: str) -> tuple[Curve, ...]:
    """The curves that the runs ask for."""
    return find_curves(*fitted(kind), draws=299)


def along_speed(kind: str) -> Curve:
    return next(curve for curve in curves(kind) if curve.symbol == "ω")


def linear_model(kind: str) -> _LinearModel:
    study, fit_of_law = fitted(kind)
    assert isinstance(study.model, LawModel)
    return next(one for one in _linear_models(study.model, fit_of_law, study.split.fitted) if one.place == 0)


@pytest.mark.slow
def test_a_true_power_law_is_not_rejected() -> None:
    asked = curves("power")
    assert [curve.symbol for curve in asked] == ["ω", "N"]  # there are two lengths only
    for curve in asked:
        assert not curve.contradicted
        assert curve.fits == ()
        assert curve.words == ""


@pytest.mark.parametrize(("kind", "at"), [("resonance", 112.0), ("threshold", 95.0)])
def test_a_curve_is_found_and_named(kind: str, at: float) -> None:
    curve = along_speed(kind)
    assert curve.rejected
    first = curve.named[0]
    assert first.name == kind
    assert 30 / math.pi * first.numbers["u0"] == pytest.approx(at, abs=4)
    assert curve.words.startswith(f"no power law (p = {curve.p_value:.2g})")
    assert f"like {first.words} at" in curve.words
    record = json.loads(json.dumps(curve.to_dict()))
    assert record["input"] == "omega_rpm"
    assert record["power_law_rejected"]
    assert record["named"][0] == kind
    np.testing.assert_allclose(record["values"], SPEEDS, rtol=1e-3)
    assert record["curves"][0]["numbers"]["u0"]["value"] == pytest.approx(at, abs=4)
    leaves_more = replace(curve, left=0.001)
    assert (leaves_more.contradicted, leaves_more.rejected) == (True, False)
    assert (leaves_more.words, leaves_more.named) == ("", ())
    if kind == "resonance":
        assert curve.turn[0] == "maximum"
        assert 30 / math.pi * curve.turn[1] == pytest.approx(112, abs=5)


@pytest.mark.slow
def test_a_law_with_a_curve_stands_in_the_sentence_the_record_and_the_picture(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(laws, "places", lambda **_: tuple(map(place_named, (PLACE, "Fz_vz"))))
    with on_the_toy():
        described = find_robot_laws(table_of("threshold"), START, progress=False)
    law = described.laws.curved
    assert law.place.name == PLACE
    assert "is no power law" in described.sentence
    assert "like a threshold at 9" in described.sentence
    (record,) = [one for one in described.to_dict()["laws"] if one["place"] == PLACE]
    assert [one["input"] for one in record["curves"]] == ["omega_rpm", "N"]
    shown = dependences(law, described.study.split.fitted)
    axes = draw_dependences(shown).axes
    assert [one.get_legend() is not None for one in axes] == [curve.curve is not None for curve in shown]
    assert "--" in [line.get_linestyle() for line in axes[0].lines]
    used = described.study.split.fitted
    assert set(figures_of_laws(described.laws, used)) == {"law"}  # it is the best law, which is shown anyway
    none_kept = replace(described.laws, fitted=(replace(law, reason="a number is at the end of its range"),))
    assert "With a curve in place of a power law, it is described by a couple on the head" in none_kept.sentence
    assert set(figures_of_laws(none_kept, used)) == {"curved"}


def test_the_gain_is_that_of_dense_least_squares() -> None:
    """With the covariance of all runs written out, for a scatter of the sessions that is at its limit."""
    whole = linear_model("threshold")
    linear = replace(whole, session=np.zeros(len(whole.session), dtype=int))  # one session: ρ is at its limit
    run = repeat_covariance(linear.as_given, linear.repeated)
    inverse = np.linalg.inv(Noise(run, SESSION_SHARE).covariance(linear.session))
    free = linear.load[..., None] * (linear.members @ linear.contrasts)[:, None]
    law = linear.load[..., None] * np.stack([np.ones_like(linear.x), linear.x], 1)[:, None]
    columns = np.concatenate([linear.J, law, free], -1)
    flat, y = columns.reshape(-1, columns.shape[-1]), linear.as_given.reshape(-1)
    prior = np.r_[precisions([linear.fitted.fitted[i] for i in linear.others]), np.zeros(2 + free.shape[-1])]

    def least(count: int) -> float:
        A = flat[:, :count].T @ inverse @ flat[:, :count] + np.diag(prior[:count])
        b = flat[:, :count].T @ inverse @ y
        return float(y @ inverse @ y - b @ np.linalg.solve(A, b))

    dense = least(columns.shape[-1] - free.shape[-1]) - least(columns.shape[-1])
    assert float(linear.gain(linear.as_given[None])[0]) == pytest.approx(dense, rel=1e-3)
    power = linear_model("power")
    noise = power.fitted.noise
    null = power.gain(power.tested.draw(np.random.default_rng(3), noise.run, np.tile(noise.share, (400, 1))))
    freedom = len(SPEEDS) - 2
    assert null.mean() == pytest.approx(freedom, abs=4 * math.sqrt(2 * freedom / 400) + 0.5)
    study, fit_of_law = fitted("power")  # curves are looked for in a law alone
    with pytest.raises(TypeError, match="LawModel"):
        find_curves(replace(study, model=toy_swimmer(table_of("power"))), fit_of_law)


U = np.array(SPEEDS)


@pytest.mark.parametrize(
    ("name", "factor", "number", "value", "kinds"),
    [
        ("exponential", np.exp(0.05 * U) / 100, "k", 0.05, (True, False)),
        ("saturation", U / (1 + U / 20), "u0", 20.0, (True, False)),
        ("kink", 1 + 4 * np.maximum(U / 104 - 1, 0), "u0", 104.0, (True, False)),
        ("resonance", 1 + 3 * 64 / ((U - 123) ** 2 + 64), "u0", 123.0, (False,)),
        ("resonance", 3 * 64 / ((U - 123) ** 2 + 64), "u0", 123.0, (True,)),
        ("threshold", 3 * np.maximum(U / 104 - 1, 0), "u0", 104.0, (True,)),  # a coefficient of 0 has no logarithm
    ],
    ids=["exponential", "saturation", "kink", "resonance of a coefficient", "resonance of a term", "threshold"],
)
def test_each_family_is_recognised(
    name: str, factor: Floats, number: str, value: float, kinds: tuple[bool, ...]
) -> None:
    for is_term in kinds:
        error = 0.002 if name in {"exponential", "saturation"} else 0.02
        given = groups(factor / factor.mean(), is_term=is_term, error=error)
        (first, *_) = chosen(named_curves(given, VALUES))
        assert first.name == name
        assert first.acceptable
        assert first.numbers[number] == pytest.approx(value, rel=0.03)
        low, high = first.intervals[number]
        assert low < value < high
        relative = first.factor(given.inputs) / first.factor(given.inputs[-1:])
        np.testing.assert_allclose(relative, factor / factor[-1], atol=0.02)


@pytest.mark.parametrize("is_term", [True, False], ids=["term", "factor"])
def test_a_power_law_gets_no_other_name_and_its_spline_is_a_power_law(is_term: bool) -> None:
    given = groups((U / 110) ** 1.7, is_term=is_term, exponent=1.2)
    fits = named_curves(given, VALUES)
    assert fits[0].name == "power"
    assert fits[0].numbers["p"] == pytest.approx(1.7, abs=1e-3)
    assert chosen(fits) == []
    curve = _curve(groups((U / 110) ** 1.25, is_term=is_term, exponent=1.2), VALUES, 0.0, 1)
    assert curve.freedom == pytest.approx(2, abs=0.1)
    slope = np.polyfit(np.log(curve.inputs), np.log(curve.factor), 1)[0]
    assert slope == pytest.approx(1.25, abs=0.02)
    assert ((curve.low < curve.factor) & (curve.factor < curve.high)).all()


def test_no_resonance_is_claimed_at_the_end_of_the_range() -> None:
    """There a factor that rises to the last value is no less like one of many others."""
    for is_term in (True, False):
        factor = 3 * 64 / ((U - U[-1]) ** 2 + 64) + (not is_term)
        fits = named_curves(groups(factor / factor.mean(), is_term=is_term), VALUES)
        resonance = next(one for one in fits if one.name == "resonance")
        assert resonance.p_value > 0.05
        assert resonance.at_an_end
        assert resonance not in chosen(fits)


def test_what_no_family_can_say_gets_no_name() -> None:
    """Zigzags are no simple curve; families with more numbers than the values can test are left out."""
    fits = named_curves(groups(1 + 0.3 * (-1.0) ** np.arange(len(U))), VALUES)
    assert not any(one.acceptable for one in fits)
    assert chosen(fits) == []
    whole = groups((U / 110) ** 2)
    few = replace(whole, x=whole.x[:3], shifts=whole.shifts[:3], information=whole.information[:3, :3])
    assert {one.name for one in named_curves(few, VALUES)} == {"power", "exponential", "saturation", "threshold"}


def test_a_level_that_is_unknown_is_that_of_the_law() -> None:
    """And what the runs determine stays."""
    given = groups((U / 110) ** 2)
    common = np.ones(len(U)) / math.sqrt(len(U))
    unknown = (1 - 1e-6) * given.information[0, 0] * np.outer(common, common)
    vague = replace(given, information=given.information - unknown)
    shown = vague.levelled()
    assert vague.errors.min() > 3
    assert shown.errors.max() < 0.03
    assert shown.shifts.mean() == pytest.approx(0, abs=1e-6)
    np.testing.assert_allclose(np.diff(shown.shifts), np.diff(given.shifts), atol=1e-6)
    assert given.levelled() is given
