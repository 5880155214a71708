"""Errors of a track against its plan are those of `planner check`."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
import pytest

from planner.files.tracking_error import tracking_error
from planner.planning.planned import Plan
from sim.io.errors import InputError
from tests.planner.page.page_core import EXACT, answer
from tests.planner.page.plans import planned

NAMES = {"rms": "rms", "largest": "largest", "raw_rms": "rawRms", "raw_largest": "rawLargest", "missed": "missed",
         "stated": "stated"}  # fmt: skip


def track(result: Plan, noise: float) -> pd.DataFrame:
    """Make a track of the head's centre near a plan's poses."""
    rng = np.random.default_rng(0)
    poses = result.poses + noise * rng.normal(size=result.poses.shape)
    time = np.concatenate([[0.0], np.cumsum(result.dwells)])
    columns = {"time_bar": time, "x_over_l": poses[:, 0], "y_over_l": poses[:, 1], "heading_rad": poses[:, 2]}
    return pd.DataFrame(columns)


def to_page(frame: pd.DataFrame) -> dict[str, Any]:
    plans = frame.get("plan_id", pd.Series(dtype=str)).unique().tolist()
    numbers = frame.drop(columns="plan_id", errors="ignore")
    return {"names": list(numbers), "columns": [numbers[name].to_list() for name in numbers], "plans": plans}


@pytest.mark.parametrize("noise", [0.0, 0.05, 2.0])
@pytest.mark.parametrize(("name", "point"), [("circle", "head_centre"), ("bend", "head_tip")])
def test_errors_and_their_sentence(name: str, point: str, noise: float) -> None:
    result = planned(name, objective="flips", point=point)
    content, frame = result.to_dict(), track(result, noise)
    cm = 100 * result.robot.tail_length
    lab = pd.DataFrame(
        {
            "time [min]": frame["time_bar"] * result.robot.time_scale / 60,
            "x_mm": frame["x_over_l"] * 10 * cm,
            "Y [cm]": frame["y_over_l"] * cm,
            "heading_deg": np.degrees(frame["heading_rad"]),
        }
    )
    for table in (frame, lab):
        wanted = tracking_error(content, table)
        found = answer("tracking_error.js", "trackingError", content, to_page(table))
        for python, page in NAMES.items():
            assert found[page] == pytest.approx(getattr(wanted, python), abs=EXACT)
        assert np.abs(np.array(found["track"]) - wanted.track).max() < EXACT
        assert answer("tracking_error.js", "trackingLine", found) == wanted.line


@pytest.mark.parametrize("change", ["missing", "still", "back", "nan", "another robot", "another plan", "bare"])
def test_bad_tracks_are_refused_in_the_same_words(change: str) -> None:
    result = planned("circle", objective="flips", point="head_centre")
    frame = track(result, 0.0)
    if change == "missing":
        frame = frame.drop(columns="heading_rad")
    elif change == "still":
        frame["time_bar"] = 1.0
    elif change == "back":
        frame = frame.iloc[[0, 2, 1, 3]]
    elif change == "nan":
        frame["x_over_l"] = 1e101
    elif change == "another robot":  # of tails of 15 cm
        frame["x_cm"], frame["y_cm"] = 15 * frame["x_over_l"], 15 * frame["y_over_l"]
        frame["heading_deg"] = np.degrees(frame["heading_rad"])
    elif change == "another plan":
        frame["plan_id"] = "p0123456789a"
    else:
        frame = frame.set_axis(["time", "x_cm", "y_cm", "heading_deg"], axis=1)
    with pytest.raises(InputError) as wanted:
        tracking_error(result.to_dict(), frame)
    found = answer("tracking_error.js", "trackingError", result.to_dict(), to_page(frame))
    assert str(found) == str(wanted.value)
