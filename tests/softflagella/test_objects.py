"""What objects say about themselves: the truth, with a picture and a table."""

from __future__ import annotations

import base64
import math
import re
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib import pyplot
from matplotlib.figure import Figure

import softflagella as sf
from tests.planner.plans import CONTROL, own_table

CM = 100 * CONTROL.tail_length
MAKE: dict[str, Callable[[], Any]] = {
    "robot": lambda: CONTROL,
    "robot with effects": lambda: replace(CONTROL, effects={name: 1.0 for name in list(sf.effects())[:3]}),
    "plan": lambda: sf.plan(sf.circle(2.0), CONTROL),
    "goal": lambda: sf.to_goal((0, 0, 0), (0.8, 0.2, 0.3), CONTROL, keep_out=[sf.Circle(1.2, -1.5, 0.3)]),
    "tracker": lambda: sf.Tracker(made("plan")),
    "table": sf.load_table,
    "own table": lambda: own_table(biased=False),
}


@cache
def made(name: str) -> Any:
    return MAKE[name]()


def number(pattern: str, text: str) -> float:
    """Find a number in a text."""
    match = re.search(pattern.replace("#", r"(-?[\d.]+(?:e-?\d+)?)"), text)
    assert match, (pattern, text)
    return float(match[1])


@pytest.mark.parametrize("name", MAKE)
def test_an_object_shows_a_picture(name: str) -> None:
    thing = made(name)
    page = thing._repr_html_()
    if hasattr(thing, "plot"):
        data = re.search(r'src="data:image/png;base64,([^"]+)"', page)
        assert data
        assert base64.b64decode(data[1]).startswith(b"\x89PNG")
    if "robot" not in name:
        axes = Figure().add_subplot()
        assert thing.plot(axes) is axes
        assert axes.lines


def test_pictures_are_in_centimetres() -> None:
    plan, tracker = made("plan"), made("tracker")
    axes = plan.plot(Figure().add_subplot())
    assert axes.get_xlabel() == "x [cm]"
    predicted = next(line for line in axes.lines if line.get_label() == "predicted")
    np.testing.assert_allclose(predicted.get_xydata(), CM * plan.smooth_track)
    axes = tracker.plot(Figure().add_subplot())
    estimated = next(line for line in axes.lines if line.get_label() == "estimated")
    np.testing.assert_allclose(estimated.get_xydata()[0], CM * np.array(tracker.pose[:2]))
    axes = plan.plot()  # none are given
    assert axes.figure.number in pyplot.get_fignums()
    pyplot.close(axes.figure)


def test_a_plan_says_what_it_holds() -> None:
    plan, text = made("plan"), repr(made("plan"))
    assert number(r"of # cm \(12.6 l\)", text) == pytest.approx(4 * math.pi * CM, rel=0.01)
    assert number(r"# dwells of", text) == len(plan.dwells)
    assert number(r"dwells of # s", text) == pytest.approx(plan.minimum_dwell * CONTROL.time_scale, rel=0.01)
    assert number(r"more, # min", text) == pytest.approx(plan.seconds.sum() / 60, rel=0.01)
    assert number(r"stated error # mm", text) == pytest.approx(10 * CM * plan.stated_error, rel=0.01)
    assert number(r"predicted error # mm", text) == pytest.approx(10 * CM * plan.predicted_rms, rel=0.01)
    assert number(r"with feedback # mm", text) == pytest.approx(10 * CM * plan.feedback_error, rel=0.01)
    assert number(r"heading # degrees", text) == pytest.approx(math.degrees(plan.start[2]), abs=0.06)
    assert number(r"centre at \(#,", text) == pytest.approx(plan.start[0] * CM, rel=0.01)
    assert f"motor {plan.first_direction:+d}" in text


def test_a_goal_plan_says_where_it_ends() -> None:
    goal, text = made("goal"), repr(made("goal"))
    assert number(r"passes at a distance of # cm", text) == pytest.approx(CM * goal.kept_clear.clearance, rel=0.01)
    assert number(r"margin of # cm", text) == pytest.approx(CM * goal.kept_clear.margin, rel=0.01)
    assert number(r"way of # cm", text) == pytest.approx(CM * goal.job.length, rel=0.01)
    assert goal.job.to_dict(goal)["keep_out"] == [{"circle": [1.2, -1.5, 0.3]}]


def test_a_tracker_says_what_the_motor_does() -> None:
    tracker = sf.Tracker(made("plan"))
    command = tracker.update(0.0)
    until = number(r"motor \+1 until # s", repr(tracker))
    assert until == pytest.approx(command.flip_at * CONTROL.time_scale, rel=0.01)
    assert "alarm: none" in repr(tracker)
    assert tracker.pose == pytest.approx(made("plan").start)
    command = tracker.update(command.flip_at)
    assert "motor -1 until" in repr(tracker)
    assert tracker.to_dict()["direction"] == command.direction == -1
    assert set(tracker.to_dict()["learned"]) == set(tracker.learned)


def test_robots_and_tables_say_their_numbers_and_tables_are_saved_and_loaded(tmp_path: Path) -> None:
    text = repr(CONTROL)
    assert number(r"l = # cm", text) == 11
    assert number(r"motor # rpm", text) == pytest.approx(CONTROL.motor_speed * 30 / math.pi, rel=1e-3)
    assert number(r"unit of time # s", text) == pytest.approx(CONTROL.time_scale, rel=1e-3)
    assert list(sf.effects())[1] in repr(made("robot with effects"))
    table, own, text = made("table"), made("own table"), repr(made("table"))
    assert table.identity in text
    assert number(r"yaw rate # %", text) == pytest.approx(100 * table.errors["omega_yr_bar"]["median"], rel=0.05)
    assert table.to_frame().loc["v_z", "median"] == table.errors["v_z"]["median"]
    largest = 100 * max(error["rms"] for error in own.errors.values())
    assert number(r"largest error # %", repr(own)) == pytest.approx(largest, rel=0.05)
    assert number(r"turn radius # l", repr(own)) == pytest.approx(own.steady["R_yr_over_l"][0], rel=1e-3)
    assert own.to_dict()["robot"] == own.robot
    for saved, file in ((table, "model.safetensors"), (own, "own.json")):
        saved.save(tmp_path / file)
        assert sf.load_table(tmp_path / file).identity == saved.identity
