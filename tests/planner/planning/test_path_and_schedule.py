"""Declared path and schedule: remedies for tight paths work; the guaranteed error holds on random paths."""

from __future__ import annotations

import re
from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from common.errors import InputError
from planner.guidance.line_of_sight import follow, guaranteed, hysteresis, look_ahead
from planner.jobs.plan import plan
from planner.paths.distance import distance_to
from planner.paths.path import Path2D, circle, polygon, smoothed
from planner.paths.tractrix import STILL, Drift, reference
from planner.planning.declare import MOST_WORK, Feasibility, changed, cost, feasible, make_feasible, remedy
from planner.planning.request import Corner
from planner.progress import DECLARING, REMEDY, Progress
from planner.vehicle.vehicle import roll_out
from sim.mechanics import planar
from sim.model.presets import PRESETS
from sim.model.robot import Robot
from tests.planner.plans import CONTROL
from tests.planner.vehicles import plain_guidance, vehicle

pytestmark = pytest.mark.slow


def random_smooth_path(seed: int, length: float, sharpest: float) -> Path2D:
    """Draw a path of given length with curvature within ±sharpest, varying over lengths of about one."""
    rng = np.random.default_rng(seed)
    s = np.arange(0, length, 0.02)
    waves = rng.normal(size=(6, 1)) * np.sin(rng.uniform(0.3, 2.0, (6, 1)) * s + rng.uniform(0, 6.3, (6, 1)))
    curvature = sharpest * np.tanh(waves.sum(0) / 2)
    heading = np.cumsum(curvature) * 0.02
    return Path2D.of(np.cumsum(0.02 * np.stack([np.cos(heading), np.sin(heading)], 1), 0), closed=False)


@pytest.mark.parametrize(
    "seed", [*range(12), *(pytest.param(seed, marks=pytest.mark.rest) for seed in range(12, 40))]
)
def test_the_bound_holds_on_random_paths(seed: int) -> None:
    """Predicted track within the guaranteed error, for paths of many lengths and curvatures."""
    rng = np.random.default_rng(1000 + seed)
    car = vehicle(lag=rng.uniform(0, 1))
    path = random_smooth_path(seed, rng.uniform(5, 40), rng.uniform(0.05, 0.9))
    ref = reference(path, car.pivot_distance, 0.01)
    curvature = float(np.abs(ref.curvature).max())
    if curvature * car.pivot_radius > 0.9:
        pytest.skip("this path is tighter than the robot can turn")
    dwell = rng.uniform(0.3, 2.0)
    ahead = look_ahead(car, curvature)
    switches = follow(ref, car, plain_guidance(car, dwell, ahead))
    track = roll_out(car, switches, 0.0, samples=12).track
    error = distance_to(ref.p, track[:-12])
    assert error.max() <= guaranteed(car, car.pivot_distance, car.yaw_rate * dwell, ahead)
    assert switches.dwells.min() >= dwell * (1 - 1e-9)


def test_error_does_not_grow_with_length() -> None:
    car = vehicle()
    worst = []
    for length in (10.0, 80.0):
        ref = reference(Path2D.of([[0, 0], [length, 0]]), car.pivot_distance, 0.01)
        switches = follow(ref, car, plain_guidance(car, 1.0, look_ahead(car, 0.0)))
        worst.append(np.abs(roll_out(car, switches, 0.0).track[:, 1]).max())
    assert worst[1] < 1.2 * worst[0]


@pytest.mark.parametrize("bias", [0.0, 0.2])
def test_the_schedule_predicts_what_the_vehicle_does(bias: float) -> None:
    """Poses found switch by switch in plain numbers, against the chain of pose changes, current included."""
    car = replace(vehicle(bias=bias), current=np.array([0.001, -0.0005]))
    ref = reference(circle(2.0), car.pivot_distance + 0.3, 0.02, Drift(0.0, (0.05, -0.03)))
    switches = follow(ref, car, plain_guidance(car, 0.4, look_ahead(car, 0.3)), 0.3)
    pose = switches.poses[0]
    before = None
    for i, dwell in enumerate(switches.dwells[:40]):
        pose = planar.compose(pose, car.motion(switches.first_direction * (-1) ** i, before, dwell))
        pose = pose + np.append(car.current * dwell, 0.0)
        assert switches.poses[i + 1] == pytest.approx(pose, abs=1e-9)
        before = dwell
    assert roll_out(car, switches).flips == pytest.approx(switches.poses, abs=1e-8)
    assert roll_out(car, switches, 0.0).track[::8] == pytest.approx(switches.poses[:, :2], abs=1e-8)


