"""Swims beside a table of runs: both tell of one robot, and each row has the noise of its own kind."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import softflagella as sf
from calibration.linear.gls import Regression
from calibration.robot.robot_verdict import RobotVerdict
from calibration.statistics.fit import fit, variance_factor
from calibration.statistics.forward import derivatives
from calibration.statistics.offsets import Offsets
from calibration.statistics.statistical_model import Experiment, parameter, regression, start_values
from calibration.statistics.study import groups, middle_session
from calibration.swim.joint_model import JointModel, joint_model
from calibration.swim.measured_swim import read_swims
from calibration.swim.swim_model import SwimModel, swim_model
from calibration.swimmer.measured_table import read_measurements
from calibration.swimmer.swimmer import SwimmerModel
from common.arrays import Flags
from common.errors import InputError
from planner.planning.plan import Plan
from sim.model.robot import Robot
from tests.calibration.swim.test_swim_model import CURRENT, KICK, plan_of
from tests.oracles.swims import make_track
from tests.planner.plans import CONTROL

BIAS = 0.05


def truth_of(bias: float) -> Robot:
    if not bias:
        return CONTROL
    off = {"C_t": 1.05 * CONTROL.C_t, "C_r": 0.95 * CONTROL.C_r, "C_yr": 1.05 * CONTROL.C_yr}
    return replace(CONTROL, **off, effects={"left_right_bias": bias})


@cache
def plan() -> Plan:
    return plan_of(CONTROL, 1.5)


@cache
def measured(bias: float) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Make a track and a table of a robot."""
    truth = truth_of(bias)
    track = make_track(truth, plan(), seed=2, kick=KICK, marker=(0.002, -0.001, 0.02), current=CURRENT, scale=1.01)
    design = {"tails": (2, 3, 4), "lengths_cm": (6.0, 9.0)}
    return track, sf.make_table(truth, seed=3, title="", **design)  # type: ignore[arg-type]


@cache
def models(bias: float) -> tuple[tuple[SwimModel, Flags], tuple[SwimmerModel, Flags], tuple[JointModel, Flags]]:
    """Make the models of a swim, of a table and of both, each with what is held out."""
    track, table = measured(bias)
    swim, last = swim_model(CONTROL, read_swims(track, plan()))
    steady = SwimmerModel(CONTROL, read_measurements(table))
    held_out = middle_session(steady.runs)
    return (swim, last), (steady, held_out), joint_model(swim, last, steady, held_out)


@pytest.mark.slow
def test_rows_of_either_kind_are_as_they_are_alone() -> None:
    (swim, last), (table, held_out), (joint, rows) = models(BIAS)
    runs, count, k = joint.runs, len(swim.runs), len(swim.runs.outputs)
    start = {**start_values(joint), "left_right_bias": 0.02, "heading_zero": 0.01}
    seen = joint.predict([start])[0]
    own = {**{name: start[name] for name in start_values(swim) if name in start}, "heading_zero": 0.0}
    np.testing.assert_array_equal(seen[:count, :k], swim.predict([own])[0])
    np.testing.assert_array_equal(seen[count:, k:], table.predict([start])[0])
    assert not seen[:count, k:].any()
    assert not seen[count:, :k].any()
    names = ["C_t", "left_right_bias", "heading_zero", "heading_zero of the swims"]
    slopes = derivatives(joint, start, names)[1]
    assert slopes[:count, :, :2].any((0, 1)).all()
    assert slopes[count:, :, :3].any((0, 1)).all()
    assert not slopes[:count, :, 2].any()
    assert not slopes[count:, :, 3].any()
    np.testing.assert_array_equal(rows, np.append(last, held_out))
    parts, together = groups(runs)[0], runs.together
    assert not set(parts[:count]) & set(parts[count:])
    assert not set(together[:count]) & set(together[count:])
    table_of_noise = np.random.default_rng(0).normal(size=(*runs.y.shape, 2))
    np.testing.assert_allclose(runs.whitened(runs.raw(table_of_noise)), table_of_noise, atol=1e-9)
    np.testing.assert_array_equal(runs.raw(table_of_noise)[count:], table_of_noise[count:])


@pytest.mark.slow
def test_the_rough_model_is_that_of_the_swims_beside_the_table() -> None:
    """Also within a model that is around it."""
    (swim, _), (table, _), (joint, _) = models(BIAS)
    count, k = len(swim.runs), len(swim.runs.outputs)
    assert swim.rough is not None
    for rough in (joint.rough, Offsets(joint, {}).rough):
        assert rough is not None
        start = start_values(joint)
        for given, of_swims, of_table in (
            (rough.runs.y, swim.rough.runs.y, table.runs.y),
            (rough.predict([start])[0], swim.rough.predict([start])[0], table.predict([start])[0]),
        ):
            np.testing.assert_array_equal(given[:count, :k], of_swims)
            np.testing.assert_array_equal(given[count:, k:], of_table)
        np.testing.assert_allclose(rough.runs.raw(rough.runs.y), joint.runs.raw(joint.runs.y), atol=1e-9)
    assert replace(joint, swim=swim.rough).rough is None


