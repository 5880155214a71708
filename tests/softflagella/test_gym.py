"""The Gymnasium environment: it moves as the vehicle, or in the simulator; our tracker follows its path."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

gymnasium = pytest.importorskip("gymnasium", reason="needs the extra gym")

from gymnasium.utils.env_checker import check_env  # noqa: E402

import softflagella.gym as sg  # noqa: E402
from common.errors import InputError  # noqa: E402
from planner.paths.distance import distance_to  # noqa: E402
from planner.vehicle.vehicle import Switches, roll_out  # noqa: E402
from softflagella import write_plan  # noqa: E402
from tests.planner.plans import planned  # noqa: E402

QUIET = (1e-9, 1e-9)


def certain_env(monkeypatch: pytest.MonkeyPatch, **options: object) -> sg.PathEnv:
    """Make an environment without noise, for the plan's vehicle at the plan's start."""
    monkeypatch.setattr(sg, "START", (0.0, 0.0, 0.0))
    result = planned()
    vehicle = replace(result.tracked.vehicle, modes=())
    return sg.PathEnv(
        replace(result, tracked=result.tracked._replace(vehicle=vehicle)), noise=QUIET, **options  # type: ignore[arg-type]
    )  # fmt: skip


@pytest.mark.parametrize("model", ["table", "simulator"])
def test_gymnasium_accepts_it(model: str) -> None:
    """Its checker warns of what it does not like, and warnings are errors here."""
    check_env(gymnasium.make("softflagella/Path-v0", plan=planned(), model=model).unwrapped)


def test_what_cannot_be_done_is_said() -> None:
    env = sg.PathEnv(planned())
    with pytest.raises(gymnasium.error.ResetNeeded, match="call reset before"):
        env.step(0)
    env.reset(seed=0)
    for action in (2, -1, 1.5, None, "1"):
        with pytest.raises(InputError, match=r"action .*; give 0 \(keep\) or 1 \(flip\)"):
            env.step(action)  # type: ignore[arg-type]
    with pytest.raises(InputError, match="plan is 3; give a plan"):
        sg.PathEnv(plan=3)  # type: ignore[arg-type]


def test_it_moves_as_the_planners_vehicle(monkeypatch: pytest.MonkeyPatch) -> None:
    env = certain_env(monkeypatch)
    seen, _ = env.reset(seed=0)
    counts, poses = [4, 5, 9, 4, 4, 30], [seen["pose"]]
    for k, count in enumerate(counts):
        for step in range(count):
            seen, _, _, _, info = env.step(int(step == 0 and k > 0))
            assert info["flipped"] == (step == 0 and k > 0)
            assert seen["motor"] == pytest.approx([env.plan.first_direction * (-1) ** k, env.every * (step + 1)])
        poses.append(seen["pose"])
    schedule = Switches(env.plan.first_direction, env.every * np.array(counts), np.array([env.plan.start]))
    expected = roll_out(env.plan.tracked.vehicle, schedule).flips
    difference = np.array(poses) - expected
    difference[:, 2] = np.remainder(difference[:, 2] + np.pi, 2 * np.pi) - np.pi
    assert np.abs(difference).max() < 1e-7


@pytest.mark.slow
def test_table_and_simulator_agree(monkeypatch: pytest.MonkeyPatch) -> None:
    """On random actions, within the error that the plan states."""
    envs = [certain_env(monkeypatch, model=model) for model in ("table", "simulator")]
    for env in envs:
        env.reset(seed=0)
    for action in np.random.default_rng(0).integers(2, size=120).tolist():
        table, simulated = (env.step(action)[0]["pose"] for env in envs)
    assert np.hypot(*(table - simulated)[:2]) < envs[0].plan.stated_error


def test_it_shows_the_path_from_the_robot(monkeypatch: pytest.MonkeyPatch) -> None:
    """At the start the path is where the plan says; error and reward are those of the declared path."""
    env = certain_env(monkeypatch)
    seen, _ = env.reset(seed=0)
    (x, y, heading), reference = env.plan.start, env.plan.declared.reference
    forward, left, turned = seen["reference"][0]
    place = [x + forward * np.cos(heading) - left * np.sin(heading),
             y + forward * np.sin(heading) + left * np.cos(heading)]  # fmt: skip
    assert np.hypot(*(reference.p - place).T).min() < 1e-6
    assert abs(np.remainder(reference.heading[0] - heading - turned + np.pi, 2 * np.pi) - np.pi) < 0.1
    assert np.diff(np.hypot(*seen["reference"][:, :2].T)).min() > 0.1
    apart = np.hypot(*np.diff(seen["reference"][:, :2], axis=0).T)
    assert apart == pytest.approx([sg.APART] * len(apart), abs=float(reference.arc[1]))
    for step in range(400):
        seen, reward, _, _, info = env.step(int(step % 4 == 0))
    error = distance_to(env.plan.reference, seen["pose"][None, :2])[0]
    assert error > 0.1
    assert info["error"] == pytest.approx(error, abs=1e-7)
    share = env.every / env.plan.duration
    assert reward == pytest.approx(-(1 + error / env.plan.predicted_rms) * share)


def test_each_seed_draws_another_robot(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sg, "START", (0.0, 0.0, 0.0))
    env, ends = sg.PathEnv(planned(), noise=QUIET), []
    for seed in (0, 1, 0):
        env.reset(seed=seed)
        ends.append([env.step(0)[0]["pose"] for _ in range(100)][-1])
    assert np.abs(ends[1] - ends[0]).max() > 1e-4
    assert np.array_equal(ends[2], ends[0])


def test_starts_and_poses_are_drawn_as_stated() -> None:
    env = sg.PathEnv(planned(), noise=(0.02, 0.03))
    poses = [env.reset(seed=seed)[0]["pose"] for seed in range(300)]
    assert np.mean(poses, 0) == pytest.approx(env.plan.start, abs=0.01)
    assert np.std(poses, 0) == pytest.approx(np.hypot(sg.START, [0.02, 0.02, 0.03]), rel=0.15)


def test_a_flip_before_the_shortest_dwell_does_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    env = certain_env(monkeypatch, actions=3)
    env.reset(seed=0)
    flips = [env.step(1)[4]["flipped"] for _ in range(10)]
    assert flips == [False, False, False, True, False, False, True, False, False, True]


@pytest.mark.slow
def test_the_tracker_follows_the_path_and_keeping_on_does_not() -> None:
    env = sg.PathEnv(planned())
    for seed in range(3):
        result = sg.episode(env, sg.TrackerPolicy, seed)
        assert result.finished
        assert -3 < result.score < -1
        assert np.sqrt(np.mean(result.errors**2)) < env.plan.feedback_error
        assert sg.episode(env, sg.TrackerPolicy, seed).score == result.score
    still = sg.episode(env, lambda env: lambda seen, info: 0, 0)
    assert not still.finished
    assert still.score < -20
    assert len(still.errors) * env.every == pytest.approx(sg.LONGEST * env.plan.duration, abs=env.every)


def test_a_plan_file_is_read_and_wrong_arguments_are_refused(tmp_path: object) -> None:
    write_plan(planned(), str(tmp_path))
    assert sg.PathEnv(f"{tmp_path}/plan.json").plan.duration == pytest.approx(planned().duration)
    with pytest.raises(InputError, match="model 'tables'; give 'table' or 'simulator'"):
        sg.PathEnv(planned(), model="tables")  # type: ignore[arg-type]
    for actions in (0, "4", 2.5):
        with pytest.raises(InputError, match=f"actions is {actions!r}; give a whole number, 1 or more"):
            sg.PathEnv(planned(), actions=actions)  # type: ignore[arg-type]
    for noise in ((0.0, 0.01), 0.1, "0.1", (0.01, "0.1"), (0.01,)):
        with pytest.raises(InputError, match=re.escape(f"camera: noise is {noise!r}; give two numbers above 0")):
            sg.PathEnv(planned(), noise=noise)  # type: ignore[arg-type]