SIDEWAYS = replace(
    PRESETS["paper-control"], tails=3, tail_length=0.08097, head_radius=0.016, head_length=0.06,
    C_t=3.7343, C_r=1.5529, C_yr=3.7597,
).with_motor(2.2)  # fmt: skip


@pytest.mark.parametrize(
    "path",
    [
        Path2D.of([[0, 0], [0.7, 0.1]]),
        Path2D.of([[0, 0], [3, 0], [3, 2], [0, 2]], closed=True),  # begins at a corner
        circle(1.5),
    ],
    ids=["line", "corner", "circle"],
)
@pytest.mark.parametrize("robot", [SIDEWAYS, PRESETS["paper-control"]], ids=["sideways", "control"])
def test_the_first_dwell_is_no_worse_than_those_after_it(robot: Robot, path: Path2D) -> None:
    """From rest the tails are straight, and the first dwell moves the robot further than the others do."""
    distance = plan(path, robot, dwell=1.5).errors.distance
    first, later = distance[:9].max(), distance[9:-8].max()
    assert first <= 1.12 * later


def test_the_hysteresis_is_half_the_swing_and_grows_with_the_bend() -> None:
    """h = β/2 (1 + R′ |κ|), and β where the robot can only turn: it then swings to one side of the path."""
    car = vehicle()
    for curvature, part in ((0.0, 0.5), (0.5, 0.5 * (1 + 0.5 * car.pivot_radius)), (-9.0, 1.0)):
        ref: Any = SimpleNamespace(curvature=np.array([curvature]))
        assert hysteresis(ref, car, 0.08) == pytest.approx([0.08 * part])


SPIKE = Path2D.of([[0, 0], [3, 0], [3.05, 2], [3.1, 0], [6, 0]])


def star(outer: float, inner: float) -> Path2D:
    angle = np.pi * np.arange(10) / 5 + np.pi / 2
    radius = np.where(np.arange(10) % 2 == 0, outer, inner)[:, None]
    return Path2D.of(radius * np.stack([np.cos(angle), np.sin(angle)], 1), closed=True)


def five_tails(corner: Corner = "nearest") -> Feasibility:
    """A robot whose pivot turns on a small circle far behind the head, as robots with five tails do."""
    car = vehicle(surge=0.0022, sway=0.045)
    return Feasibility(PRESETS["paper-control"], car, car.pivot_distance, STILL, corner)


def refusal(path: Any) -> str:
    with pytest.raises(InputError) as caught:
        plan(path, CONTROL)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def advised(words: str) -> float:
    """Return the number at the end of an advice."""
    return float(words.rsplit(" ", 1)[1].removesuffix("l"))


@pytest.mark.parametrize("noise", [0.02, pytest.param(0.2, marks=pytest.mark.rest)])
def test_the_smoothing_that_a_noisy_path_is_told_works(noise: float) -> None:
    rng = np.random.default_rng(0)
    angle = np.arange(0, 2 * np.pi, 0.005)
    ring = 2 * np.stack([np.cos(angle), np.sin(angle)], 1)
    noisy = Path2D.of(ring + noise * rng.normal(size=ring.shape))
    words = refusal(noisy)
    assert re.search("it looks noisy: .* give --smooth", words)
    smooth, _ = smoothed(noisy, advised(words))
    assert plan(smooth, CONTROL).predicted_rms < 0.1


