"""The poses of a swim are those of the simulator, their noise needs no model, and a swim tells what is missing."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

import softflagella as sf
from calibration.attribution.effects import scores
from calibration.report.figures import draw_residuals
from calibration.robot.robot_verdict import RobotVerdict
from calibration.statistics.budget import work_done
from calibration.statistics.fit import fit
from calibration.statistics.forward import by_differences, derivatives
from calibration.statistics.residual_tests import directions
from calibration.statistics.statistical_model import start_values
from calibration.statistics.study import Study
from calibration.swim.course import Swimming, Vehicles
from calibration.swim.free_vehicle import with_noise
from calibration.swim.measured_swim import MeasuredSwim, read_swims
from calibration.swim.pose_noise import Sizes
from calibration.swim.swim_model import SwimModel, swim_model
from common.arrays import Floats
from common.errors import InputError
from planner.planning.plan import Plan
from sim.knowledge import COEFFICIENTS
from sim.model.robot import Robot
from sim.motion.stepped_response import stepped_response
from tests.oracles.swims import CameraNoise, make_track, swum
from tests.planner.plans import CONTROL
from tests.sim.robots import CONTROL_VALUES, control, first_body

THREE, FIVE = (replace(CONTROL, tails=tails) for tails in (3, 5))
KICK, CURRENT = (1e-4, 0.003), (2e-5, 0.0)


def plan_of(robot: Robot, side: float = 2.0) -> Plan:
    return sf.plan(sf.polygon(4, side=side), robot)


def changed(robot: Robot, **effects: float) -> Robot:
    return replace(robot, C_t=1.1 * robot.C_t, C_r=0.9 * robot.C_r, effects=effects)


def exact_swim(truth: Robot, plan: Plan) -> MeasuredSwim:
    """Return a swim whose poses are those of the simulator."""
    (seen,) = read_swims(make_track(truth, plan, seed=0), plan)
    exact = swum(truth, plan, None)
    return replace(seen, poses=exact.at(seen.time), flips=exact.flips)


def plain_model(robot: Robot, swim: MeasuredSwim) -> SwimModel:
    """Return a model of a swim without noise, with poses as they are."""
    model, _ = swim_model(robot, [swim])
    runs = model.runs.in_noise(Sizes(np.ones(2), np.full(2, 1e-9), np.full(2, 1e-9), 1.0), model.runs.poses)
    return replace(model, runs=runs, sight=replace(model.sight, runs=runs))


def farthest(model: SwimModel, at: dict[str, float]) -> Floats:
    """Compute how far poses are from the model, at the best start and clock, at most: mm, mm, degrees."""
    off = model.runs.y - model.predict([at])[0]
    seen = [*model.sight.coefficients, *model.sight.nuisances]
    starts = derivatives(model, at, seen)[1].reshape(off.size, -1)
    off -= (starts @ np.linalg.lstsq(starts, off.ravel(), rcond=None)[0]).reshape(off.shape)
    return np.abs(off).max(0) * [1e3 * model.runs.length, 1e3 * model.runs.length, 180 / np.pi]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("robot", "effects"),
    [
        (CONTROL, {}),
        (CONTROL, {"left_right_bias": 0.1}),
        (THREE, {"disc_drag": 0.2}),
        (FIVE, {"contact_line": 0.5}),
        (FIVE, {"natural_curvature": 0.3}),
    ],
)
def test_poses_are_those_of_the_simulator(robot: Robot, effects: dict[str, float]) -> None:
    """Within 0.8 mm and 0.3° of a path of 8 l, also just after flips.

    What is left is the phase of the disc at the flips.
    """
    truth, plan = changed(robot, **effects), plan_of(robot)
    model = plain_model(robot, exact_swim(truth, plan))
    at = {**start_values(model), "C_t": truth.C_t, "C_r": truth.C_r, **effects}
    assert (farthest(model, at) < [0.8, 0.8, 0.3]).all()
    assert farthest(model, start_values(model)).max() > 2  # the change is large


def test_lags_are_known_while_tails_turn_over() -> None:
    """Of a fast robot they are far from a straight line."""
    columns = {name: np.full(2, value) for name, value in {**CONTROL_VALUES, "N": 3.0}.items()}
    columns["omega_bar"] = np.array([50.0, -50.0])
    one, time = np.ones(1), np.array([0.06, 0.1, 0.16])
    (found,) = Vehicles().swimming(columns, np.array([[0, 1]]), one, one, close=False)
    groups = control(N=3.0, omega_bar=50.0)
    exact = stepped_response(first_body(groups), groups.N, time, time, history=False).lag
    assert found.vehicle.lag_after(1, 2.0, time) == pytest.approx(exact, abs=2e-3)
    assert np.abs(exact - exact[-1] * time[:, None] / time[-1]).max() > 4e-3


@pytest.mark.slow
def test_a_fit_from_far_does_not_crawl() -> None:
    """A wrong model is soon left; its scores in large steps say what is missing, which is then found."""
    truth, plan = changed(CONTROL, left_right_bias=0.1), plan_of(CONTROL, 3.0)
    model, held_out = swim_model(CONTROL, read_swims(make_track(truth, plan, seed=1), plan))
    study = Study.fitted_to(model, ~model.runs.left_out(held_out))
    names = tuple(p.name for p in (*model.coefficients, *model.nuisances))
    began = work_done()
    base = fit(model, model.guess(start_values(model), study.split.fitted), names, study.split.fitted)
    assert not base.converged
    tangents = directions(model, base.parameters, model.effects)
    misfit, near = scores(study, base, model.effects, tangents)
    assert near.converged
    assert model.effects[int(np.argmax(np.abs(misfit.scores.z)))].name == "left_right_bias"
    start = {**near.parameters, "left_right_bias": 0.05}
    found = fit(model, start, (*names, "left_right_bias"), study.split.fitted)
    assert found.converged
    assert found.deviance < study.noise_at_most(len(found.names)) < base.deviance
    assert found.parameters["left_right_bias"] == pytest.approx(0.1, rel=0.1)
    assert (work_done() - began).predictions < 8000


@pytest.mark.slow
def test_a_prediction_does_not_depend_on_those_before() -> None:
    """So a fit that goes another way ends at the same place, and its derivatives are those of the model."""
    plan = plan_of(THREE, 1.5)
    swims = read_swims(make_track(THREE, plan, seed=0), plan)
    fresh, other = (swim_model(THREE, swims)[0] for _ in range(2))
    start = start_values(fresh)
    away = [{**start, **{name: by * start[name] for name in COEFFICIENTS}} for by in (1.05, 1.12, 1.2)]
    for at in away:
        derivatives(other, at, COEFFICIENTS)
    seen, slopes = derivatives(other, away[-1], COEFFICIENTS)
    np.testing.assert_array_equal(seen, fresh.predict(away[-1:])[0])
    exact = by_differences(fresh, away[-1], COEFFICIENTS)[1]
    assert np.abs(slopes - exact).max() < 0.03 * np.abs(exact).max()


@pytest.mark.slow
def test_the_noise_needs_no_model() -> None:
    """A hidden effect does not hide in it."""
    plan, found = plan_of(CONTROL, 3.0), []
    for effects in ({}, {"left_right_bias": 0.1}):
        track = make_track(changed(CONTROL, **effects), plan, seed=1, kick=KICK)
        model, held_out = swim_model(CONTROL, read_swims(track, plan))
        plain = replace(model.sight, runs=replace(model.runs, noise_of_poses=None, y=model.runs.poses))
        (given,) = model.swimming([start_values(model)])
        runs, _ = with_noise(plain, given, ~held_out)
        assert runs.noise_of_poses is not None
        found.append(np.concatenate(runs.noise_of_poses.sizes[:3]) * np.tile([model.runs.length, 1.0], 3))
    camera = CameraNoise()
    truth = [*camera.white, *camera.slow, *KICK]
    assert (np.abs(np.log(np.array(found) / truth)) < 0.5).all()
    assert (np.abs(np.log(found[0] / found[1])) < 0.2).all()


@pytest.mark.slow
def test_a_fit_turns_back_where_a_robot_cannot_be_simulated(monkeypatch: pytest.MonkeyPatch) -> None:
    """It ends neither the fit nor the verdict."""
    (swim,) = read_swims(make_track(CONTROL, plan_of(CONTROL), seed=0), plan_of(CONTROL))
    model, _ = swim_model(CONTROL, [swim])
    start = start_values(model)

    def broken(*_: object, **__: object) -> list[Swimming]:
        raise InputError("broke down")

    monkeypatch.setattr(Vehicles, "swimming", broken)
    seen, slopes = derivatives(model, start, ["C_t"], quick=True)
    assert np.isnan(seen).all()
    assert np.isnan(slopes).all()
    with pytest.raises(InputError, match="broke down"):
        derivatives(model, start, ["C_t"])


@pytest.mark.slow
def test_an_effect_with_which_no_robot_can_be_simulated_leaves_the_others(monkeypatch: pytest.MonkeyPatch) -> None:
    """A verdict ended with an error because of one effect of twenty-six."""
    (swim,) = read_swims(make_track(CONTROL, plan_of(CONTROL), seed=0), plan_of(CONTROL))
    model, _ = swim_model(CONTROL, [swim])
    simulated = Vehicles._simulated

    def broken(self: Vehicles, wanted: Any) -> Any:
        if any(name == "disc_drag" for robot, _ in wanted for name, _ in robot):
            raise InputError("broke down")
        return simulated(self, wanted)

    monkeypatch.setattr(Vehicles, "_simulated", broken)
    names, start = ["C_t", "disc_drag", "left_right_bias"], start_values(model)
    seen, slopes = derivatives(model, start, names)
    assert np.isfinite(seen).all()
    assert np.isnan(slopes[..., 1]).all()
    assert np.isfinite(slopes[..., [0, 2]]).all()
    found = directions(model, start, [p for p in model.effects if p.name in names])
    assert [bool(found.table[..., place].any()) for place in range(2)] == [
        p.name != "disc_drag" for p in model.effects if p.name in names
    ]
    with pytest.raises(InputError, match="broke down"):
        derivatives(model, {**start, "disc_drag": 1.0}, names)


@cache
def verdict_of(bias: float) -> RobotVerdict:
    plan = plan_of(CONTROL)
    truth = changed(CONTROL, **({"left_right_bias": bias} if bias else {}))
    track = make_track(truth, plan, seed=2, kick=KICK, marker=(0.002, -0.001, 0.02), current=CURRENT, scale=1.01)
    verdict = sf.calibrate(track, CONTROL, plan=plan, progress=False)
    assert isinstance(verdict, RobotVerdict)
    return verdict


@pytest.mark.rest
def test_a_swim_tells_what_is_missing() -> None:
    verdict, truth = verdict_of(0.1), changed(CONTROL)
    assert verdict.verdict == "effect"
    assert verdict.effects == ("left_right_bias",)
    low, high = verdict.final_intervals["left_right_bias"]
    assert low < 0.1 < high
    for name in ("C_t", "C_r", "C_yr"):
        low, high = verdict.final_intervals[name]
        assert low < getattr(truth, name) < high
    assert verdict.errors.rms["after"] < verdict.errors.rms["before"] / 2
    assert verdict.corrected.effects["left_right_bias"] == pytest.approx(0.1, rel=0.25)
    assert verdict.knowledge.current[0] == pytest.approx(2e-5, abs=3 * verdict.knowledge.current_error[0])


@pytest.mark.rest
def test_of_a_robot_that_lacks_nothing_nothing_is_claimed() -> None:
    verdict = verdict_of(0.0)
    assert verdict.verdict == "none"
    assert verdict.split.names == "last third of swim"
    assert "cm" in verdict.errors_in_words


@pytest.mark.rest
def test_the_corrected_robot_swims_the_path() -> None:
    """Planned with the verdict, the true robot is nearer to the path than planned with the robot as given."""
    truth, again = changed(CONTROL, left_right_bias=0.1), sf.plan(sf.polygon(4, side=2.0), verdict_of(0.1))
    exact = CameraNoise(white=(0.0, 0.0), slow=(0.0, 0.0))
    plans = plan_of(CONTROL), again
    tracks = (make_track(truth, plan, seed=0, camera=exact, current=CURRENT) for plan in plans)
    before, after = (sf.check(plan, track).raw_rms for plan, track in zip(plans, tracks, strict=True))
    assert after < before / 2


@pytest.mark.rest
def test_a_swim_is_reported_with_its_track(tmp_path: object) -> None:
    verdict = verdict_of(0.1)
    _, report, corrected = verdict.save(str(tmp_path))
    assert "track in the plane" in report.read_text()
    assert "poses (last third of swim) were held out" in report.read_text()
    for figure, _ in draw_residuals(verdict):  # in cm and degrees, not in standard deviations
        assert [max(axes.get_ylim()) < most for axes, most in zip(figure.axes, (5, 5, 30), strict=False)] == 3 * [
            True
        ]
    assert "left_right_bias" in corrected.read_text()


def test_a_plan_is_for_a_robot() -> None:
    model = sf.Model(
        lambda columns, numbers: {"v": numbers["k"]}, {"v": sf.Output("speed")}, [sf.Number("k", 1.0)]
    )
    with pytest.raises(InputError, match="plan is not for a model of your own"):
        sf.calibrate("falls.csv", model, plan="plan.json")