@pytest.mark.slow
def test_noise_and_scatter_of_sessions_are_those_of_the_table() -> None:
    """Also in the tests, which estimate the noise of each draw."""
    (swim, _), (table, held_out), (joint, rows) = models(BIAS)
    k, rng = len(swim.runs.outputs), np.random.default_rng(1)

    def designed(model: SwimmerModel | JointModel, used: Flags) -> Regression:
        columns = np.zeros((*model.runs.y.shape, 0))
        return regression(model.runs, used, columns, (), model.runs.repeats(used))

    of_table, of_both = designed(table, ~held_out), designed(joint, ~rows)
    n = int((~held_out).sum())
    drawn = rng.normal(size=(n, len(table.runs.outputs)))
    drawn += rng.normal(size=5)[table.runs.session[~held_out], None]
    padded = np.zeros((len(of_both.scale), k + drawn.shape[1]))
    padded[:-n, :k], padded[-n:, k:] = rng.normal(size=(len(padded) - n, k)), drawn
    run = of_both.noise(padded)
    np.testing.assert_allclose(run[k:, k:], of_table.noise(drawn))
    np.testing.assert_array_equal(run[:k], np.eye(len(run))[:k])
    alone = of_table.products(drawn).session_ratio(passes=3)
    assert alone.min() > 0
    np.testing.assert_allclose(of_both.products(padded).session_ratio(passes=3)[k:], alone, rtol=1e-6)
    c = joint.runs.noise(~rows)[0][k:, k:] / table.runs.noise(~held_out)[0]
    assert c.min() == pytest.approx(c.max())
    assert c.min() > 1


def numbers_of(model: Experiment) -> tuple[str, ...]:
    return (*(p.name for p in (*model.coefficients, *model.nuisances)), "left_right_bias")


def errors_at(model: Experiment, held_out: Flags, at: Mapping[str, float]) -> dict[str, float]:
    """Compute the standard errors of a fit that ends at some parameters."""
    used, names = ~model.runs.left_out(held_out), numbers_of(model)
    fitted = tuple(parameter(model, name) for name in names)
    columns = derivatives(model, {**start_values(model), **at}, names)[1]
    run, repeats = model.runs.noise(used)
    linear = regression(model.runs, used, columns, fitted).products(np.zeros((used.sum(), len(run))), run)
    variance = variance_factor(repeats, len(run)) * np.diag(linear.covariance(np.full(len(run), 0.1)))
    return dict(zip(names, np.sqrt(variance), strict=True))


@pytest.mark.slow
def test_both_tell_more_than_either() -> None:
    """Errors of coefficients and effect are smaller than with each alone, and the fit finds the truth."""
    truth, (swim, table, (joint, rows)) = truth_of(BIAS), models(BIAS)
    known = {"C_t": truth.C_t, "C_r": truth.C_r, "C_yr": truth.C_yr, "left_right_bias": BIAS}
    of_swim, of_table, of_both = (errors_at(*each, known) for each in (swim, table, (joint, rows)))
    used = ~joint.runs.left_out(rows)
    found = fit(joint, joint.guess(start_values(joint), used), numbers_of(joint), used, title="")
    for name, value in known.items():
        assert of_both[name] < 0.95 * min(of_swim[name], of_table[name])
        low, high = found.interval(name)
        assert low < value < high


@cache
def verdict_of(bias: float) -> RobotVerdict:
    track, table = measured(bias)
    verdict = sf.calibrate(track, CONTROL, plan=plan(), beside=table, progress=False)
    assert isinstance(verdict, RobotVerdict)
    return verdict


@pytest.mark.rest
def test_what_a_short_swim_alone_does_not_tell_is_found_beside_a_table(tmp_path: Path) -> None:
    verdict = verdict_of(BIAS)
    assert verdict.effects == ("left_right_bias",)
    assert verdict.split.names == "last third of swim, N=3"
    report = verdict.save(str(tmp_path))[1].read_text()
    for words in ("track in the plane", "and from the repeats of the table", "4 swims and sessions"):
        assert words in report
    assert report.count("residuals by output") == 4  # of poses and of runs, without the effect and with it
    record = verdict.to_dict()
    assert set(record["scatter_of_sessions_by_output"]) == set(verdict.runs.outputs[3:])
    assert record["scatter_of_a_run"]["omega_h"] == pytest.approx(0.025, rel=0.3)


@pytest.mark.rest
def test_of_a_robot_that_lacks_nothing_nothing_is_claimed_beside_a_table() -> None:
    assert verdict_of(0.0).verdict == "none"


@pytest.mark.slow
def test_what_is_no_table_of_the_robot_is_refused() -> None:
    track, table = measured(BIAS)
    robots = table.assign(robot=np.where(table.index % 2, "a", "b"))
    spins = table[["N", "l_cm", "omega_rpm", "omega_h_rpm", "omega_t_rpm"]]
    for beside, words in (
        (track, "--beside takes a table of steady runs, and this is a track"),
        (robots, r"it has 2 robots \(column robot\); give the runs of the one that swam"),
        (spins, "the spins alone do not tell the coefficients apart"),
        (pd.DataFrame({"height_m": [1.0, 2.0]}), "no column 'N'"),
    ):
        with pytest.raises(InputError, match=words):
            sf.calibrate(track, CONTROL, plan=plan(), beside=beside, progress=False)
    (swim, last), (steady, held_out), _ = models(BIAS)
    count = len(steady.runs)
    alone = replace(steady.runs, condition=np.arange(count), length=np.linspace(0.06, 0.09, count))
    with pytest.raises(InputError, match="too few repeats tell the noise of its runs"):
        joint_model(swim, last, replace(steady, runs=alone), held_out)
    with pytest.raises(InputError, match="table is a table of runs; give the track of a swim"):
        sf.calibrate(table, CONTROL, beside=table, progress=False)


def test_a_table_beside_a_swim_is_for_a_robot() -> None:
    model = sf.Model(
        lambda columns, numbers: {"v": numbers["k"]}, {"v": sf.Output("speed")}, [sf.Number("k", 1.0)]
    )
    with pytest.raises(InputError, match="beside is not for a model of your own"):
        sf.calibrate("falls.csv", model, beside="runs.csv")