def test_a_declared_path_far_from_the_drawn_one_says_so_first(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("planner.planning.declare.FAR", 0.02)
    triangle = plan(polygon(3, 4.0), CONTROL, objective="flips")
    assert triangle.warnings[0].startswith("the declared path leaves the drawn one by up to")


def test_small_paths_are_small_and_a_line_and_back_ends_with_a_line() -> None:
    small = refusal(circle(0.2))
    assert small.endswith("scale the path by 3.5")
    assert "noisy" not in small
    refusal([[0, 0], [5, 0], [0, 0]])


def test_many_points_with_little_noise_are_the_same_path() -> None:
    """30,000 points with noise of 1e-4 l: as many flips as the circle without it, within 2 %."""
    rng = np.random.default_rng(0)
    angle = np.linspace(0, 2 * np.pi, 30_000, endpoint=False)
    clean = 1.5 * np.stack([np.cos(angle), np.sin(angle)], 1)
    one, other = (
        plan(Path2D.of(clean + s * rng.normal(size=clean.shape), closed=True), CONTROL, objective="flips")
        for s in (0, 1e-4)
    )
    assert len(other.dwells) == pytest.approx(len(one.dwells), rel=0.02)
    assert other.errors.drawn_rms == pytest.approx(one.errors.drawn_rms, rel=0.05)


@pytest.mark.parametrize(("outer", "inner"), [pytest.param(4.0, 1.8, marks=pytest.mark.rest), (2.0, 0.8)])
def test_a_star_is_followed_by_a_robot_that_turns_on_the_spot(outer: float, inner: float) -> None:
    """The finest poses do not converge to a track that it can follow; coarser ones, with wider turns, do."""
    declared = make_feasible(star(outer, inner), five_tails())
    assert max(declared.off_drawn, declared.missed) < 0.65


TIGHT = {"circle": circle(0.2), "star": star(0.7, 0.25), "spike": SPIKE}


@pytest.mark.parametrize(
    "name", ["star", *(pytest.param(name, marks=pytest.mark.rest) for name in ("circle", "spike"))]
)
def test_the_search_is_bounded_and_says_that_it_goes_on(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    work: list[float] = []
    told: list[Progress] = []

    def counted(raw: Path2D, feasibility: Feasibility, way: float, *rest: Any) -> Any:
        if told and told[-1].stage == REMEDY:
            work.append(cost(raw, feasibility, way))
        return changed(raw, feasibility, way, *rest)

    monkeypatch.setattr("planner.planning.declare.changed", counted)
    with pytest.raises(InputError) as caught:
        make_feasible(TIGHT[name], five_tails(), lambda share: told.append(cast(Progress, share)))
    assert "\n" not in str(caught.value)
    assert 0 < sum(work) <= MOST_WORK
    shares = [share.done for share in told if share.stage == REMEDY]
    assert len(shares) > 4 * len(work)  # several times while one way is tried
    assert shares == sorted(shares)
    assert shares[-1] <= 1
    assert {share.stage for share in told} == {DECLARING, REMEDY}
    assert max(told) == 0  # of the path


QUICK = [("circle", "nearest"), ("circle", "fillet"), ("circle", "error")]


@pytest.mark.parametrize(
    ("name", "corner"),
    [
        pytest.param(name, corner, marks=() if (name, corner) in QUICK else pytest.mark.rest)
        for name in TIGHT
        for corner in ("nearest", "minimax", "fillet", "error")
    ],
)
def test_what_is_advised_is_accepted(name: str, corner: Corner) -> None:
    path, task = TIGHT[name], five_tails(corner)
    try:
        if feasible(path, task) is not None:
            return
    except InputError:  # corners are not allowed
        return
    advice = remedy(path, task)
    if "scale the path by" in advice:
        changed_path = path.scaled(advised(advice))
    elif "--smooth" in advice:
        changed_path, _ = smoothed(path, advised(advice))
    else:
        assert "neither a larger scale nor smoothing" in advice
        return
    assert feasible(changed_path, task) is not None


def test_without_work_the_answer_is_the_best_so_far(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("planner.planning.declare.MOST_WORK", 0.0)
    assert remedy(circle(0.2), five_tails()) == "scale the path by 5"  # followed as drawn
    assert "which moves it by up to" in remedy(SPIKE, five_tails())
    assert remedy(star(0.7, 0.25), five_tails()).startswith("draw it with wider turns")
