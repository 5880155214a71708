"""Laws that no effect of the catalogue states, in tables of the toy robot, and their exponents in words."""

from __future__ import annotations

import re
from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np
import pandas as pd
import pytest

from calibration.attribution.hypothesis import Hypothesis, Reason
from calibration.laws.law_model import LEVER, SIZE, LawModel, moved_parameter, with_law
from calibration.laws.laws import UNDETERMINED, elsewhere, gain
from calibration.laws.places import in_common, place_named, places
from calibration.laws.readings import EXPONENTS, in_words, logarithms, motion_patterns, readings
from calibration.robot.corrected_robot import law_handed_on, robot_with_law
from calibration.statistics.forward import by_differences, derivatives
from calibration.statistics.statistical_model import start_values
from calibration.statistics.study import errors
from calibration.swimmer.measured_table import read_measurements
from common.arrays import Floats
from common.units import Sigma
from sim.effects import effect_named
from sim.inputs import group_columns
from tests.calibration import toy
from tests.calibration.toy_tables import (
    FEW_PLACES,
    START,
    TRUTH,
    laws_of,
    laws_of_toy,
    toy_swimmer,
    toy_table,
)

LAWS = {
    "Cyr": {"law_Cyr_speed500_length-500_tails0": 1.0},
    "Mz_wh": {"law_Mz_wh_speed1000_length-1000_tails0": 5.0},
    "Fx_wt_at_l": {"law_Fx_wt_l-500_speed0_length0_tails1000": 3.0},
    "Mz_wt_odd": {"law_Mz_wt_rectified_speed0_length1000_tails0": 25.0},
    "tail_drag_along": {"law_tail_drag_along_speed1000_length0_tails0": 0.3},
}
WARMER = 0.05  # of C_yr, per kelvin


PLACES = ("Cyr", "Ct", "Fx_wt")


def test_a_law_may_multiply_a_number_that_is_exact() -> None:
    model = toy_swimmer(toy_table(1, lengths_cm=(8.0,)))
    exact = replace(model, robot=replace(model.robot, sigmas={"viscosity": Sigma(0.0, True)}))
    assert "viscosity" not in start_values(exact)
    along = [moved_parameter(model.robot, "viscosity")]
    slopes = [derivatives(m, start_values(m), along)[1] for m in (model, exact)]
    assert np.abs(slopes[0]).max() > 0.01
    np.testing.assert_allclose(slopes[0], slopes[1], atol=1e-9)


@pytest.mark.slow
def test_derivatives_are_those_by_differences() -> None:
    table = toy_table(1, lengths_cm=(5.0, 8.0), design={"tails": (2, 4)})
    for place in places():
        model = LawModel.of(toy_swimmer(table), place, 0.1)
        values = {SIZE: 0.1, LEVER: place.levers[0], **dict(zip(EXPONENTS, (0.3, -0.4, 0.2), strict=True))}
        law = {p.name: values[p.name] for p in model.effects}
        names = ["C_yr", *law]
        parameters = {**start_values(model), **law}
        seen, slopes = derivatives(model, parameters, names)
        other_seen, other = by_differences(model, parameters, names)
        np.testing.assert_allclose(seen, other_seen, atol=1e-9, err_msg=place.name)
        largest = np.abs(slopes).max()
        np.testing.assert_allclose(slopes, other, rtol=0.06, atol=2e-3 * largest, err_msg=place.name)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "places"),
    [
        *((name, FEW_PLACES) for name in ("Cyr", "Mz_wh", "Fx_wt_at_l")),
        *(pytest.param(name, (), marks=pytest.mark.rates) for name in LAWS),
    ],
    ids=lambda value: value if isinstance(value, str) else "few" if value else "all",
)
def test_a_law_is_found_at_its_place_with_its_exponents(name: str, places: tuple[str, ...]) -> None:
    study, base, found = laws_of_toy(4, places=places, **LAWS[name])
    kept = {law.model.place.name: law for law in found.kept}
    assert name in kept
    law = kept[name]
    (effect,) = LAWS[name]
    for exponent, true in zip(EXPONENTS, vars(effect_named(effect).powers).values(), strict=True):
        low, high = law.fit.interval(exponent)
        margin = high - low  # the interval is one of 95 %
        assert low - margin / 2 < true < high + margin / 2
    without = errors(law.model.runs, base.prediction, study.split.test)[0]
    assert law.evidence.held_out_error[0] < min(0.7 * without, 1.2 * base.noise.rms)
    assert "described by" in found.sentence
    record = next(one for one in found.to_dict()["laws"] if one["place"] == name)
    speeds = toy_table(4)["omega_rpm"].abs()
    assert record["runs"]["omega_rpm"] == pytest.approx([speeds.min(), speeds.max()])
    robot = robot_with_law(START, law, law.fit.parameters)  # it moves as the fit says
    runs = law.model.robots(law.fit.parameters)
    for row in (0, 17):
        fitted = runs[row]
        same = replace(robot, tails=fitted.tails, tail_length=fitted.tail_length, motor_speed=fitted.motor_speed)
        motions = (
            toy.steady_columns({key: np.array([a[0]]) for key, a in group_columns([same]).items()}),
            toy.steady_columns(group_columns([fitted])),
        )
        assert motions[0]["omega_yr_bar"][0] == pytest.approx(motions[1]["omega_yr_bar"][0], rel=2e-3)


