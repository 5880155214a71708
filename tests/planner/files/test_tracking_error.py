"""A track against its plan, in the columns of a replay or of a camera."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from planner.files.tracking_error import tracking_error
from planner.paths.path import circle
from planner.planning.plan import plan
from sim.io.errors import InputError
from sim.model.presets import PRESETS

CONTROL = PRESETS["paper-control"]


@pytest.fixture(scope="module")
def planned() -> tuple[dict[str, object], pd.DataFrame]:
    """A plan, and the track that it predicts at the flips, 1 mm off."""
    result = plan(circle(2.0), CONTROL)
    x, y, heading = result.poses.T
    time = np.concatenate([[0.0], np.cumsum(result.dwells)])
    off = 0.001 / CONTROL.tail_length
    return result.to_dict(), pd.DataFrame(
        {"time_bar": time, "x_over_l": x + off, "y_over_l": y, "heading_rad": heading}
    )


def test_a_track_of_a_camera_has_the_error_of_the_same_track_in_tail_lengths(
    planned: tuple[dict[str, object], pd.DataFrame],
) -> None:
    """Only the columns of a replay used to be taken."""
    record, track = planned
    seen = pd.DataFrame(
        {
            "t [min]": track["time_bar"] * CONTROL.time_scale / 60,
            "X (mm)": 1000 * CONTROL.tail_length * track["x_over_l"],
            "y_cm": 100 * CONTROL.tail_length * track["y_over_l"],
            "heading_deg": np.degrees(track["heading_rad"]),
        }
    ).rename(columns={"t [min]": "time_min"})
    expected, error = tracking_error(record, track), tracking_error(record, seen)
    for name in ("rms", "largest", "raw_rms", "raw_largest", "missed"):
        assert getattr(error, name) == pytest.approx(getattr(expected, name), rel=1e-9)
    assert error.largest * CONTROL.tail_length < 0.0035
    assert f"{1000 * error.rms * CONTROL.tail_length:.3g} mm ({error.rms:.3g} l) rms" in error.line


def test_the_track_of_another_robot_is_refused(planned: tuple[dict[str, object], pd.DataFrame]) -> None:
    """A replay has places in cm and in l; those in cm were not read, and a larger square passed."""
    record, track = planned
    cm = 100 * CONTROL.tail_length
    own, other = (
        track.assign(x_cm=size * track["x_over_l"], y_cm=size * track["y_over_l"], heading_deg=0.0)
        for size in (cm, 15.0)
    )
    assert tracking_error(record, own).rms == tracking_error(record, track).rms
    with pytest.raises(
        InputError, match="x_over_l and x_cm of the track disagree with the plan's tail length, 11 cm"
    ):
        tracking_error(record, other)


def test_the_track_of_another_plan_is_refused(planned: tuple[dict[str, object], pd.DataFrame]) -> None:
    """The track of a square of the same robot passed; one that has no id is taken as it is."""
    record, track = planned
    own = track.assign(plan_id=record["id"]).astype({"plan_id": object})
    own.loc[3, "plan_id"] = None
    assert tracking_error(record, own).rms == tracking_error(record, track).rms
    with pytest.raises(InputError, match=f"the track is of plan p0123456789a, not of {record['id']}"):
        tracking_error(record, track.assign(plan_id="p0123456789a"))


def test_a_track_without_a_column_is_refused(planned: tuple[dict[str, object], pd.DataFrame]) -> None:
    record, track = planned
    with pytest.raises(InputError, match="no column 'time_s'; it needs time_s, x_cm, y_cm and heading_deg"):
        tracking_error(record, track.drop(columns="time_bar"))
    with pytest.raises(InputError, match="no column 'x_cm'; it needs"):
        tracking_error(record, pd.DataFrame({"time_s": [0.0], "y_cm": [0.0], "heading_deg": [0.0]}))
    with pytest.raises(InputError, match="'y' has no unit"):
        tracking_error(record, pd.DataFrame({"time_s": [0.0], "x_cm": [0.0], "y": [0.0], "heading_deg": [0.0]}))
    with pytest.raises(InputError, match="not a finite number"):
        tracking_error(record, track.assign(x_over_l=np.nan))
    with pytest.raises(InputError, match="time goes back at row 2; give a row for each time, in order"):
        tracking_error(record, track[::-1])


def test_the_table_of_dwells_is_in_centimetres_and_degrees_too() -> None:
    table = plan(circle(2.0), CONTROL).to_frame()
    assert table["x_cm"].to_numpy() == pytest.approx(11 * table["x_over_l"].to_numpy())
    assert table["y_cm"].to_numpy() == pytest.approx(11 * table["y_over_l"].to_numpy())
    assert np.radians(table["heading_deg"].to_numpy()) == pytest.approx(table["heading_rad"].to_numpy())
