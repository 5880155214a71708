"""Swims that would tell explanations apart are carried out as their commands plan them, and they decide."""

from __future__ import annotations

import shlex
from dataclasses import replace
from functools import cache
from itertools import product
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import softflagella as sf
from calibration.findings.next_runs import Explanation, next_runs, standings
from calibration.linear.gls import Noise
from calibration.robot.robot_verdict import RobotVerdict
from calibration.statistics.forward import linear
from calibration.statistics.statistical_model import Parameter, start_values
from calibration.swim import possible_swims as possible
from calibration.swim.measured_swim import MeasuredSwim, read_swims
from calibration.swim.swim_model import swim_model
from common.arrays import Floats
from common.errors import InputError
from planner.files.saved_plan import load_plan
from sim.model.robot import Robot
from softflagella.__main__ import main
from tests.calibration.swim.test_swim_model import plan_of
from tests.oracles.swims import make_track
from tests.planner.plans import CONTROL


def along_a_line(robot: Robot, metres: float) -> MeasuredSwim:
    """A swim whose flips are on a line."""
    flips, time = np.arange(0.0, 402.0, 2.0), np.arange(0.0, 400.5, 0.5)
    poses = np.stack([time * metres / 400, np.sin(np.pi * time / 2) * robot.tail_length, 0 * time], 1)
    return MeasuredSwim("line", time, poses, 1, flips, 0.0, True, ())


