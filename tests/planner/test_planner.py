"""Planner: geometry, the bound as a property of random paths, refusals, files, and no simulation."""

from __future__ import annotations

import json
import math
import re
import subprocess
import sys
from pathlib import Path
from typing import Any, get_type_hints

import numpy as np
import pytest

from planner.files.plan_files import milliseconds, write_plan
from planner.files.plan_json import plan_record
from planner.paths.distance import distance_to
from planner.paths.fillets import fillet
from planner.paths.path import Path2D, circle, polygon
from planner.paths.tractrix import reference
from planner.planning.plan import _MOVED, plan
from planner.planning.request import PlanRequest, RequestOptions
from planner.planning.schedule import follow
from planner.planning.stated_error import guaranteed, look_ahead
from planner.vehicle.from_table import table_vehicle
from planner.vehicle.rollout import trace
from planner.vehicle.zigzag import zigzag
from sim.io.errors import InputError, run_command
from sim.mechanics import planar
from sim.model.presets import PRESETS
from sim.model.schedule import load_schedule
from surrogate.table.model_file import load
from tests.planner.vehicles import plain_guidance, vehicle

CONTROL = PRESETS["paper-control"]


def random_smooth_path(seed: int, length: float, sharpest: float) -> Path2D:
    """A path of given length with curvature within ±sharpest, varying over lengths of about one."""
    rng = np.random.default_rng(seed)
    s = np.arange(0, length, 0.02)
    waves = rng.normal(size=(6, 1)) * np.sin(rng.uniform(0.3, 2.0, (6, 1)) * s + rng.uniform(0, 6.3, (6, 1)))
    curvature = sharpest * np.tanh(waves.sum(0) / 2)
    heading = np.cumsum(curvature) * 0.02
    return Path2D.of(np.cumsum(0.02 * np.stack([np.cos(heading), np.sin(heading)], 1), 0), closed=False)


@pytest.mark.parametrize("seed", range(12))
def test_the_pivot_moves_as_a_slip_free_car(seed: int) -> None:
    """q = p − a e(φ) has no sideways velocity on any sequence of arcs."""
    rng = np.random.default_rng(seed)
    car = vehicle(lag=0.0)
    pose = rng.normal(size=3)
    for _ in range(10):
        sense = 1 if rng.random() < 0.5 else -1
        times = np.linspace(0, rng.uniform(0.5, 5), 2001)
        poses = planar.compose(pose, car.motion(sense, 1.0, times))
        q = planar.compose(poses, np.array([-car.pivot_distance, 0.0, 0.0]))
        velocity = np.diff(q[:, :2], axis=0)
        middle = (poses[1:, 2] + poses[:-1, 2]) / 2
        sideways = velocity[:, 1] * np.cos(middle) - velocity[:, 0] * np.sin(middle)
        assert np.abs(sideways).max() < 1e-13
        assert np.linalg.norm(velocity, axis=1).sum() == pytest.approx(car.twist[0, 0] * times[-1], rel=1e-6)
        pose = poses[-1]


@pytest.mark.parametrize("seed", range(40))
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
    track = trace(car, switches, 0.0, samples=12)
    error = distance_to(ref.p, track[:-12])
    assert error.max() <= guaranteed(car, car.pivot_distance, car.yaw_rate * dwell, ahead)
    assert switches.dwells.min() >= dwell * (1 - 1e-9)


def test_error_does_not_grow_with_length() -> None:
    car = vehicle()
    worst = []
    for length in (20.0, 200.0):
        ref = reference(Path2D.of([[0, 0], [length, 0]]), car.pivot_distance, 0.01)
        switches = follow(ref, car, plain_guidance(car, 1.0, look_ahead(car, 0.0)))
        track = trace(car, switches, 0.0)
        worst.append(np.abs(track[:, 1]).max())
    assert worst[1] < 1.2 * worst[0]


def test_tractrix_of_a_circle() -> None:
    """The pivot settles on a circle of radius √(ρ² − a²)."""
    ref = reference(circle(2.0), 0.87, 0.005)
    assert np.linalg.norm(ref.q, axis=1) == pytest.approx(np.full(len(ref.q), math.sqrt(4 - 0.87**2)), rel=1e-3)
    assert ref.curvature[5:-5] == pytest.approx(1 / math.sqrt(4 - 0.87**2), rel=0.05)


