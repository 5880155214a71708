"""A vehicle of five measured numbers: against the bicycle, an integrated relaxation, and its own differences."""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import cumulative_simpson, solve_ivp

import softflagella as sf
from common.errors import InputError
from planner.jobs.plan import plan
from planner.paths.distance import distance_to
from planner.paths.path import Path2D, circle, polygon
from planner.planning.plan import Plan
from planner.vehicle.measured import MeasuredVehicle
from planner.vehicle.vehicle import Switches, Vehicle, roll_out
from sim.mechanics import planar
from softflagella.__main__ import main
from tests.processes import ROOT

NUMBERS = ("speed", "turn_left", "turn_right", "slip", "lag")
SWIMMER = MeasuredVehicle(
    speed=(0.02, 4e-4), turn_left=(0.25, 0.01), turn_right=(0.2, 0.01), slip=(0.4, 0.02), lag=(0.8, 0.1)
)


def _integrated(vehicle: MeasuredVehicle, seconds: np.ndarray) -> np.ndarray:
    """Integrate the equations of motion from rest, left first: poses (M + 1, 3) in m and rad."""
    speed, left, right, slip, lag = (vehicle.measured(name)[0] for name in NUMBERS)
    pose, twist, poses = np.zeros(3), np.zeros(3), [np.zeros(3)]
    for number, dwell in enumerate(seconds):
        sign = 1 if number % 2 == 0 else -1
        own = np.array([speed * math.cos(slip), sign * speed * math.sin(slip), left if sign > 0 else -right])

        def rate(t: float, pose: np.ndarray, begun: np.ndarray = twist, own: np.ndarray = own) -> list[float]:
            ahead, across, yaw = own + (begun - own) * math.exp(-t / lag)
            c, s = math.cos(pose[2]), math.sin(pose[2])
            return [c * ahead - s * across, s * ahead + c * across, yaw]

        pose = solve_ivp(rate, (0, dwell), pose, rtol=1e-10, atol=1e-12).y[:, -1]
        twist = own + (twist - own) * math.exp(-dwell / lag)
        poses.append(pose)
    return np.array(poses)


def _at_flips(vehicle: MeasuredVehicle, motion: Vehicle, seconds: np.ndarray) -> np.ndarray:
    """Predict poses (M + 1, 3) in m and rad, left first."""
    poses = roll_out(motion, Switches(1, seconds / vehicle.time_scale, np.zeros((1, 3)))).flips
    return poses * [vehicle.length_scale, vehicle.length_scale, 1]


@pytest.mark.parametrize(("dwells", "error"), [(0.3, 0.012), (0.6, 0.001), ("random", 0.002)])
def test_the_motion_is_that_of_a_twist_that_relaxes(dwells: float | str, error: float) -> None:
    rng = np.random.default_rng(0)
    seconds = (rng.uniform(0.3, 1.2, 40) if dwells == "random" else np.full(40, dwells)) * SWIMMER.time_scale
    predicted = _at_flips(SWIMMER, SWIMMER.motion(), seconds)
    assert np.abs(predicted - _integrated(SWIMMER, seconds)).max() < error


def test_a_zigzag_whose_start_is_forgotten_is_exact() -> None:
    """There what the dwell before left is that of a dwell of the same length."""
    seconds = np.full(40, 0.25) * SWIMMER.time_scale
    ends = (_at_flips(SWIMMER, SWIMMER.motion(), seconds), _integrated(SWIMMER, seconds))
    first, second = (planar.between(poses[10], poses[-1]) for poses in ends)
    assert first == pytest.approx(second, abs=3e-4)


def test_a_lag_below_its_standard_deviation_has_a_mode_of_its_size() -> None:
    """After a long dwell a lag of τ has turned the vehicle less by twice the yaw rate times τ."""
    (mode,) = MeasuredVehicle(speed=0.02, turn_left=0.25, turn_right=0.2, lag=(0.05, 0.1)).motion().modes
    assert mode.lag is not None
    assert mode.lag[:, -1, -1, 2] == pytest.approx([-0.045, 0.045], rel=1e-3)


def test_without_lag_it_is_the_bicycle() -> None:
    """Front wheel at the tracked point, wheel base b: the rear axle moves on circles of radius R."""
    base, radius, speed = 0.024, 0.22, 0.005
    yaw = speed / math.hypot(base, radius)
    needle = MeasuredVehicle(speed=speed, turn_left=yaw, turn_right=yaw, slip=math.atan(base / radius))
    motion = needle.motion()
    length = needle.length_scale
    assert motion.pivot_distance * length == pytest.approx(base)
    assert motion.pivot_radius * length == pytest.approx(radius)
    assert not motion.lag.any()
    assert not motion.rest.any()
    assert motion.modes == ()


