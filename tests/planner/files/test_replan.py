"""Tracks from files and tables: trips to a goal are planned again, bad tracks are refused in one line."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import softflagella as sf
from sim.io.errors import InputError

ROBOT = sf.load_robot("paper-control")
CM = 100 * ROBOT.tail_length


@cache
def square() -> sf.Plan:
    return sf.plan(sf.polygon(4, side=3.0), ROBOT, minimum_dwell=0.8)


@cache
def trip() -> sf.GoalPlan:
    return sf.to_goal(
        (0, 0, 0), (5, 1, 0.5), ROBOT, via=[(1.0, 0.3), (3.0, 0.5)], keep_out=[sf.Circle(2.0, -0.9, 0.3)]
    )


def track_of(plan: sf.Plan, share: float) -> pd.DataFrame:
    """Return the camera's table of a share of the dwells."""
    frame = plan.to_frame().iloc[: round(share * len(plan.dwells)) + 1]
    return frame[["start_s", "x_cm", "y_cm", "heading_deg"]].rename(columns={"start_s": "time_s"})


def test_a_saved_plan_and_one_in_memory_have_the_same_rest(tmp_path: Path) -> None:
    track = track_of(square(), 0.4)
    sf.write_plan(square(), tmp_path / "plan")
    track.to_csv(tmp_path / "track.csv", index=False)
    rest, saved = sf.replan(square(), track), sf.replan(tmp_path / "plan", tmp_path / "track.csv")
    assert isinstance(rest, sf.Plan)
    assert isinstance(saved, sf.Plan)
    assert saved.dwells == pytest.approx(rest.dwells, abs=1e-5)
    assert saved.start == pytest.approx(tuple(track_of(square(), 0.4).iloc[-1, 1:] / [CM, CM, 180 / np.pi]))


def test_other_units_and_an_unfinished_last_row(tmp_path: Path) -> None:
    track = track_of(square(), 0.4)
    words = [f"{t / 60},{10 * x},{10 * y},{np.radians(h)}" for t, x, y, h in track.to_numpy().tolist()]
    (tmp_path / "track.csv").write_text("\n".join(["time_min,x_mm,y_mm,heading_rad", *words, "9.1,30"]) + "\n")
    rest = sf.replan(square(), tmp_path / "track.csv")
    assert isinstance(rest, sf.Plan)
    assert rest.dwells == pytest.approx(sf.replan(square(), track).dwells, abs=1e-5)  # type: ignore[union-attr]


@pytest.mark.parametrize(("share", "left"), [(0.1, 2), (0.5, 1), (0.9, 0)])
def test_a_trip_goes_on_to_its_goal_through_the_places_that_are_left(
    share: float, left: int, tmp_path: Path
) -> None:
    track = track_of(trip().plan, share)
    after = sf.replan(trip(), track)
    assert isinstance(after, sf.GoalPlan)
    assert len(after.via) == left
    assert after.end_error[0] < 0.01
    assert after.clearance > 0
    assert after.plan.start == pytest.approx(tuple(track.iloc[-1, 1:] / [CM, CM, 180 / np.pi]), abs=1e-6)
    if left == 1:
        sf.write_plan(trip(), tmp_path)
        saved = sf.replan(tmp_path / "goal.json", track)
        assert isinstance(saved, sf.GoalPlan)
        assert saved.plan.dwells == pytest.approx(after.plan.dwells, abs=1e-4)


def test_tours_go_on_along_their_path() -> None:
    tour = sf.tour([(0, 0), (3, 0), (2, 1.5)], ROBOT)
    rest = sf.replan(tour, track_of(tour.plan, 0.5))
    assert isinstance(rest, sf.Plan)
    assert np.hypot(*(rest.track[-1] - [3, 0])) < 0.1 or np.hypot(*(rest.track[-1] - [2, 1.5])) < 0.1


@pytest.mark.parametrize(
    ("columns", "expected"),
    [
        ({"time_s": [0.0, 1.0], "x_cm": [0.0, 1.0], "y_cm": [0.0, 0.0]}, "no column 'heading_deg'"),
        ({"time_s": [0.0, 1.0], "x_cm": ["one", 1.0], "y_cm": 0.0, "heading_deg": 0.0}, "row 1 of the track"),
        ({"time_s": [0.0, 1.0], "x_cm": [0.0, 1e300], "y_cm": 0.0, "heading_deg": 0.0}, "row 2 of the track"),
        ({"time_s": [2.0, 1.0], "x_cm": [0.0, 1.0], "y_cm": 0.0, "heading_deg": 0.0}, "time goes back at row 2"),
    ],
)
def test_bad_tracks_are_refused_in_one_line(columns: dict[str, Any], expected: str) -> None:
    with pytest.raises(InputError, match=expected) as caught:
        sf.replan(square(), pd.DataFrame(columns))
    assert "\n" not in str(caught.value)