def test_paths_are_as_long_as_that_of_the_swim_and_others_robots_differ_in_one_number(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """The commands plan them."""
    monkeypatch.setattr(possible, "_SHAPES", possible._SHAPES[:1])
    monkeypatch.setattr(possible, "_LONGER", 1e-3)  # too tight to be planned
    swims = list(possible.possible_swims(CONTROL, [along_a_line(CONTROL, 8 * CONTROL.tail_length)]))
    ways = [(each.settings["path"], each.settings["robot"]) for each in swims]
    others = ["motor.speed_rpm=30.3", "tails.count=3", "tails.length_cm=7.7", "tails.length_cm=15.4"]
    paths = [("as swum", "as given"), ("circle:1.3l", "as given")]
    assert ways == [*paths, *(("square:2l", each) for each in others)]
    assert swims[0].settings["minutes"] == pytest.approx(400 / 60, abs=0.1)
    for each in swims[1:3]:
        words = shlex.split(each.settings["plan"].replace("robot.toml", "paper-control"))
        main([*words[1:-1], str(tmp_path / "next")])
        content = load_plan(tmp_path / "next" / "plan.json")
        assert np.diff(each.swim.flips) == pytest.approx(content["dwell_s"], rel=1e-6)
        assert each.swim.first_direction == content["first_direction"]


@pytest.mark.slow
def test_a_swim_made_again_is_predicted_as_it_was(monkeypatch: pytest.MonkeyPatch) -> None:
    """From a start at the origin, in the same noise; one that cannot be simulated is left out."""
    monkeypatch.setattr(possible, "_SHAPES", ())
    monkeypatch.setattr(possible, "_others", lambda robot: [("tails.count=3", replace(robot, tails=3))])
    plan = plan_of(CONTROL, 1.5)
    model, _ = swim_model(CONTROL, read_swims(make_track(CONTROL, plan, seed=0), plan))
    swims, settings = model.possible()
    assert [each["robot"] for each in settings] == ["as given", "tails.count=3"]
    again, three = swims.models
    assert model.runs.noise_of_poses is not None
    assert again.runs.noise_of_poses.sizes.tau == model.runs.noise_of_poses.sizes.tau
    zero = {p.name: 0.0 for p in model.coefficients if p.of_group}
    was, at = ({**start_values(each), **own} for each, own in ((model, zero), (again, {})))
    poses = again.runs.raw(again.predict([at])[0])
    assert poses == pytest.approx(model.runs.raw(model.predict([was])[0]), abs=1e-9)
    (robot,) = three.swimming([start_values(three)])
    assert robot.columns["N"] == 3
    assert len(swims.runs) == sum(len(each.runs) for each in swims.models)

    def broken(*_: object, **__: object) -> Any:
        raise InputError("broke down")

    monkeypatch.setattr(type(three), "predict", broken)
    assert np.isnan(swims.linearised(at, [])([at])).all()


TIME = np.arange(20.0)


def rivals(*slopes: float) -> tuple[Any, Any]:
    """Two explanations of swims seen as one coordinate in time: A stays, B moves by a slope and by 3.

    Each swim has a start of its own.
    """
    start = Parameter("start", "start", 0.0, (-1e3, 1e3), 1.0, of_these_runs=True)
    known = tuple(Parameter(name, name, 0.0, (-9.0, 9.0), 1.0) for name in "AB")

    def model(of: tuple[float, ...], y: Floats) -> Any:
        shape = np.concatenate([3 + slope * TIME for slope in of])[:, None]
        J = np.stack([0 * shape, shape, np.ones_like(shape)], -1)
        place = np.repeat(np.arange(len(of)), len(TIME))
        runs = SimpleNamespace(
            y=y, session=0 * place, along=np.zeros(len(y)), outputs=("y",), condition=place, memory=None,
            trace=None, trace_names=(), session_names=("swim",),
        )  # fmt: skip
        every = (*known, start)
        return SimpleNamespace(
            runs=runs, coefficients=every, nuisances=(), effects=(),
            linearised=lambda at, along, **_: linear(
                at, along, J @ [at[p.name] for p in every], J[..., [every.index(p) for p in along]]
            ),
            possible=lambda: (model(of, y), [{"path": str(slope)} for slope in of]),
        )  # fmt: skip

    hypotheses = []
    for name, parameter in zip("AB", known, strict=True):
        fit = SimpleNamespace(
            fitted=(parameter, start), names=[name, "start"],
            parameters={"A": 0.0, "B": 0.0, name: 1.0, "start": 7.0},
            covariance=np.diag([1e-4, 1.0]), noise=Noise(np.eye(1), 1.0),
        )  # fmt: skip
        hypotheses.append(
            SimpleNamespace(title=name, law={}, fitted=fit, model=model(slopes, np.zeros((len(slopes) * 20, 1))))
        )
    return tuple(hypotheses), model


def test_a_swim_tells_apart_what_its_own_start_does_not_absorb() -> None:
    """λ is that of the slope about its mean. All swims are listed once; the first that decides leads."""
    both, _ = rivals(0.0, 0.1, 0.3, 0.4)
    runs, batch = next_runs(both)
    assert [run.settings["path"] for run in runs] == ["0.3", "0.4", "0.1", "0.0"]
    assert {run.repeats for run in runs} == {1}
    spread = ((TIME - TIME.mean()) ** 2).sum()
    smallest = [slope**2 * spread / (1 + 1e-4 * slope**2 * spread) for slope in (0.3, 0.4, 0.1, 0.0)]
    assert [run.separation for run in runs] == pytest.approx(smallest, rel=1e-3, abs=1e-3)
    assert batch.settings == ({"path": "0.3"},)
    assert (batch.worth_making, runs[-1].decides) == (True, 0.0)


def test_a_swim_with_a_start_of_its_own_decides_by_the_rest() -> None:
    both, model = rivals(0.3)
    y = (40 + 3 + 0.3 * TIME)[:, None]  # B, from a start that nobody knows
    first, second = standings(model((0.3,), y), [Explanation.of(each) for each in both], np.ones(20, bool))
    assert (first.title, second.title, second.given_up) == ("B", "A", True)
    assert second.behind == pytest.approx(0.3**2 * ((TIME - TIME.mean()) ** 2).sum(), rel=0.01)


@cache
def undecided() -> tuple[RobotVerdict, Robot]:
    """A verdict that cannot tell an end-over-end drag from another effect, and the true robot."""
    plan = sf.plan(sf.polygon(4, side=3.0), CONTROL)
    truth = replace(CONTROL, C_t=1.05 * CONTROL.C_t, C_r=0.95 * CONTROL.C_r, effects={"end_over_end_drag": 12.0})
    kick = (2e-5, 3e-4)
    track = make_track(truth, plan, seed=1, kick=kick, current=(2e-5, 0.0), marker=(0.002, -0.001, 0.02))
    verdict = sf.calibrate(track, CONTROL, plan=plan, progress=False)
    assert isinstance(verdict, RobotVerdict)
    return verdict, truth


@pytest.mark.rest
def test_where_no_path_decides_the_swim_of_another_robot_does() -> None:
    """The proposal is planned, swum by the true robot, and judged: of ten such swims four decide."""
    verdict, truth = undecided()
    assert verdict.verdict == "ambiguous"
    shares = {(run.settings["path"], run.settings["robot"]): run.decides for run in verdict.next_runs}
    (path, other), best = max(shares.items(), key=lambda each: each[1])
    assert other == "tails.length_cm=15.4"
    assert 0.5 < best < 0.65
    assert max(share for (_, robot), share in shares.items() if robot == "as given") < 0.2
    given_up = {}
    for length, seed in (*product((0.154,), range(2, 8)), *product((CONTROL.tail_length,), (2, 3))):
        other_robot = replace(CONTROL, tail_length=length)
        plan = sf.plan(path, other_robot)
        track = make_track(replace(truth, tail_length=length), plan, seed=seed).assign(run="new")
        decision = sf.decide(track, verdict, other_robot, plan=plan)
        given_up[length, seed] = {standing.title for standing in decision.standings if standing.given_up}
        assert "head's end-over-end drag" not in given_up[length, seed]
    longer = [titles for (length, _), titles in given_up.items() if length == 0.154]
    assert any(longer)
    assert sum(map(bool, given_up.values())) == sum(map(bool, longer))