def test_tractrix_of_a_kink_decays_exponentially() -> None:
    """Behind a kink of angle α: tan(δ/2) = tan(α/2) exp(−s/a)."""
    path = Path2D.of([[0, 0], [1, 0], [1, 3]])
    ref = reference(path, 0.5, 0.01)
    after = ref.p[:, 1] > 1e-9
    s = ref.p[after, 1]
    expected = math.pi / 2 - 2 * np.arctan(np.exp(-s / 0.5))
    assert ref.heading[after] == pytest.approx(expected, abs=0.01)


def test_fillet_keeps_edges_and_radius() -> None:
    square = polygon(4, 3.0)
    rounded = fillet(square, 0.5)
    assert rounded.length == pytest.approx(12 - 8 * 0.5 + math.pi, rel=1e-3)
    assert distance_to(square.polyline(), rounded.points).max() == pytest.approx(
        0.5 * (1 - math.sqrt(0.5)), rel=1e-2
    )


@pytest.mark.parametrize("name", ["circle", "square", "triangle"])
def test_paper_cases_are_planned_within_their_bound(name: str) -> None:
    path = {"circle": circle(1.5), "square": polygon(4, 3.0), "triangle": polygon(3, 4.0)}[name]
    robot = PRESETS["paper-triangle"] if name == "triangle" else CONTROL
    result = plan(path, robot)
    assert result.predicted_rms < 1.3 * result.straight.rms
    assert result.errors.drawn_rms < {"circle": 0.012, "square": 0.020, "triangle": 0.042}[name]
    assert result.errors.guaranteed is not None
    assert result.predicted_max <= min(result.errors.guaranteed, result.stated_error)
    assert result.errors.closure is not None
    assert result.errors.closure < 0.05
    assert result.dwells.min() >= result.minimum_dwell * (1 - 1e-9)
    again = plan(path, robot)
    assert np.array_equal(again.dwells, result.dwells)


def test_planning_never_calls_the_simulator(monkeypatch: pytest.MonkeyPatch) -> None:
    import sim.motion.orbits
    import sim.motion.run
    import sim.motion.steady
    import sim.motion.switching

    def refuse(*_: object, **__: object) -> None:
        raise AssertionError("the planner simulated")

    for module, name in ((sim.motion.steady, "steady"), (sim.motion.switching, "switch_response"),
                         (sim.motion.orbits, "refined_orbit"), (sim.motion.run, "advance")):  # fmt: skip
        monkeypatch.setattr(module, name, refuse)
    assert len(plan(polygon(4, 3.0), CONTROL).dwells) > 50


