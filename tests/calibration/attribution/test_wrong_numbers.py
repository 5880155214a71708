"""Claims: what could imitate them, whether they carry over, and nuisance parameters that are off instead."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import binom

import calibration.attribution.claim_checks
from calibration.attribution import rules
from calibration.attribution.claim_checks import (
    SEEN,
    absorbable_shares,
    imitability,
    transfer_p,
)
from calibration.attribution.effects import ebic
from calibration.attribution.hypothesis import Evidence, Hypothesis, Origin, Reason
from calibration.attribution.rules import IMITABLE, RULES, SURE, Trial, doubted
from calibration.attribution.wrong_numbers import notable_pull, pulls
from calibration.robot.corrected_robot import corrected_robot
from calibration.statistics.fit import Fit, fit
from calibration.statistics.forward import by_differences, derivatives
from calibration.statistics.statistical_model import parameter, start_values
from calibration.statistics.study import DRAWS, Study
from calibration.swimmer.influences import CAMERA, HEADING, LENGTH, TACHOMETER
from calibration.swimmer.measured_table import read_measurements
from calibration.swimmer.swimmer import COEFFICIENTS, SwimmerModel
from calibration.swimmer.synthetic_table import make_table
from calibration.verdict import explain
from calibration.verdict.calibrate import calibrate
from common.arrays import Flags, Floats
from common.errors import InputError
from common.units import Sigma
from tests.calibration.toy_tables import (
    DRAG,
    FEW_DRAWS,
    START,
    TRUTH,
    calibrated,
    fit_all,
    install_few_candidates,
    none,
    number,
    on_the_toy,
    toy_swimmer,
    toy_table,
)

SIZE = 3.0
PLAIN = toy_swimmer(toy_table(8))
EVERY = np.ones(len(PLAIN.runs), dtype=bool)


def planted(share: Floats | float) -> SwimmerModel:
    """The model with runs that have the drag by this share (n,)."""
    model = PLAIN
    truth = {**start_values(model), **{name: getattr(TRUTH, name) for name in COEFFICIENTS}}
    clean, present = model.predict([truth, {**truth, DRAG: SIZE}])
    y = model.runs.y + np.broadcast_to(share, len(clean))[:, None] * (present - clean)
    return replace(model, runs=replace(model.runs, y=y))


def claimed(model: SwimmerModel) -> Fit:
    start = {**start_values(model), DRAG: SIZE}
    return fit(model, start, (*COEFFICIENTS, DRAG), EVERY, title="")


def transferred(model: SwimmerModel, used: Flags) -> float:
    return transfer_p(Study.fitted_to(model, used, seed=1), claimed(model))


def test_a_strong_claim_is_hard_to_imitate_and_a_weak_one_is_not() -> None:
    model = toy_swimmer(toy_table(2, **{DRAG: 5.0}), TRUTH)
    shares = absorbable_shares(Study.fitted_to(model, EVERY, seed=1), fit_all(model, EVERY, DRAG), (DRAG,))
    assert ((shares > -1e-9) & (shares < 1)).all()
    assert imitability(shares, SEEN / 2) > IMITABLE > imitability(shares, 20 * SEEN)
    assert imitability(np.array([1.0, 0.5]), 10.0) == 0.5  # what is absorbed whole leaves nothing to notice
    assert imitability(np.array([0.5]), SEEN - 0.1) == 1.0


def test_an_effect_carries_over_from_short_tails_and_few_and_a_mimic_does_not() -> None:
    runs = PLAIN.runs
    (near,) = runs.nearer(EVERY)
    assert set(np.unique(runs.tails[near])) == {2, 3, 4}
    assert set(np.unique(runs.length[near].round(3))) == {0.05, 0.08}
    assert near.sum() == len(near) // 2
    for further, carries in ((1.0, True), (4.0, False)):
        model = planted(np.where(near, 1.0, further))
        assert (transferred(model, EVERY) >= SURE) == carries
    alike = (runs.length < 0.06) & (runs.tails <= 4)
    assert transferred(planted(1.0), alike) == 1.0  # they say nothing


def test_a_claim_that_does_not_carry_over_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(calibration.attribution.claim_checks, "transfer_p", lambda *_, **__: 0.001)
    with on_the_toy(few=True):
        uncertain = calibrate(planted(2.0), draws=FEW_DRAWS, progress=False)
    assert uncertain.effects == (DRAG,)
    assert "or something outside the catalogue" in uncertain.sentence
    assert uncertain.to_dict()["transfer_p"] == [0.001]


def test_an_effect_beside_a_wrong_number_is_in_doubt_and_pairs_pay_for_their_number() -> None:
    """Two effects cost one parameter more, and the logarithm of how many pairs there are."""
    model = PLAIN
    refit = claimed(planted(1.0))
    effect = parameter(model, DRAG)
    study, pull = Study.fitted_to(model, EVERY), object()
    freed = replace(refit, wrong_numbers=((pull,),))  # type: ignore[arg-type]
    sure = Hypothesis(Origin.EFFECT, (effect,), refit, Evidence(imitable=0.0, transfer=0.5), Reason.KEPT)
    assert doubted(sure, Trial(study, refit), RULES).doubts == ()
    assert doubted(replace(sure, origin=Origin.PAIR), Trial(study, refit), RULES).doubts == (Reason.ONE_OF_MANY,)
    cost = ebic(study, refit, 2) - ebic(study, refit, 1)
    assert cost == pytest.approx(2 * math.log((len(model.effects) - 1) / 2))
    assert ebic(study, freed, 2) - ebic(study, refit, 2) == pytest.approx(math.log(study.values))


EXACT = {
    name: Sigma(0.0, False)
    for name in ("viscosity", "tail_radius", "tail_length", "head_radius", "head_length", "disc_offset")
}


@pytest.mark.slow
def test_a_stiffness_that_was_given_too_high_is_no_inertia(monkeypatch: pytest.MonkeyPatch) -> None:
    """Tail drag 25 % above the formula is Young's modulus 20 % below; with the simulator on both sides."""
    install_few_candidates(monkeypatch, ("inertia",))
    softer = replace(TRUTH, youngs_modulus=0.8 * TRUTH.youngs_modulus)
    model = SwimmerModel(START, read_measurements(make_table(softer, seed=5, title="")))
    result = calibrate(model, draws=FEW_DRAWS, progress=False)
    assert "inertia" in {c.effect.name for c in result.attribution.candidates}
    assert "inertia" not in result.effects
    assert result.verdict != "number"
    stiffness = next(p for p in result.pulls if p.parameter.name == "youngs_modulus")
    assert stiffness.alone == pytest.approx(math.log(0.8), abs=2 * stiffness.alone_error)
    assert stiffness.z < -1


