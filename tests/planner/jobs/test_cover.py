"""Coverage: what is swept, in what time, by lanes in a good order, also in the simulator and among obstacles."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from planner.jobs.cover import cover
from planner.jobs.region import Field, share_covered
from planner.paths.obstacles import Circle, FreeSpace, Polygon
from planner.planning.declared_path import TIGHTEST
from planner.planning.request import PlanRequest
from planner.tracking.swim import swim
from planner.tracking.tracker import Tracker
from planner.vehicle.tracked_point import TrackedVehicle, tracked_vehicle
from sim.io.errors import InputError, run_command
from sim.model.presets import PRESETS
from sim.motion.replay import replay
from tests.planner.vehicles import FINE

CONTROL = PRESETS["paper-control"]
FIELD = Field(Polygon.of([[0, 0], [3, 0], [3, 1.5], [0, 1.5]]))
QUICK = PlanRequest(objective="time")


@pytest.fixture(scope="module")
def tracked() -> TrackedVehicle:
    return tracked_vehicle(CONTROL, None, "head_centre", None)


def test_it_covers_the_region_by_turns_that_the_robot_can_make(tracked: TrackedVehicle) -> None:
    swept = cover(FIELD, 0.5, tracked, PlanRequest())
    assert swept.share > 0.995
    assert swept.share == share_covered(FIELD, swept.plan.track, 0.5)
    assert 0.7 < swept.sure <= swept.share
    assert swept.plan.declared.curvature * tracked.vehicle.pivot_radius < TIGHTEST
    assert swept.exact
    assert len(swept.lanes) == 4


@pytest.mark.parametrize(("share", "proposed"), [(0.8, "80.0 % if a camera"), (0.0, "give more than")])
def test_what_is_not_certain_without_a_camera_proposes_one(
    tracked: TrackedVehicle, share: float, proposed: str
) -> None:
    swept = cover(Field(Polygon.of([[0, 0], [1, 0], [1, 0.5], [0, 0.5]])), 0.5, tracked, PlanRequest())
    assert swept.sure <= swept.sure_tracked <= swept.share
    said = replace(swept, sure=0.0, sure_tracked=share).lines()[1]
    assert "0.0 % wherever the robot is within the stated error" in said
    assert proposed in said
    assert "--feedback" in said
    assert "--feedback" not in replace(swept, sure=0.9, sure_tracked=0.9).lines()[1]


def test_the_bound_is_area_by_width_and_speed(tracked: TrackedVehicle) -> None:
    swept = cover(FIELD, 0.5, tracked, QUICK)
    assert swept.bound == pytest.approx(4.5 / (0.5 * swept.plan.straight.net_speed), rel=0.01)
    assert swept.plan.duration > swept.bound


def test_the_direction_of_lanes_is_the_quickest(tracked: TrackedVehicle) -> None:
    best = cover(FIELD, 0.5, tracked, QUICK)
    across = cover(FIELD, 0.5, tracked, QUICK, angle=np.pi / 2)
    assert best.plan.duration < across.plan.duration
    assert np.ptp(best.lanes[:, :, 1], axis=1).max() < 1e-9


def test_lanes_are_in_the_quickest_order(tracked: TrackedVehicle) -> None:
    """Neighbouring lanes one after another would need wider loops than this robot's turns."""
    swept = cover(Field(Polygon.of([[0, 0], [4, 0], [4, 3], [0, 3]])), 0.4, tracked, QUICK)
    steps = np.abs(np.diff(swept.lanes[:, 0, 1]))
    assert np.median(steps) > 0.6


def test_keep_outs_are_not_touched(tracked: TrackedVehicle) -> None:
    rock = Circle(1.5, 0.8, 0.2)
    swept = cover(replace(FIELD, holes=(rock,)), 0.5, tracked, PlanRequest(), FreeSpace((rock,)))
    kept = swept.plan.kept_clear
    assert kept is not None
    assert kept.clearance > 0
    assert kept.margin >= swept.plan.stated_error
    assert swept.share > 0.85


@pytest.mark.rest
def test_the_simulator_covers_the_same(tracked: TrackedVehicle) -> None:
    swept = cover(FIELD, 0.5, tracked, QUICK)
    track = replay([swept.plan.schedule()])[0][["x_over_l", "y_over_l"]].to_numpy(float)
    assert share_covered(FIELD, track, 0.5) == pytest.approx(swept.share, abs=0.02)
    assert share_covered(FIELD, track, 0.5) >= swept.sure


def test_a_tracked_robot_with_wrong_coefficients_stays_on_its_lanes(tracked: TrackedVehicle) -> None:
    swept = cover(Field(Polygon.of([[0, 0], [2, 0], [2, 0.8], [0, 0.8]])), 0.5, tracked, PlanRequest())
    car = replace(tracked.vehicle, twist=tracked.vehicle.twist * np.array([1.02, 1.0, 1.02]))
    distances = swim(Tracker(swept.plan), swept.plan, car, FINE).distance
    assert distances.max() < 0.08


def test_refusals(tracked: TrackedVehicle) -> None:
    with pytest.raises(InputError, match="zigzag alone"):
        cover(FIELD, 0.04, tracked, PlanRequest())
    with pytest.raises(InputError, match="more than 80 lanes"):
        cover(Field(Polygon.of([[0, 0], [60, 0], [60, 60], [0, 60]])), 0.5, tracked, PlanRequest())
    with pytest.raises(InputError, match="no lane of the region is clear"):
        cover(FIELD, 0.5, tracked, PlanRequest(), FreeSpace((), Polygon.of([[0, 0], [3, 0], [3, 1.5], [0, 1.5]])))


def test_the_command_reads_units_and_writes_all_files(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from planner.__main__ import main

    cm = 100 * CONTROL.tail_length
    (tmp_path / "field.csv").write_text("x_cm,y_cm\n" + "".join(f"{cm * x},{cm * y}\n" for x, y in
                                                                 [(0, 0), (2, 0), (2, 1), (0, 1)]))  # fmt: skip
    words = ["cover", str(tmp_path / "field.csv"), "--width", f"{0.5 * cm}cm", "--robot", "paper-control"]
    words += ["--objective", "time", "--out", str(tmp_path / "out")]
    assert run_command(main, words) == 0
    said = capsys.readouterr().out
    assert "lanes for a width of 5.5 cm (0.5 l)" in said
    assert "% as predicted" in said
    content = json.loads((tmp_path / "out" / "cover.json").read_text())
    assert content["width_over_l"] == pytest.approx(0.5)
    assert np.array(content["outline"]["polygon"]) == pytest.approx(np.array([[0, 0], [2, 0], [2, 1], [0, 1]]))
    assert {"plan.json", "schedule.h", "cover.svg"} <= {path.name for path in (tmp_path / "out").iterdir()}


@pytest.mark.parametrize(
    ("options", "expected"),
    [
        (["box:0,0,2l,1l", "--width", "4km"], "--width: 4km; write a length"),
        (["box:0,0,2l", "--width", "4cm"], "write box"),
        (["none.csv", "--width", "4cm"], "none.csv"),
    ],
)
def test_the_command_refuses_in_one_line(
    options: list[str], expected: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    from planner.__main__ import main

    words = ["cover", *options, "--robot", "paper-control", "--out", str(tmp_path / "out")]
    assert run_command(main, words) == 2
    error = capsys.readouterr().err
    assert expected in error
    assert len(error.splitlines()) == 1
    assert not (tmp_path / "out").exists()
