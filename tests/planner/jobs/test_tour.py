"""Tours visit all places, in the quickest order, also in the simulator and with a tracker."""

from __future__ import annotations

import json
from dataclasses import replace
from itertools import pairwise, permutations
from pathlib import Path

import numpy as np
import pytest

from planner.jobs.tour import tour
from planner.jobs.travel_times import Travel
from planner.paths.distance import distance_to
from planner.paths.obstacles import Circle, FreeSpace
from planner.paths.tractrix import STILL
from planner.planning.request import PlanRequest
from planner.tracking.swim import swim
from planner.tracking.tracker import Tracker
from planner.vehicle.dwell_choice import dwells_for
from planner.vehicle.tracked_point import TrackedVehicle, tracked_vehicle
from planner.vehicle.zigzag import zigzag
from sim.io.errors import InputError, run_command
from sim.model.presets import PRESETS
from sim.motion.replay import replay
from tests.planner.vehicles import FINE

CONTROL = PRESETS["paper-control"]
PLACES = [(0.0, 0.0), (4.0, 0.0), (2.0, 1.0), (3.0, 3.0), (-1.0, 2.0)]
QUICK = PlanRequest(objective="time")


@pytest.fixture(scope="module")
def tracked() -> TrackedVehicle:
    return tracked_vehicle(CONTROL, None, "head_centre", None)


def legs(tracked: TrackedVehicle, places: np.ndarray) -> np.ndarray:
    """Compute the times (n, 72, n, 72) between places, with 72 directions of motion at each."""
    dwell = dwells_for(tracked.vehicle, "time", None)[0]
    travel = Travel.of(tracked, zigzag(tracked.vehicle, dwell), FreeSpace(), STILL, 0.0)
    course = 2 * np.pi * np.arange(72) / 72
    axis = np.stack([np.cos(course), np.sin(course)], 1)
    poses = np.concatenate([[np.c_[place - tracked.rod * axis, course] for place in places]]).reshape(-1, 3)
    times = travel.times(np.repeat(poses, len(poses), 0), np.tile(poses, (len(poses), 1)))
    return times.reshape(len(places), 72, len(places), 72)


def fixed_order(order: tuple[int, ...], times: np.ndarray) -> float:
    """Compute the time of an order of places, one leg after another."""
    total = np.zeros(72)
    for here, there in pairwise(order):
        total = (total[:, None] + times[here, :, there]).min(0)
    return float(total.min())


@pytest.mark.parametrize("size", [1.0, 0.4])  # of the places' distances; the smaller ones are those of a turn
@pytest.mark.parametrize("back", [False, True])
@pytest.mark.parametrize("any_start", [False, True])
def test_no_other_order_of_the_places_takes_less_time(
    tracked: TrackedVehicle, size: float, back: bool, any_start: bool
) -> None:
    places = size * np.array([(0, 0), (4, 0), (2, 1), (3, 3), (-1, 2)])
    best = tour(places.tolist(), tracked, QUICK, back=back, any_start=any_start)
    assert best.exact
    assert 0.7 * best.estimate < best.plan.duration < 1.1 * best.estimate  # longer dwells may be faster
    assert best.order[0] == (best.order[-1] if back else best.order[0] if any_start else 0)
    assert sorted(set(best.order)) == [0, 1, 2, 3, 4]
    times = legs(tracked, places)
    for order in permutations(range(5)):
        if any_start or order[0] == 0:
            assert best.estimate <= fixed_order((*order, *order[: int(back)]), times) * 1.001


def test_every_place_is_on_the_declared_path(tracked: TrackedVehicle) -> None:
    result = tour(PLACES, tracked, PlanRequest())
    assert distance_to(result.plan.reference, np.array(PLACES)).max() < 0.005
    assert result.distance.max() <= result.plan.predicted_max + 0.005
    assert (np.diff(result.reached) > 0).all()


@pytest.mark.parametrize("size", [1.0, 0.4])
def test_a_quick_tour_begins_on_its_first_place(tracked: TrackedVehicle, size: float) -> None:
    result = tour([(size * x, size * y) for x, y in PLACES], tracked, QUICK)
    assert result.distance[0] < 0.03
    assert result.plan.straight.largest > 0.08  # where a dwell of the zigzag begins