def test_planning_does_not_even_load_the_simulator() -> None:
    simulator = ("sim.solve.newton", "sim.motion.steady", "sim.motion.replay", "sim.motion.run", "sim.solve.orbit")
    code = (
        "import sys; from softflagella import plan, circle; from sim.model.presets import PRESETS;"
        "plan(circle(2.0), PRESETS['paper-control']);"
        f"print([m for m in {simulator} if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_old_attributes_of_a_plan_warn_and_work() -> None:
    result = plan(circle(2.0), CONTROL)
    for name, path in _MOVED.items():
        with pytest.warns(DeprecationWarning, match=f"Plan.{name} is now Plan.{re.escape(path)}"):
            value = getattr(result, name)
        new: Any = result
        for part in path.removesuffix("()").split("."):
            new = getattr(new, part)
        assert np.array_equal(value, new()) if path.endswith("()") else value == new or value is new
    with pytest.raises(AttributeError, match="'Plan' object has no attribute 'dwell'"):
        result.dwell  # type: ignore[attr-defined]  # noqa: B018


def test_the_options_of_plan_are_the_fields_of_a_request() -> None:
    assert get_type_hints(RequestOptions) == get_type_hints(PlanRequest)


def test_other_points_of_the_axis() -> None:
    """The tip needs a longer rod, the pivot none; each is planned for itself."""
    for point in ("head_tip", "pivot"):
        result = plan(circle(2.5), CONTROL, point=point)  # type: ignore[arg-type]
        assert result.errors.guaranteed is not None
        assert result.predicted_max <= result.errors.guaranteed
        assert result.tracked.offset != 0


def test_a_tolerance_shortens_the_dwell_and_says_when_it_cannot() -> None:
    free = plan(circle(2.0), CONTROL, objective="flips")
    tight = plan(circle(2.0), CONTROL, objective="flips", tolerance=0.75 * free.stated_error)
    assert tight.minimum_dwell < free.minimum_dwell
    assert tight.stated_error <= 0.75 * free.stated_error
    assert len(tight.dwells) > len(free.dwells)
    with pytest.raises(InputError, match="smallest stated error is"):
        plan(circle(2.0), CONTROL, tolerance=1e-3)


def test_objectives_trade_error_for_time_and_flips() -> None:
    found = {name: plan(circle(2.0), CONTROL, objective=name) for name in ("error", "time", "flips")}  # type: ignore[arg-type]
    assert found["error"].predicted_rms < found["time"].predicted_rms
    assert found["time"].duration < found["error"].duration
    assert len(found["flips"].dwells) <= len(found["time"].dwells) < len(found["error"].dwells)


def test_a_shortest_dwell_in_seconds() -> None:
    result = plan(circle(2.0), CONTROL, minimum_seconds=4.0)
    assert result.seconds[:-1].min() >= 4.0 * (1 - 1e-9)


def refused(path: Any, expected: str, **options: Any) -> None:
    with pytest.raises(InputError, match=expected) as caught:
        plan(path, options.pop("robot", CONTROL), **options)
    assert "\n" not in str(caught.value)


def test_refusals() -> None:
    from dataclasses import replace

    refused([], "empty")
    refused([[0, 0]], "same|two points")
    refused([[0, 0], [0, 0]], "same")
    refused([[0, 0], [float("nan"), 1]], "finite")
    refused([[0, 0, 0], [1, 1, 1]], r"\(n, 2\)")
    refused([["a", "b"]], "no number")
    refused(circle(0.5), "too tight .* scale the path by")
    refused(polygon(4, 0.8), "too tight .* scale the path by")
    refused(polygon(4, 0.1), "too small, the robot's circle has a radius")
    refused([[0, 0], [8e4, 0]], "if you gave m and mean mm")
    refused(polygon(4, 3.0), "corner of 90 degrees", corner="error")
    for weight in (-1.0, float("nan")):
        refused(polygon(4, 3.0), "give a number of l²", time_weight=weight)
    refused(polygon(4, 3.0), "needs corner = nearest or minimax", corner="fillet", time_weight=0.1)
    refused(circle(2.0), "below 0.2 time units", minimum_dwell=0.1)
    refused(circle(2.0), "objective", objective="speed")
    refused(circle(2.0), "outside the look-up table.* omega_bar = 500", robot=CONTROL.with_motor(500.0))
    refused(circle(2.0), "outside the look-up table.* a_over_R = 0.1", robot=replace(CONTROL, disc_offset=0.0016))
    refused(circle(2.0), "tail_sag .*surrogate robot", robot=replace(CONTROL, effects={"tail_sag": 0.1}))


@pytest.mark.parametrize("radius", [0.4, 0.5, 0.57])
def test_a_tight_circle_is_refused_with_a_scale_that_works(radius: float) -> None:
    with pytest.raises(InputError) as caught:
        plan(circle(radius), CONTROL)
    factor = float(str(caught.value).rsplit(" ", 1)[1])
    assert plan(circle(radius * factor), CONTROL).predicted_rms < 0.1


@pytest.mark.parametrize(
    ("name", "text", "expected"),
    [
        ("p.csv", "x,y\n", "no rows"),
        ("p.csv", "a,b\n1,2\n", "give x and y"),
        ("p.csv", "x,y\n1,two\n3,4\n", "no number"),
        ("p.csv", "x,y\n1,1\n1,1\n", "same"),
        ("p.svg", "<svg", "not SVG"),
        ("p.svg", "<svg xmlns='http://www.w3.org/2000/svg'/>", "draw one"),
        ("p.svg", "<svg><path d='M 0 0 L 1 1 M 2 2 L 3 3'/></svg>", "path1/1, path1/2"),
    ],
)
def test_the_command_refuses_and_writes_nothing(
    name: str, text: str, expected: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    from planner.__main__ import main

    (tmp_path / name).write_text(text)
    words = ["plan", str(tmp_path / name), "--robot", "paper-control", "--out", str(tmp_path / "out")]
    assert run_command(main, words) == 2
    error = capsys.readouterr().err
    assert expected in error
    assert len(error.splitlines()) == 1
    assert not (tmp_path / "out").exists()


def test_files_of_a_plan(tmp_path: Path) -> None:
    result = plan(polygon(4, 3.0), CONTROL)
    written = write_plan(result, tmp_path / "out")
    assert [p.name for p in written] == ["plan.json", "plan.csv", "schedule.h", "tracker.h", "plan.svg"]
    content = json.loads(written[0].read_text())
    assert content["stated_error_over_l"] == pytest.approx(result.stated_error)
    assert content["model"] == result.tracked.model
    schedule = load_schedule(written[0])
    assert np.array_equal(schedule.dwells, result.dwells)
    assert schedule.first_direction == result.first_direction
    assert schedule.robot == plan_record(result)["robot"]["groups"]
    header = written[2].read_text()
    numbers = [int(v) for v in header.split("{")[1].split("}")[0].replace("\n", " ").split(",")]
    assert sum(numbers) == pytest.approx(1000 * result.seconds.sum(), abs=1)
    assert f"SCHEDULE_COUNT {len(numbers)}" in header
    assert "<svg" in written[4].read_text()


def test_the_header_compiles(tmp_path: Path) -> None:
    import shutil

    compiler = shutil.which("cc") or shutil.which("gcc")
    if compiler is None:
        pytest.skip("no C compiler on this machine")
    header = write_plan(plan(circle(2.0), CONTROL), tmp_path)[2]
    (tmp_path / "main.c").write_text(
        '#include "schedule.h"\n#include <stdio.h>\nint main(void){long s=0;'
        "for(int i=0;i<SCHEDULE_COUNT;i++)s+=schedule_ms[i];"
        'printf("%ld %ld %f %f %ld",s,(long)SCHEDULE_TOTAL_MS,SCHEDULE_START_X,SCHEDULE_START_HEADING,'
        "(long)schedule_checkpoints[SCHEDULE_CHECKPOINTS-1].ms);return 0;}"
    )
    subprocess.run([compiler, "-Wall", "-Werror", "-o", str(tmp_path / "a"), str(tmp_path / "main.c")], check=True)
    words = subprocess.run([str(tmp_path / "a")], capture_output=True, text=True, check=True).stdout.split()
    total = int(words[0])
    content = json.loads((header.parent / "plan.json").read_text())
    seconds = content["dwell_s"]
    assert int(words[1]) == int(words[4]) == total
    start = [content["start"]["x_over_l"], content["start"]["heading_rad"]]
    assert [float(words[2]), float(words[3])] == pytest.approx(start, abs=1e-6)
    assert total == pytest.approx(1000 * sum(seconds), abs=1)


def test_milliseconds_carry_rounding_and_split_long_dwells() -> None:
    assert sum(milliseconds(np.full(1000, 0.0104))) == 10400
    assert milliseconds(np.array([1.0, 140.0])) == [1000, 65535, 0, 65535, 0, 8930]
    with pytest.raises(InputError, match="longer minimum dwell"):
        milliseconds(np.array([1.0, 0.0001]))


def test_vehicle_of_the_shipped_table_matches_the_reference_robot() -> None:
    """ω̄_yr, v_x, v_z of the control example from an independent solver."""
    car = table_vehicle(CONTROL, load())
    assert car.twist[0] == pytest.approx([0.0180, 0.0425, 0.0490], rel=0.02)
    assert zigzag(car, 2.0).net_speed == pytest.approx(0.0169, rel=0.02)