@pytest.mark.rates
def test_numbers_drawn_from_their_priors_are_no_effects() -> None:
    """One claim in twenty is stated; more than `most` would come from that once in a hundred times (binomial)."""
    rng = np.random.default_rng(2)
    claimed, covered, count = 0, 0, 24
    names = ("youngs_modulus", "viscosity", "tail_radius", "head_radius", "head_length", "disc_offset")
    for seed in range(count):
        values = {n: float(getattr(TRUTH, n) or TRUTH.head_radius) for n in names}
        drawn = {n: v * math.exp(rng.normal() * START.sigma(n).of(v) / v) for n, v in values.items()}
        table = toy_table(seed, truth=replace(TRUTH, **drawn))
        table["l_cm"] += rng.normal(scale=0.1)
        table["R_yr_cm"] *= math.exp(rng.normal(scale=0.01))
        table["theta_deg"] += rng.normal() * np.sign(table["omega_rpm"])
        result = calibrated(table, draws=DRAWS)
        claimed += bool(result.effects) or result.verdict == "unexplained"
        low, high = result.base.interval("youngs_modulus")
        covered += low < drawn["youngs_modulus"] < high
    most = binom.isf(0.01, count, 0.05)
    assert claimed <= most
    assert count - covered <= most


@pytest.mark.parametrize(("count", "correlation"), [(1, 0.0), (4, 0.0), (10, 0.0), (10, 0.3), (10, 0.9)])
def test_one_table_in_twenty_has_a_notable_pull_by_chance(count: int, correlation: float) -> None:
    """Beyond 2 σ it was one in three: ten pulls have ten chances. Correlated pulls have fewer."""
    tables = 20000
    rng = np.random.default_rng(count)
    common, own = rng.normal(size=(tables, 1)), rng.normal(size=(tables, count))
    farthest = np.abs(math.sqrt(correlation) * common + math.sqrt(1 - correlation) * own).max(1)
    share = float((farthest > notable_pull(count)).mean())
    assert share < 0.05 + 3 * math.sqrt(0.05 * 0.95 / tables)
    assert correlation or share == pytest.approx(0.05, abs=3 * math.sqrt(0.05 * 0.95 / tables))


