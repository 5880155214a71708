"""A verdict with a law: what it says, the robot that it hands on, and who refuses this robot."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from calibration.attribution.rules import INDISTINGUISHABLE
from calibration.findings.next_runs import BATCH, Explanation, next_runs, standings
from calibration.laws.group_factors import group_factors
from calibration.laws.law_model import SIZE, LawModel, with_law
from calibration.laws.laws import Laws, find_laws
from calibration.laws.places import place_named
from calibration.laws.readings import EXPONENTS
from calibration.report.figures import draw_factors, draw_place
from calibration.robot.corrected_robot import _slopes, check_given, robot_with_law
from calibration.robot.robot_verdict import RobotVerdict
from calibration.statistics.study import final_refit
from common.errors import InputError
from dataset.robot_inputs import robot_fields
from sim.effects import effect_named
from sim.inputs import group_columns, load_robot, save_robot
from sim.knowledge import read_knowledge
from sim.model.groups import Groups
from sim.model.robot import Robot
from tests.calibration.toy_tables import (
    DRAG,
    FEW_PLACES,
    START,
    calibrated,
    few_places,
    laws_of_toy,
    toy_swimmer,
    toy_table,
    verdict_of,
)
from tests.shared import shared

FOUR = (5.0, 7.0, 9.0, 11.0)  # tail lengths in cm
HIDDEN = {
    "Cyr": {"law_Cyr_speed500_length-500_tails0": 1.0},
    "Mz_wh": {"law_Mz_wh_speed1000_length-1000_tails0": 5.0},
}


@shared
def described(place: str) -> RobotVerdict:
    table = toy_table(4, lengths_cm=FOUR, **HIDDEN[place])
    with few_places((*FEW_PLACES, "Cr")):
        return verdict_of(calibrated(table, few=True, describe=find_laws))


@shared
def claimed_beside_laws() -> RobotVerdict:
    """A weak effect, which something outside the catalogue could imitate."""
    table = toy_table(3, **{DRAG: 0.6})
    with few_places(("My_wyr", "My_vz", "Fx_vz", "Fx_wyr", "Fx_wh", "Cyr")):
        return verdict_of(calibrated(table, few=True, describe=find_laws))


def laws_of(verdict: RobotVerdict) -> Laws:
    laws = verdict.law
    assert isinstance(laws, Laws)
    return laws


def load_at(robot: Robot, name: str) -> float:
    """Compute ln |ε m| of a term at a robot, or ln C m of the coefficient."""
    law = effect_named(name)
    m = float(law.powers.logarithm(Groups.from_columns(group_columns([robot])))[0])
    return m + math.log(abs(robot.effects[name]) if "_w" in name else robot.C_yr)


@pytest.mark.slow
@pytest.mark.parametrize("place", ["Mz_wh", pytest.param("Cyr", marks=pytest.mark.rest)])
def test_a_law_stands_beside_the_verdict_and_its_files_have_its_range_and_covariance(
    place: str, tmp_path: Path
) -> None:
    verdict = described(place)
    assert verdict.verdict == "unexplained"
    assert verdict.described
    assert verdict.effects == ()
    assert "no effect and no pair of effects of the catalogue explains" in verdict.sentence
    assert "The residual is described by" in verdict.sentence
    assert verdict.errors.rms["law"] < 0.7 * verdict.error_before
    assert place in [law.model.place.name for law in laws_of(verdict).kept]
    record, report, corrected = verdict.save(tmp_path)
    kept = json.loads(record.read_text())["laws"]["kept"]
    assert place in kept
    text = report.read_text()
    assert "Laws that describe the residual" in text
    assert "Where it acts" in text
    robot, known = load_robot(corrected), read_knowledge(corrected)
    assert robot == verdict.corrected
    (name,) = robot.effects
    assert name.startswith(f"law_{kept[0]}")
    assert {"C_t", "C_r", "C_yr"} <= set(known.names)
    assert (name in known.names) == effect_named(name).name.startswith(("law_F", "law_M"))
    assert np.linalg.eigvalsh(known.covariance).min() > -1e-9 * known.covariance.max()


@pytest.mark.slow
def test_an_uncertain_claim_is_set_beside_the_laws_that_fit_as_well(tmp_path: Path) -> None:
    verdict = claimed_beside_laws()
    laws, claim = laws_of(verdict), verdict.final
    assert verdict.verdict == "effect"
    assert verdict.claims[0].doubts
    assert not verdict.described
    as_good = laws.as_good_as(claim)
    assert len(as_good) > 2
    assert all(rival.fit.deviance < claim.deviance + INDISTINGUISHABLE for rival in as_good)
    assert f"It is described as well by {as_good[0].title}; or by {as_good[1].title}" in verdict.sentence
    assert "or by laws at 2 other places." in verdict.sentence
    titles = [e.title for e in verdict.explanations]
    assert titles == ["head's end-over-end drag", *(rival.title for rival in as_good[:3])]
    record, report, corrected = verdict.save(tmp_path)
    assert json.loads(record.read_text())["laws"]["kept"]
    assert not verdict.next_batch.worth_making
    steps = json.loads(record.read_text())["next_steps"]
    assert any(step.startswith("Test the claim where it matters most: make runs with other") for step in steps)
    assert verdict.gain_is_certain is False
    assert steps[0].startswith("Plan with neither robot yet")
    assert "so laws were fitted to the refitted model without it" in report.read_text()
    assert list(load_robot(corrected).effects) == [DRAG]
    assert load_robot(corrected).learnt_from is None


@pytest.mark.slow
def test_what_is_no_rival_does_not_weaken_a_claim() -> None:
    """The claim in other words (end-over-end drag is a couple from the yaw rate), and laws that fit less well."""
    verdict = claimed_beside_laws()
    laws = laws_of(verdict)
    same = next(law for law in laws.kept if law.model.place.name == "My_wyr")
    assert same.fit.deviance == pytest.approx(verdict.final.deviance, abs=0.05)
    assert same.words not in [rival.title for rival in laws.as_good_as(verdict.final)]
    exponents = {one.place.name: set(one.exponents) for one in laws.ranked}
    for law in laws.fitted:  # each with the numbers of its linear model
        assert set(law.fit.names) & set(EXPONENTS) == exponents[law.model.place.name]
    better = replace(verdict.final, deviance=verdict.final.deviance - 100)
    assert laws.as_good_as(better) == ()
    assert laws.to_dict(better)["beside"] == "No law of the places that were searched describes it as well."


@pytest.mark.slow
def test_a_robot_outside_the_runs_is_refused_by_everything(tmp_path: Path) -> None:
    robot = described("Mz_wh").corrected
    robot.group_values()
    for refused, words in (
        (replace(robot, tails=9).group_values, "outside the runs that the robot's law was learnt from"),
        (
            replace(robot, tail_length=3 * robot.tail_length).group_values,
            "outside the runs that the robot's law",
        ),
        (lambda: check_given(robot), r"has a table \[learnt_from\] from an earlier calibration"),
        (lambda: robot_fields(robot), r"has a table \[learnt_from\], which no sweep covers"),
    ):
        with pytest.raises(InputError, match=words):
            refused()
    save_robot(robot, tmp_path / "robot.toml")
    lines = (tmp_path / "robot.toml").read_text().splitlines()
    damages = {"low = [1.0]": "three numbers", "low = 3": "cannot be read", "": "needs the lines low and high"}
    for damage, message in damages.items():
        damaged = [damage if line.startswith("low =") else line for line in lines]
        (tmp_path / "damaged.toml").write_text("\n".join(damaged))
        with pytest.raises(InputError, match=message):
            load_robot(tmp_path / "damaged.toml")


@pytest.mark.slow
@pytest.mark.parametrize("place", ["Mz_wh", pytest.param("Cyr", marks=pytest.mark.rest)])
def test_the_uncertainty_of_the_exponents_is_that_of_the_load_at_the_robot(place: str) -> None:
    verdict = described(place)
    law = next(one for one in laws_of(verdict).kept if one.model.place.name == place)
    assert set(EXPONENTS) - set(law.fit.names) <= {EXPONENTS[2]}
    final = final_refit(law.fit.refitted(law.model.runs, verdict.split.kept))
    robot = robot_with_law(START, law, final.parameters)
    slopes = next(iter(_slopes(robot, law, final).values()))
    scale = next(iter(robot.effects.values())) if law.model.place.is_term else 1.0
    for name in EXPONENTS:
        loads = []
        for change in (0.1, -0.1):
            moved = robot_with_law(START, law, {**final.parameters, name: final.parameters[name] + change})
            (effect,) = moved.effects
            loads.append(load_at(replace(robot, effects=moved.effects, C_yr=moved.C_yr), effect))
        at = [p.name for p in final.fitted].index(name)
        assert (loads[0] - loads[1]) / 0.2 == pytest.approx(slopes[at] / scale, abs=0.01)


def test_a_law_is_the_same_in_a_table_of_other_runs() -> None:
    """Its factor is 1 at the mean of the runs that it was fitted to, not at that of new ones."""
    table = toy_table(4)
    law = LawModel.of(toy_swimmer(table), place_named("Mz_wh"), 1.0)
    parameters = {p.name: p.start for p in law.coefficients} | {SIZE: 3.0, "law_speed": 0.5, "law_length": -1.0}
    parameters |= {p.name: p.start for p in law.nuisances}
    some = (table["l_cm"] > 6).to_numpy()
    fewer = with_law(toy_swimmer(table[some]), law.record)
    np.testing.assert_allclose(fewer.predict([parameters])[0], law.predict([parameters])[0][some], rtol=1e-12)
    for damage in ({"centre": [0.0]}, {"place": "no such place"}, {"typical": math.nan}):
        with pytest.raises(InputError, match="the record of a law cannot be read"):
            with_law(toy_swimmer(table), {**law.record, **damage})


@pytest.mark.slow
def test_new_runs_decide_between_two_laws() -> None:
    verdict = described("Mz_wh")
    fitted = {law.model.place.name: law for law in laws_of(verdict).fitted}
    pair = [fitted["Mz_wh"], next(law for name, law in fitted.items() if name != "Mz_wh")]
    rivals = [replace(law, said=law.model.place.name) for law in pair]
    batch = next_runs(rivals)[1]
    assert len(batch.settings) == BATCH
    new = toy_swimmer(toy_table(9, lengths_cm=FOUR, **HIDDEN["Mz_wh"]))
    records = [json.loads(json.dumps(Explanation.of(rival).record())) for rival in rivals]
    explanations = [Explanation.read(record) for record in records]
    standing = standings(new, explanations, np.ones(len(new.runs), dtype=bool), with_law)
    assert standing[0].title == "Mz_wh"
    assert standing[1].behind > 0


@pytest.mark.slow
def test_the_runs_at_each_input_lie_on_the_law() -> None:
    found = laws_of_toy(4, **HIDDEN["Cyr"])
    law, used = next(one for one in found.laws.kept if one.model.place.name == "Cyr"), found.study.split.fitted
    inputs = group_factors(law.model, law.fit, used)
    assert [groups.symbol for groups in inputs] == ["ω", "l", "N"]
    pulls = []
    for groups in inputs:
        along, factor, low, high = groups.line()
        assert ((low <= factor) & (factor <= high)).all()
        pulls += list((groups.factors - np.interp(groups.inputs, along, factor)) / groups.errors.mean(0))
    assert 0 < np.abs(pulls).max() < 4
    assert draw_factors(inputs).axes
    one_length = used & (law.model.runs.length == law.model.runs.length[0])  # of which a picture tells nothing
    assert [groups.symbol for groups in group_factors(law.model, law.fit, one_length)] == ["ω", "N"]
    far = replace(law.fit, covariance=1e12 * law.fit.covariance, jacobian=1e-9 * law.fit.jacobian)
    undetermined = group_factors(law.model, far, used)
    for groups in undetermined:
        assert all(np.isfinite(part).all() for part in (*groups.line(), groups.factors, groups.errors))
    draw_factors(undetermined).canvas.draw()
    for place in ("Fx_wh", "Fz_vz", "My_wt", "Mz_wh", "Ct", "Cr", "tail_drag"):
        assert draw_place(START, place_named(place)).axes[0].has_data()