@pytest.mark.parametrize("name", NUMBERS)
def test_a_mode_is_what_one_standard_deviation_changes(name: str) -> None:
    seconds = np.full(11, 0.5) * SWIMMER.time_scale  # from the second flip on nothing is left of the start
    value, spread = SWIMMER.measured(name)
    own, other = (_at_flips(v, v.motion(), seconds) for v in (SWIMMER, replace(SWIMMER, **{name: value + spread})))
    motion = SWIMMER.motion()
    mode = next(mode for mode in motion.modes if mode.name == name)
    moved = replace(motion, twist=motion.twist + mode.twist, lag=motion.lag + mode.lag)
    ends = [planar.between(poses[2], poses[-1]) for poses in (_at_flips(SWIMMER, moved, seconds), own, other)]
    assert np.abs(ends[0] - ends[1]).max() > 1e-3
    assert ends[0] == pytest.approx(ends[2], abs=0.1 * np.abs(ends[2] - ends[1]).max())


def test_a_file_holds_the_same_vehicle(tmp_path: Path) -> None:
    file = tmp_path / "fish.toml"
    lines = [f"{key} = {value!r}" for key, value in SWIMMER.to_dict().items()]
    file.write_text("\n".join(lines).replace("'", '"'))
    assert MeasuredVehicle.load(file) == SWIMMER
    file.write_text("speed_cm_s = [2, 0.1]\nturn_left_deg_s = 20\nturn_right_deg_s = 19.0\nlag_s = 1\n")
    fish = MeasuredVehicle.load(file)
    assert fish.name == "fish"
    assert fish.measured("speed") == pytest.approx((0.02, 0.001))
    assert fish.measured("turn_left") == pytest.approx((math.radians(20), 0.0))


def test_the_example_is_that_of_the_page_and_is_a_vehicle_alone(tmp_path: Path) -> None:
    file = tmp_path / "vehicle.toml"
    main(["robot", "vehicle", "--out", str(file)])
    assert MeasuredVehicle.load(file).measured("speed") == pytest.approx((0.25, 0.005))
    assert file.read_text() in (ROOT / "docs/howto/vehicle.md").read_text()
    with pytest.raises(InputError, match=r"vehicle.toml: a vehicle has no simulation.*give a robot.toml or"):
        main(["steady", str(file)])
    with pytest.raises(InputError, match="--set changes presets"):
        main(["robot", "vehicle", "--set", "speed_cm_s=3", "--out", str(file)])
    with pytest.raises(InputError, match=r"there are paper-control, .* and vehicle"):
        main(["robot", "car", "--out", str(file)])


@pytest.mark.parametrize(
    ("lines", "words"),
    [
        ("speed_cm_s = 2\nturn_left_deg_s = 20", "no turn_right; write a line turn_right_deg_s"),
        ("speed_deg = 2", "speed_deg is no line of a vehicle"),
        ("velocity_cm_s = 2", "velocity_cm_s is no line of a vehicle"),
        ("speed = 2", "speed is no line of a vehicle"),
        ("speed_cm_s = 'fast'", "write a number, or"),
        ("speed_cm_s = [1, 2, 3]", "write a number, or"),
        ("speed_cm_s = [1, 0.5]\nturn_left_deg_s = 20\nturn_right_deg_s = 20", "above 0 by three standard"),
        ("speed_cm_s = 1\nturn_left_deg_s = 20\nturn_right_deg_s = -20", "turn_right = -0.349"),
        ("speed_cm_s = 1\nturn_left_deg_s = 20\nturn_right_deg_s = 20\nslip_deg = -5", "further ahead"),
        ("speed_cm_s = 1\nturn_left_deg_s = 20\nturn_right_deg_s = 20\nlag_s = -1", "not below 0"),
        ("speed_cm_s = nan\nturn_left_deg_s = 20\nturn_right_deg_s = 20", "finite"),
    ],
)
def test_bad_files(tmp_path: Path, lines: str, words: str) -> None:
    file = tmp_path / "vehicle.toml"
    file.write_text(lines)
    with pytest.raises(InputError, match=f"vehicle.toml.*{words}"):
        MeasuredVehicle.load(file)


@pytest.mark.parametrize("path", [circle(4.0), polygon(3, 5.0)], ids=["circle", "triangle"])
def test_the_stated_error_holds_for_vehicles_within_the_tolerances(path: Path2D) -> None:
    """200 vehicles with numbers drawn from their normal distributions, moved without the planner's tables.

    Deviations are of first order, so with errors of 4 % a tight triangle holds 88 % of them, a circle 98 %.
    """
    result = plan(path, SWIMMER)
    means, spreads = np.array([SWIMMER.measured(name) for name in NUMBERS]).T
    drawn = means + spreads * np.random.default_rng(1).normal(size=(200, 5))
    tracks = _moved(drawn, result.dwells * SWIMMER.time_scale, result.first_direction, result.start)
    largest = np.array([distance_to(result.reference, track / SWIMMER.length_scale).max() for track in tracks])
    assert (largest <= result.stated_error).mean() >= 0.85
    assert np.quantile(largest, 0.95) > 0.6 * result.stated_error  # not by a large margin