def test_the_point_that_is_asked_for_passes(tracked: TrackedVehicle) -> None:
    by_pivot = tracked_vehicle(CONTROL, None, "pivot", None)
    result = tour(PLACES[:3], by_pivot, QUICK)
    assert distance_to(result.plan.declared.reference.q, np.array(PLACES[:3])).max() < 0.005


def test_among_obstacles_it_keeps_clear(tracked: TrackedVehicle) -> None:
    space = FreeSpace.of([Circle(2.0, 2.3, 0.4), Circle(1.0, 0.6, 0.3)])
    result = tour(PLACES, tracked, PlanRequest(), space)
    kept = result.plan.kept_clear
    assert kept is not None
    assert kept.margin >= result.plan.stated_error
    assert kept.clearance > 0
    assert not result.exact
    assert distance_to(result.plan.reference, np.array(PLACES)).max() < 0.05


def test_the_simulator_visits_all_places(tracked: TrackedVehicle) -> None:
    result = tour(PLACES[:4], tracked, QUICK)
    track = replay([result.plan.schedule()])[0]
    points = track[["x_over_l", "y_over_l"]].to_numpy(float)
    assert distance_to(points, np.array(PLACES[:4])).max() < result.plan.stated_error + 0.05


def test_a_tracked_robot_with_wrong_coefficients_visits_all(tracked: TrackedVehicle) -> None:
    result = tour(PLACES[:3], tracked, PlanRequest())
    twist = tracked.vehicle.twist * np.array([1.02, 1.0, 1.02])
    car = replace(tracked.vehicle, twist=twist)
    distances = swim(Tracker(result.plan), result.plan, car, FINE).distance
    assert distances.max() < 0.08


@pytest.mark.parametrize(
    ("places", "options", "expected"),
    [
        (["0,0"], [], "two or more"),
        (["0,0", "1,1", "0,0"], [], "places 1 and 3 are the same"),
        (["0,0", "one,1"], [], "place one,1: one; write a length"),
        (["0,0", "1"], [], "write X,Y"),
        (["0,0", "2,0", "4,0"], ["--keep-out", "circle:2,0,0.5"], "place 2 at"),
        (["0,0", "nan,0"], [], "nan; write a length"),
    ],
)
def test_the_command_refuses_in_one_line(
    places: list[str], options: list[str], expected: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    from planner.__main__ import main

    words = ["tour", *places, "--unit", "l", "--robot", "paper-control", "--out", str(tmp_path / "out"), *options]
    assert run_command(main, words) == 2
    error = capsys.readouterr().err
    assert expected in error
    assert len(error.splitlines()) == 1
    assert not (tmp_path / "out").exists()


def test_the_command_reads_places_from_words_and_files(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from planner.__main__ import main

    cm = 100 * CONTROL.tail_length
    (tmp_path / "places.csv").write_text("x_cm,y_cm\n" + "".join(f"{cm * x},{cm * y}\n" for x, y in PLACES[:3]))
    common = ["--robot", "paper-control", "--objective", "time", "--out"]
    assert run_command(main, ["tour", str(tmp_path / "places.csv"), *common, str(tmp_path / "one")]) == 0
    assert "order: 1 3 2; no other order is quicker" in capsys.readouterr().out
    assert run_command(main, ["tour", "0,0", "4l,0", "2l,1l", *common, str(tmp_path / "two")]) == 0
    one, two = (json.loads((tmp_path / name / "tour.json").read_text()) for name in ("one", "two"))
    assert one["order"] == two["order"] == [0, 2, 1]
    assert np.array(one["places"]) == pytest.approx(np.array(two["places"]))
    assert {"plan.json", "schedule.h", "tour.svg"} <= {path.name for path in (tmp_path / "one").iterdir()}


def test_bad_places_are_refused_in_python(tracked: TrackedVehicle) -> None:
    with pytest.raises(InputError, match="two or more"):
        tour([(0, 0, 0), (1, 1, 1)], tracked, QUICK)