@pytest.mark.slow
def test_the_lever_of_a_side_force_is_found_and_handed_on() -> None:
    """What is handed on is a force and a couple, whose uncertainty has that of the lever."""
    study, _, found = laws_of_toy(4, **LAWS["Fx_wt_at_l"])
    law = found.kept[0]
    low, high = law.fit.interval(LEVER)
    assert low < -0.5 < high < -0.2
    assert "l (" in law.words
    assert "behind the disc" in law.words
    robot, known = law_handed_on(START, law, study.split.kept)
    force, couple = robot.effects
    assert (force[:10], couple[:10]) == ("law_Fx_wt_", "law_My_wt_")
    errors = {
        name: known.covariance[i, i] ** 0.5 / abs(robot.effects[name])
        for i, name in enumerate(known.names) if name in robot.effects
    }  # fmt: skip
    at = [law.fit.names.index(name) for name in (SIZE, LEVER)]
    relative = law.fit.covariance[np.ix_(at, at)] / np.outer(*[[law.fit.parameters[n] for n in (SIZE, LEVER)]] * 2)
    assert errors[couple] == pytest.approx(relative.sum() ** 0.5, rel=0.3)
    assert abs(errors[couple] / errors[force] - 1) > 0.2


@pytest.mark.slow
def test_a_law_depends_on_what_the_table_notes() -> None:
    tables = []
    for seed, kelvin in enumerate((-5.0, 0.0, 5.0)):
        robot = replace(TRUTH, C_yr=TRUTH.C_yr * float(np.exp(WARMER * kelvin)))
        table = toy_table(seed, truth=robot, lengths_cm=(6.0, 9.0))
        tables.append(table.assign(temperature_C=20.0 + kelvin))
    table = pd.concat(tables, ignore_index=True).assign(run=range(1, 1 + sum(map(len, tables))))
    study, _, found = laws_of(table, PLACES)
    law = found.kept[0]
    assert law.model.place.name == "Cyr"
    low, high = law.fit.interval("law_temperature_K")
    assert low < WARMER < high < 2 * WARMER
    assert "an exponential of the temperature" in law.words
    assert "per K" in law.words
    robot = law_handed_on(START, law, study.split.kept)[0]
    assert robot.C_yr == pytest.approx(TRUTH.C_yr, rel=0.1)
    again = with_law(toy_swimmer(toy_table(1)), law.law)  # a table that notes no temperature
    assert again.factor(law.fit.parameters) == pytest.approx(np.ones(len(again.runs)), rel=0.2)


@pytest.mark.rest
def test_a_factor_in_the_speed_of_the_robot_is_read_from_the_inputs() -> None:
    """C_yr ∝ |v|^−0.5, which no law of the search states; each run has the C_yr of its own speed."""
    parts = []
    for seed, (tails, length, speed) in enumerate(product((2, 3, 4, 5), (5.0, 7.0, 9.0, 11.0), (100.0, 150.0))):
        cell = {"tails": (tails,), "motor_rpm": (speed,), "session_noise": 0.0}
        robot = TRUTH
        for _ in range(20):
            still = toy_table(0, truth=robot, lengths_cm=(length,), design={**cell, "noise": 0.0}).iloc[0]
            swims = abs(still["omega_yr_rad_s"]) * still["R_yr_cm"]
            robot = replace(TRUTH, C_yr=TRUTH.C_yr * float(swims / 4.0) ** -0.5)
        parts.append(toy_table(100 + seed, truth=robot, lengths_cm=(length,), design=cell))
    table = pd.concat(parts, ignore_index=True).assign(run=range(sum(map(len, parts))))
    law = next(law for law in laws_of(table, PLACES).laws.kept if law.model.place.name == "Cyr")
    power = re.search(r"\|v\|\^(-[\d.]+) \((-[\d.]+) to (-[\d.]+)\)", law.words)
    _, low, high = map(float, power.groups())
    assert low < -0.5 < high