def test_a_pull_of_two_and_a_half_among_ten_is_not_mentioned() -> None:
    result = none()
    learnt = sum(p.learnt for p in result.pulls)
    for z, named in ((0.99 * notable_pull(learnt), False), (1.01 * notable_pull(learnt), True)):
        pulled = (replace(result.pulls[0], z=z), *result.pulls[1:])
        sentence = replace(result, pulls=pulled).sentence
        assert sentence.startswith(f"{pulled[0].words}.") is named
    assert learnt > 3
    assert 2.2 < notable_pull(learnt) < 3


def test_a_number_beyond_its_tolerance_is_a_finding_of_its_own() -> None:
    """It is said as such, freed, and ahead of every effect."""
    result = number()
    assert result.verdict == "number"
    assert result.effects == ()
    assert CAMERA in {p.parameter.name for p in result.wrong_numbers[0]}
    assert result.sentence.startswith("The runs ask for another value of a nuisance parameter: ")
    assert "No effect is claimed." in result.sentence
    record = result.to_dict()
    assert record["wrong_numbers"][0] == [p.parameter.name for p in result.wrong_numbers[0]]
    assert result.error_after < 1.25 * result.noise_ceiling


def test_an_effect_beside_a_wrong_number_is_found_with_it() -> None:
    """Both are off; neither alone explains the runs."""
    table = toy_table(1, **{DRAG: 1.5})
    table["R_yr_cm"] *= 1.08
    result = calibrated(table, few=True)
    assert result.effects == (DRAG,)
    assert CAMERA in {p.parameter.name for p in result.wrong_numbers[0]}
    assert result.error_after < 1.25 * result.noise_ceiling


def test_a_number_far_beyond_its_tolerance_is_behind_an_effect(monkeypatch: pytest.MonkeyPatch) -> None:
    """A head's length nine of its tolerances off explains as much as the effect that was there."""
    table = toy_table(2, **{DRAG: 0.6})
    result = calibrated(table, few=True)
    assert result.verdict == "ambiguous"
    assert result.effects == ("end_over_end_drag",)
    (rival,) = result.attribution.rival_numbers
    assert rival.parameter.name == "head_length"
    assert rival.tolerances > rules.IMPLAUSIBLE
    assert f"L (head length) that is {rival.departure} (9 of its tolerances)" in result.sentence
    assert result.sentence.index("end-over-end drag") < result.sentence.index("head length")
    titles = [e.title for e in result.explanations]
    assert titles == ["head's end-over-end drag", "the stated value of L (head length) is wrong"]
    record = result.to_dict()
    assert record["numbers_instead"] == ["head_length"]
    assert record["wrong_numbers"] == []
    assert record["next_steps"][2].startswith("Measure L (head length) again")
    for module in (rules, explain):
        monkeypatch.setattr(module, "IMPLAUSIBLE", 2 * rival.tolerances)
    ahead = calibrated(table, few=True)
    assert ahead.verdict == "number"
    assert [c.effect.name for c in ahead.attribution.rival_effects] == ["end_over_end_drag"]