@pytest.mark.parametrize("slip", [0.0, 0.1, 0.5, 2.0, 5.0])
@pytest.mark.parametrize("corner", ["nearest", "minimax", "fillet"])
@pytest.mark.parametrize(
    "path",
    [polygon(4, 50.0), polygon(3, 5.0), Path2D.of([[0, 0], [5, 0], [5, 5]])],
    ids=["square", "triangle", "L"],
)
def test_a_car_rounds_corners_by_about_its_turn_radius(path: Path2D, corner: Any, slip: float) -> None:
    car = MeasuredVehicle(speed=0.25, turn_left=0.6, turn_right=0.5, slip=math.radians(slip))
    declared = plan(path, car, corner=corner, objective="flips").declared
    radius = car.motion().pivot_radius
    assert 0.6 / radius < declared.curvature <= 0.95 / radius
    assert max(declared.off_drawn, declared.missed) < (1.5 if corner == "fillet" else 1.0) * radius  # of 120°


def _moved(numbers: np.ndarray, seconds: np.ndarray, sign: int, start: Sequence[float]) -> np.ndarray:
    """Move vehicles (D, 5) from rest: tracks (D, K, 2) in m."""
    speed, left, right, slip, lag = numbers.T
    place = np.broadcast_to(np.array(start[:2]) * SWIMMER.length_scale, (len(numbers), 2))
    heading, twist, tracks = np.full(len(numbers), start[2]), np.zeros((len(numbers), 3)), [place[:, None]]
    for dwell in seconds:
        own = np.stack([speed * np.cos(slip), sign * speed * np.sin(slip), left if sign > 0 else -right], 1)
        t = np.linspace(0, dwell, 41)
        left_over = (twist - own)[:, None] * np.exp(-t / lag[:, None])[..., None]
        headings = heading[:, None] + own[:, 2:] * t + lag[:, None] * ((twist - own)[:, 2:] - left_over[..., 2])
        velocity = planar.turn((own[:, None] + left_over)[..., :2], headings)
        track = place[:, None] + cumulative_simpson(velocity, x=t, axis=1, initial=0)
        tracks.append(track[:, 1:])
        place, heading, twist, sign = track[:, -1], headings[:, -1], own + left_over[:, -1], -sign
    return np.concatenate(tracks, 1)


JOBS: dict[str, Callable[[], Plan[Any]]] = {
    "path": lambda: sf.plan("circle:30cm", SWIMMER),
    "goal": lambda: sf.to_goal(("0cm", "0cm", "0"), ("80cm", "0cm", "30"), SWIMMER, feedback=True),
    "tour": lambda: sf.tour(["0,0", "50,20", "20,60"], SWIMMER, unit="cm"),
    "hold": lambda: sf.hold("0,0", SWIMMER, seconds="10min", unit="cm"),
}


@pytest.mark.parametrize("job", JOBS)
def test_every_job_is_planned_kept_and_tracked(job: str, tmp_path: Path) -> None:
    result = JOBS[job]()
    again = sf.restore_plan(sf.write_plan(result, tmp_path)[0])
    assert again.robot == SWIMMER
    assert again.stated_error == result.stated_error
    assert sf.Tracker(again).command.flip_at == pytest.approx(sf.Tracker(result).command.flip_at, abs=1e-6)
    assert "MOTOR_RPM" not in (tmp_path / "schedule.h").read_text()


def test_a_vehicle_swims_as_planned_and_cannot_be_simulated(tmp_path: Path) -> None:
    result = sf.plan("circle:30cm", SWIMMER)
    swum = sf.swim(result)
    assert swum.finished
    assert "coefficients" not in result.error_line
    assert "start: put the vehicle's point at" in repr(result)
    assert swum.within(result.feedback_error) > 0.9
    with pytest.raises(InputError, match="measured vehicle; only robots"):
        result.schedule()
    file = sf.write_plan(result, tmp_path)[0]
    with pytest.raises(InputError, match="measured vehicle; only robots"):
        sf.load_schedule(file)
    with pytest.raises(InputError, match="needs no look-up table"):
        sf.plan("circle:30cm", SWIMMER, own_table=True)


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ({"speed": "fast"}, r"speed = 'fast'; give a number, or \(value, standard deviation\)"),
        ({"speed": None}, "speed = None; give a number"),
        ({"lag": (1.0, 2.0, 3.0)}, r"lag = \(1.0, 2.0, 3.0\); give a number"),
        ({"length": "9"}, "length = '9'; give a number$"),
        ({"width": (1.0, 2.0)}, r"width = \(1.0, 2.0\); give a number$"),
        ({"slip": True}, "slip = True; give a number"),
        ({"name": None}, "name = None; give a text"),
        ({"turn_left": 1e-9}, "turn_left = 1e-09 rad/s; give 1e-05, a turn in a week, or more"),
    ],
)
def test_what_is_no_number_of_a_vehicle_is_refused_by_name(wrong: dict[str, Any], words: str) -> None:
    with pytest.raises(InputError, match=words):
        replace(SWIMMER, **wrong)