@pytest.mark.slow
def test_a_side_force_at_the_disc_says_how_far_from_it_it_may_act() -> None:
    laws = laws_of_toy(5, places=("Fx_wt", "Fx_wt_at_l"), law_Fx_wt_speed0_length0_tails1000=4.0).laws
    law = next(law for law in laws.kept if law.model.place.name == "Fx_wt")
    (behind,) = (one for one in elsewhere(law, laws.fitted) if one.model.place.name == "Fx_wt_at_l")
    assert behind.reason is Reason.NO_LEVER
    low, high = behind.fit.interval(LEVER)
    assert low < 0.0 < high
    assert f"at the disc or up to {-low:.2f} l behind" in law.words


def test_what_the_runs_do_not_exclude_stays_in_the_set() -> None:
    """A law that fits better, but does not predict sessions, and one whose numbers the runs do not determine."""
    laws = laws_of_toy(4, **LAWS["Cyr"]).laws
    best = laws.kept[0]
    at_ct = replace(best.fit, model=replace(best.model, place=place_named("Ct")))
    worse = replace(best, fit=at_ct).seen(bic_gain=gain(best) - 1)
    far = worse.seen(bic_gain=gain(best) - 10)

    def kept(*fitted: Hypothesis, price: float = 0.0) -> list[str]:
        return [law.model.place.name for law in replace(laws, fitted=fitted, price=price).kept]

    def with_lever(law: Hypothesis) -> Hypothesis:
        return replace(law, fit=replace(law.fit, names=(*law.fit.names, LEVER)))

    assert kept(replace(best, reason=Reason.NOT_PREDICTIVE), worse) == ["Ct", "Cyr"]
    for reason in UNDETERMINED:
        assert kept(replace(best, reason=reason), worse) == ["Ct", "Cyr"]
        assert kept(best, replace(worse, reason=reason)) == ["Cyr", "Ct"]
        assert kept(best, replace(far, reason=reason)) == ["Cyr"]
    assert kept(replace(best, reason=Reason.NO_GAIN), worse) == ["Ct"]
    assert kept(best, replace(worse, reason=Reason.NOT_PREDICTIVE)) == ["Cyr"]
    assert kept(best, far) == ["Cyr"]
    assert kept(best, with_lever(far), price=6.0) == ["Cyr", "Ct"]
    assert kept(with_lever(best), worse, price=7.0) == ["Cyr", "Ct"]


@pytest.mark.parametrize(
    ("names", "said"),
    [
        (("Fz_wt", "Fz_vx"), "are a force along the axis"),
        (("Ct", "Cyr"), "act on the head"),
        (("tail_drag", "tail_stiffness"), "act on the tails"),
        (("Fx_wt_at_l", "Fx_wt"), ""),
        (("Fx_wt_at_L", "Fx_wt_odd"), "act on the head, driven by the spin of the tails ω_t"),
    ],
)
def test_what_they_have_in_common_is_said(names: tuple[str, ...], said: str) -> None:
    assert in_common([place_named(name) for name in names]) == said


def test_places_have_names_of_their_own() -> None:
    assert len({place.name for place in places()}) == len(places()) == 61
    assert len(places(both_directions=False)) == 40
    with pytest.raises(KeyError):
        place_named("no such place")


NARROW = np.diag([0.01, 0.02, 0.03]) ** 2


SPEED = {"|v|": (0.85, -0.31, 0.60)}


def said(
    exponents: tuple[float, ...], covariance: Floats = NARROW, inputs: str = "ωlN", motion: Any = None
) -> str:
    errors = 1.96 * np.sqrt(np.diag(covariance))
    intervals = [(value - error, value + error) for value, error in zip(exponents, errors, strict=True)]
    return in_words(list(inputs), np.array(exponents), covariance, intervals, motion or {})