@pytest.mark.rest
def test_a_stiffness_far_off_is_named_with_what_looks_like_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """20 % where E is stated to 3 % and the other numbers to be exact."""
    install_few_candidates(monkeypatch, ("inertia", "tail_spin_drag"))
    share, sigmas = 0.8, {"youngs_modulus": Sigma(0.03, True), **EXACT}
    softer = replace(TRUTH, youngs_modulus=share * TRUTH.youngs_modulus)
    data = read_measurements(make_table(softer, seed=5, title=""))
    result = calibrate(SwimmerModel(replace(START, sigmas=sigmas), data), draws=FEW_DRAWS, progress=False)
    assert result.verdict == "number"
    assert result.wrong_numbers[0][0].parameter.name == "youngs_modulus"
    given = result.final_refit.parameters["youngs_modulus"] / START.youngs_modulus
    assert given == pytest.approx(share, rel=0.1)
    corrected = corrected_robot(START, result.final_refit.parameters)
    assert corrected.youngs_modulus == result.final_refit.parameters["youngs_modulus"]


def test_derivatives_along_numbers_are_those_of_the_prediction() -> None:
    """By the powers of the groups, against differences of predictions; off the nominal parameters."""
    table = toy_table(6)
    speed = table["R_yr_cm"] * table["omega_yr_rad_s"].abs()
    table["v_cm_s"] = speed * np.random.default_rng(0).uniform(0.9, 1.1, len(table))
    model = toy_swimmer(table)
    off = {CAMERA: 1.03, HEADING: 0.02, LENGTH: 0.001, TACHOMETER: 1.01}
    at = {**start_values(model), "tracked_point": 0.2, **off}
    names = [p.name for p in model.nuisances]
    assert len(names) == 10
    ours, J = derivatives(model, at, names)
    theirs, differences = by_differences(model, at, names)
    assert ours == pytest.approx(theirs, abs=1e-9)
    scale = np.maximum(np.abs(differences).max((0, 1)), 1e-9)
    assert (np.abs(J - differences).max((0, 1)) / scale).max() < 0.06


def test_the_derivative_along_the_length_is_one_of_all_tails_where_one_is_shorter() -> None:
    model = toy_swimmer(toy_table(6))
    at = {**start_values(model), "one_tail_shorter": 0.4}
    longer, shorter = model.predict([{**at, LENGTH: by} for by in (1e-6, -1e-6)])
    slope = derivatives(model, at, [LENGTH])[1][..., 0]
    assert slope == pytest.approx((longer - shorter) / 2e-6, abs=1e-3 * np.abs(slope).max())


def test_pulls_are_those_of_the_textbook() -> None:
    """One number, one measurement: x = y σ²/(σ² + s²), pull y/√(σ² + s²), alone y."""
    model = toy_swimmer(toy_table(8))
    bound = fit_all(model)
    for pull in pulls(bound, model.nuisances):
        if pull.learnt:
            total = math.hypot(pull.parameter.sigma, pull.alone_error)
            assert pull.z == pytest.approx(pull.alone / total, rel=1e-6)
            change = pull.alone * (pull.parameter.sigma / total) ** 2
            assert pull.change == pytest.approx(change, rel=1e-6, abs=1e-12)
    bound_pull = {p.parameter.name: p for p in pulls(bound, model.nuisances)}[CAMERA]
    free = fit(model, bound.parameters, bound.names, EVERY, wrong_numbers=((bound_pull,),), title="")
    alone = {p.parameter.name: p for p in pulls(free, model.nuisances)}[CAMERA]
    assert alone.freed
    assert alone.change == pytest.approx(bound_pull.alone, abs=0.1 * bound_pull.alone_error)


def test_exact_numbers_are_not_fitted_and_the_table_states_its_own() -> None:
    table = toy_table(9).assign(camera_scale_sigma_percent=2.0, heading_zero_sigma_deg=0.0)
    model = toy_swimmer(table, replace(START, sigmas=EXACT))
    sigmas = {p.name: p.sigma for p in model.nuisances}
    assert sigmas == {"youngs_modulus": pytest.approx(0.1), CAMERA: 0.02, TACHOMETER: 0.005}
    for bad in (-1.0, np.arange(len(table), dtype=float)):
        with pytest.raises(InputError, match="camera_scale_sigma_percent"):
            read_measurements(table.assign(camera_scale_sigma_percent=bad))