def test_the_power_is_that_of_generalised_least_squares() -> None:
    (reading,) = readings(["ω", "l"], np.array([0.11, 0.40]), NARROW[:2, :2])
    weights = np.array([1.0, 4.0]) / np.array([0.01, 0.02]) ** 2
    assert reading.power == pytest.approx((weights @ [0.11, 0.40]) / (weights @ [1.0, 4.0]))
    assert reading.error == pytest.approx((weights @ [1.0, 4.0]) ** -0.5)


@pytest.mark.parametrize(
    ("words", "parts"),
    [
        (
            said((0.105, 0.41, 0.02)),
            ("in proportion to ω̄^0.10 (0.09 to 0.11)", "independent of N within"),
        ),
        (
            said((0.5, 0.01, 0.02)),
            ("in proportion to ω^0.50 (0.48 to 0.52), independent of l and N within",),
        ),
        (said((0.3, -0.6, 0.02)), ("ω^0.30 (0.28 to 0.32) l^-0.60 (-0.64 to -0.56)", "independent of N within")),
        (said((0.2, 0.4, 0.01), np.diag([0.4, 0.05, 0.03]) ** 2), ("l^", "ω̄^", "or as well to")),
        (said((0.3,), NARROW[1:2, 1:2], "l"), ("in proportion to l^0.30 (0.26 to 0.34)",)),
        (said((0.001, 0.002, 0.003)), ("independent of ω, l and N within the intervals",)),
    ],
    ids=["dimensionless speed", "one input", "no quantity", "several quantities", "inputs alike", "no dependence"],
)
def test_exponents_are_said_as_powers_of_quantities(words: str, parts: tuple[str, ...]) -> None:
    assert all(part in words for part in parts), words
    assert said((), np.zeros((0, 0)), "") == ""


def test_the_motion_is_named_beside_the_inputs_where_no_quantity_of_the_inputs_is_nearer() -> None:
    words = said((0.43, -0.15, 0.30), motion=SPEED)
    assert words.startswith(
        "in proportion to ω^0.43 (0.41 to 0.45) l^-0.15 (-0.19 to -0.11) N^0.30 (0.24 to 0.36)"
    )
    assert ", or as well to |v|^0.50 (0.48 to 0.53)" in words
    assert "|v|" not in said((0.105, 0.41, 0.02), motion=SPEED)
    assert "|v|" not in said((0.43, 0.15, 0.30), motion=SPEED)
    assert "|v|" not in said((0.001, 0.002, 0.003), motion=SPEED)
    assert "|v|" in said((0.43, -0.15, 0.30), 400 * NARROW, motion=SPEED)
    assert "|v|" not in said((0.43, 0.0, 0.0), 400 * NARROW, motion=SPEED)


@pytest.mark.parametrize("with_speed", [False, True])
def test_the_motion_follows_the_inputs_as_its_exponents_say(with_speed: bool) -> None:
    """The slopes of a plane, here by the normal equations, from the outputs of a table with little noise."""
    table = toy_table(1, lengths_cm=(5.0, 7.0, 9.0, 11.0), design={"noise": 1e-4, "session_noise": 0.0})
    if with_speed:
        noise = np.exp(np.random.default_rng(0).normal(scale=1e-4, size=len(table)))
        table["v_cm_s"] = table["omega_yr_rad_s"].abs() * table["R_yr_cm"] * noise
    runs = read_measurements(table)
    patterns = motion_patterns(logarithms(runs), runs.outputs, runs.y)
    assert set(patterns) == {"ω_h", "ω_t", "ω_yr", "|v|"}
    speed = np.log(np.abs(table["omega_yr_rad_s"]) * table["R_yr_cm"]).to_numpy()
    inputs = np.log(np.stack([table["omega_rpm"].abs(), table["l_cm"], table["N"]], 1))
    plane = np.column_stack([np.ones(len(inputs)), inputs])
    assert patterns["|v|"] == pytest.approx(np.linalg.solve(plane.T @ plane, plane.T @ speed)[1:], abs=1e-3)


def test_what_is_no_power_law_is_no_pattern() -> None:
    speeds = np.linspace(50.0, 150.0, 40)
    inputs = np.column_stack([np.log(speeds), np.zeros(40), np.zeros(40)])
    resonance = 1 / (1 + ((speeds - 100) / 20) ** 2)
    spins = np.column_stack([np.log(resonance), 0.7 * np.log(speeds)])
    patterns = motion_patterns(inputs, ("omega_h", "omega_t"), spins)
    assert set(patterns) == {"ω_t"}
    assert patterns["ω_t"] == pytest.approx((0.7, 0.0, 0.0))
