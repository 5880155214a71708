"""The page's look-up table, vehicles and whole plans are Python's, for robots, paths, options and files."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import pytest

from common.errors import InputError
from planner.goal.trip import to_goal
from planner.jobs.plan import make_plan, plan
from planner.options import read_regions
from planner.page.first_state import first_plan
from planner.page.write_page import packed_data, table_data
from planner.paths.obstacles import Circle, FreeSpace, Polygon
from planner.paths.path import Path2D, circle, polygon
from planner.paths.path_files import read_path
from planner.paths.units import read_pose
from planner.planning.conditions import BlockedError
from planner.planning.plan import Plan
from planner.planning.request import PlanRequest
from planner.vehicle.from_table import table_vehicle
from planner.vehicle.measured import MeasuredVehicle
from planner.vehicle.tracked_point import tracked_vehicle
from sim.inputs import load_robot
from sim.model.response import BEFORE
from sim.model.robot import Robot
from sim.model.robot_toml import robot_toml
from tests.oracles.unseen_robots import lab_path, lab_robot
from tests.planner.page.cases import (
    CONTROL,
    MEASURED,
    MEASURED_VEHICLES,
    PATHS,
    TRIANGLE,
    VEHICLES,
    columns_of,
    random_groups,
    shipped,
    tracked_of,
)
from tests.planner.page.page_core import (
    EXACT,
    TABLE,
    answer,
    answers,
    call,
    check_alike,
    check_near,
    opened,
    page_options,
    refusal_of,
    typed,
    without_digits,
)
from tests.planner.plans import CORNER, planned

pytestmark = pytest.mark.usefixtures("empty_folder")

ALIKE = 1e-8  # of the largest number of a column; balances are solved to 2e-12, and plans amplify this
SQUARE, BEND = PATHS["square"], PATHS["bend"]
SHORT = {"objective": "flips"}


class ParityCase(NamedTuple):
    """A path, who follows it and how: a robot, a measured vehicle, or one of VEHICLES with its point's offset."""

    path: Path2D
    robot: Robot | MeasuredVehicle | tuple[str, float] = CONTROL
    options: dict[str, Any] = SHORT


FILES: dict[str, str] = {
    "table.csv": "x_mm;y_mm\n0;0\n400,5;0\n400,5;300\n0;300\n",
    "camera.csv": "# of the camera\nframe, X [cm], Y [cm]\n1, 0, 0\n2, 20, 5\n3, 42, 5\n4, 60, 30\n",
    "drawing.svg": '<svg xmlns="http://www.w3.org/2000/svg" width="60cm" height="40cm" viewBox="0 0 600 400">'
    '<g transform="translate(20 10) rotate(5)"><path d="M 20 20 C 200 20 300 200 500 150 S 300 350 100 300 z"/>'
    "</g></svg>",
    "robot.toml": robot_toml(CONTROL).replace("length_cm = 11", "length_in = 4.2").replace("= 1.49", "= 1.6"),
    "plan.json": "",
}  # fmt: skip


def text_of(name: str) -> str:
    return FILES[name] or json.dumps(planned(CORNER, objective="flips").to_dict())


def opened_case(name: str) -> ParityCase:
    """Open a file in Python and in the page, which must read the same, and plan what it has."""
    text = text_of(name)
    with open(name, "w", encoding="utf-8") as file:
        file.write(text)
    found = opened(name, text)
    if name == "robot.toml":
        robot = load_robot(name)
        assert found["fields"]["tailLength"] == pytest.approx(robot.tail_length, rel=1e-15)
        assert found["fields"]["timeScale"] == pytest.approx(robot.time_scale, rel=1e-14)
        return ParityCase(circle(2.0), robot)
    (drawn,) = found["paths"]
    page = Path2D(np.array(drawn["points"]), drawn["closed"]).scaled(found["unit"] / 11)
    if name == "plan.json":
        wanted = planned(CORNER, objective="flips").drawn
    else:
        drawing = read_path(name)
        assert drawing.unit is not None
        wanted = drawing.path.scaled(drawing.unit / CONTROL.tail_length)
    assert page.closed == wanted.closed
    np.testing.assert_allclose(page.points, wanted.points, atol=1e-12)
    return ParityCase(page)


def random_case(seed: int) -> ParityCase:
    """Draw a path and a robot as labs have them."""
    rng = np.random.default_rng(seed)
    options = {"objective": ("error", "time", "flips")[seed % 3], "corner": ("nearest", "minimax")[seed % 2]}
    return ParityCase(lab_path(rng)[1], lab_robot(rng), options)


CASES: dict[str, Callable[[], ParityCase]] = {
    "circle": lambda: ParityCase(circle(2.0), CONTROL, {}),
    "triangle, tip": lambda: ParityCase(polygon(3, 4.0), TRIANGLE,
                                  {"objective": "flips", "time_weight": 0.03, "point": "head_tip"}),
    "hexagon, rounded": lambda: ParityCase(polygon(6, 4.0), CONTROL, {**SHORT, "seed": 5, "corner": "fillet"}),
    "biased": lambda: ParityCase(SQUARE, ("biased", 0.27), {"objective": "time"}),
    "in a current": lambda: ParityCase(polygon(6, 4.0), ("in a current", 0.1), {**SHORT, "corner": "fillet"}),
    "minimax": lambda: ParityCase(SQUARE, ("symmetric", 0.0),
                            {"objective": "flips", "tolerance": 0.1, "corner": "minimax"}),
    "measured, exact": lambda: ParityCase(SQUARE, MEASURED_VEHICLES["exact"], {"objective": "time"}),
    "measured, slipping": lambda: ParityCase(circle(2.0), MEASURED_VEHICLES["slipping"], {}),
    "measured, front": lambda: ParityCase(BEND, MEASURED_VEHICLES["with a body"], {"point": "head_tip"}),
    "bend, pivot": lambda: ParityCase(BEND, CONTROL, {**SHORT, "point": "pivot"}),
    "rounded, pivot": lambda: ParityCase(SQUARE, CONTROL, {**SHORT, "point": "pivot", "corner": "fillet"}),
    "own circle": lambda: ParityCase(circle(0.95), CONTROL, SHORT),
    "smaller than the rod": lambda: ParityCase(circle(0.94), lab_robot(np.random.default_rng(56005)), SHORT),
    "drawing.svg": lambda: opened_case("drawing.svg"),
    "table.csv": lambda: opened_case("table.csv"),
    "robot.toml": lambda: opened_case("robot.toml"),
    "plan.json": lambda: opened_case("plan.json"),
    **{f"random {seed}": lambda seed=seed: random_case(seed) for seed in (3, 11, 12, 26, 32, 53)},
    "long memory": lambda: ParityCase(BEND, ("with a long memory", -0.3), {"minimum_seconds": 2.0}),
    "without lags": lambda: ParityCase(PATHS["wave"], ("without lags", 0.0), {"dwell": 1.3}),
    "camera.csv": lambda: opened_case("camera.csv"),
    "circle, pivot": lambda: ParityCase(circle(1.5), MEASURED, {"objective": "flips", "point": "pivot"}),
    "circle, tip, time": lambda: ParityCase(circle(3.0), TRIANGLE, {"objective": "time", "point": "head_tip"}),
    "square": lambda: ParityCase(SQUARE, CONTROL, {}),
    "square, time": lambda: ParityCase(SQUARE, MEASURED, {"objective": "time"}),
    "eight": lambda: ParityCase(PATHS["eight"], CONTROL, SHORT),
    "wave": lambda: ParityCase(PATHS["wave"], MEASURED, SHORT),
    "stroke": lambda: ParityCase(PATHS["stroke"], CONTROL, SHORT),
    "bend, minimax": lambda: ParityCase(BEND, CONTROL, {"objective": "flips", "corner": "minimax"}),
    "line": lambda: ParityCase(PATHS["line"], TRIANGLE, {"objective": "time"}),
    "star": lambda: ParityCase(PATHS["star"], MEASURED, {"objective": "flips", "time_weight": 0.05}),
    "long dwells": lambda: ParityCase(PATHS["eight"].scaled(2), TRIANGLE, {"minimum_seconds": 3.0}),
}  # fmt: skip
QUICK = 17  # cases of `make test`; the others run with the rates
CASE_MARKS = [pytest.param(name, marks=[] if i < QUICK else pytest.mark.rates) for i, name in enumerate(CASES)]
ERRORS = {"stated": "stated", "guaranteed": "guaranteed", "predicted_rms": "predictedRms",
          "predicted_max": "predictedMax", "drawn_rms": "drawnRms", "drawn_max": "drawnMax"}  # fmt: skip


def numbers(result: Plan) -> dict[str, Any]:
    """Return the numbers of Python's plan."""
    errors = [getattr(result.errors, name) for name in ERRORS]
    return {"dwells": result.dwells, "poses": result.switches.poses, "reference": result.declared.reference.p,
            "heading": result.declared.reference.heading, "errors": [*errors, result.feedback_error],
            "guidance": [*result.guidance],
            "off": [result.declared.off_drawn, result.declared.missed]}  # fmt: skip


def numbers_of_page(found: dict[str, Any]) -> dict[str, Any]:
    switches, declared, errors = found["switches"], found["declared"], found["errors"]
    return {"dwells": switches["dwells"], "poses": switches["poses"], "reference": declared["reference"]["p"],
            "heading": declared["reference"]["heading"],
            "errors": [*(errors[name] for name in ERRORS.values()), errors["feedback"]],
            "guidance": [found["guidance"][name] for name in ("dwell", "ahead", "swing")],
            "off": [declared["offDrawn"], declared["missed"]]}  # fmt: skip


def difference(found: dict[str, Any], wanted: dict[str, Any]) -> float:
    """Return the largest difference of two plans, as a share of the largest number of each column."""
    worst = 0.0
    for name, part in wanted.items():
        one, other = (np.asarray(values, dtype=float) for values in (found[name], part))
        assert one.shape == other.shape, name
        size = np.maximum(np.abs(other).max(0), 1e-6) if other.ndim > 1 else max(np.abs(other).max(), 1e-6)
        worst = max(worst, float((np.abs(one - other) / size).max()))
    return worst


def page_vehicle(robot: Robot | MeasuredVehicle, point: str = "head_centre") -> dict[str, Any]:
    """Return what stands for the page's vehicle with its tracked point."""
    if isinstance(robot, MeasuredVehicle):
        return call("measured_vehicle.js", "trackedMeasured", robot, point)
    return call("from_table.js", "trackedVehicle", robot, TABLE, point)


def plan_call(case: ParityCase) -> tuple[Any, ...]:
    path, robot, options = case
    if isinstance(robot, tuple):
        swims = tracked_of(VEHICLES[robot[0]], robot[1])
    else:
        swims = page_vehicle(robot, options.get("point", "head_centre"))
    return "plan.js", "makePlan", path, swims, call("plan.js", "planRequest", page_options(options))


def python_plan(case: ParityCase) -> Plan:
    path, robot, options = case
    if isinstance(robot, tuple):
        return make_plan(path, tracked_of(VEHICLES[robot[0]], robot[1]), PlanRequest(**options))
    return plan(path, robot, lookup=shipped() if isinstance(robot, Robot) else None, **options)


@pytest.mark.parametrize("name", CASE_MARKS)
def test_plans(name: str) -> None:
    case = CASES[name]()
    (found,) = answers([plan_call(case)], left_out=["vehicle"])
    assert difference(numbers_of_page(found), numbers(python_plan(case))) <= ALIKE


def test_the_plan_that_python_writes_along_has_the_names_and_numbers_of_the_page() -> None:
    case = CASES["triangle, tip"]()
    result = python_plan(case)
    first = first_plan(result.drawn, result.tracked, result.request)
    shown = answer("worker.js", "pictured", call(*plan_call(case)))
    assert first is not None
    shown["motion"], shown["samples"] = shown["motion"][:: shown["samples"]], 1  # one pose for each dwell
    rounded = {"reference": 5e-4, "motion": 5e-4, "dwells": 5e-5}
    assert first.keys() == shown.keys()
    assert first.pop("warnings") == shown.pop("warnings")
    for name, value in first.items():
        check_near(value, shown[name], rounded.get(name, 0.0) + EXACT)


REFUSED: list[tuple[Path2D, dict[str, Any]]] = [
    (circle(0.1), {}), (circle(4000.0), {}), (polygon(3, 0.8), {}), (SQUARE, {"corner": "error"}),
    (SQUARE, {"corner": "it's round"}), (SQUARE, {"objective": "fun"}), (SQUARE, {"tolerance": -1.0}),
    (SQUARE, {"tolerance": 0.001, "objective": "flips"}), (SQUARE, {"time_weight": -1.0}),
    (SQUARE, {"time_weight": 0.1, "corner": "fillet"}), (SQUARE, {"minimum_seconds": -2.0}),
    (SQUARE, {"dwell": 0.1}),
]  # fmt: skip


@pytest.mark.parametrize(("path", "options"), REFUSED)
def test_refusals(path: Path2D, options: dict[str, Any]) -> None:
    """The page speaks of its options where one is wrong, in the words of the command."""
    case = ParityCase(path, ("symmetric", 0.0), options)
    (found,) = answers([plan_call(case)], left_out=["vehicle"])
    assert isinstance(found, InputError)
    assert without_digits(found) == without_digits(refusal_of(python_plan, case))


def random_regions(seed: int) -> tuple[list[str], str]:
    """Draw regions beside and on a square of 33 cm, and walls, in the words of the page [cm]."""
    rng = np.random.default_rng(seed)
    words = []
    for kind in rng.permutation(["circle", "box", "polygon"])[: 1 + seed % 3]:
        x, y = rng.uniform(-10, 43, 2)
        size = rng.uniform(1, 6)
        if kind == "circle":
            words.append(f"circle:{x:.2f},{y:.2f},{size:.2f}")
        elif kind == "box":
            words.append(f"box:{x:.2f},{y:.2f},{x + size:.2f},{y + 2 * size:.2f}")
        else:
            angles = np.sort(rng.uniform(0, 2 * np.pi, 5))
            corners = np.stack([x + size * np.cos(angles), y + 2 * size * np.sin(angles)], 1)
            words.append("polygon:" + ",".join(f"{number:.2f}" for number in corners.ravel()))
    return words, "box:-40,-40,73,73" if seed % 2 else ""


def region(words: str) -> Circle | Polygon:
    """Read a region as the command does; it has corners from a file."""
    shape, _, numbers = words.partition(":")
    if shape == "polygon":
        return Polygon.of(np.reshape([float(number) for number in numbers.split(",")], (-1, 2)) / 11)
    (read,) = read_regions(words, "cm", CONTROL)
    return read


REGIONS = [pytest.param(seed, marks=[] if seed < 6 else pytest.mark.rates) for seed in range(40)]


@pytest.mark.parametrize("seed", REGIONS)
def test_a_plan_beside_regions_is_that_of_the_command_and_a_blocked_path_is_refused(seed: int) -> None:
    words, walls = random_regions(seed)
    case = ParityCase(SQUARE, ("biased", 0.27), {"objective": ("error", "time", "flips")[seed % 3]})
    file, name, *given, request = plan_call(case)
    read = answer("obstacles.js", "readSpace", {"keepOut": " ".join(words), "walls": walls}, 11.0)
    options = {**request["call"][2][0], "space": read}
    space = FreeSpace(tuple(map(region, words)), region(walls) if walls else None)  # type: ignore[arg-type]
    try:
        wanted = python_plan(case._replace(options={**case.options, "space": space}))
    except BlockedError:
        wanted = None
    found = answer(file, name, *given, call("plan.js", "planRequest", options))
    if wanted is None or wanted.kept_clear.detours:  # type: ignore[union-attr]
        assert re.match(r"the path is blocked at \(.*; the page finds no way around", str(found))
        return
    assert difference(numbers_of_page(found), numbers(wanted)) <= ALIKE
    record = answer("obstacles.js", "keptClearRecord", found["clear"])
    kept = wanted.kept_clear.to_dict()  # type: ignore[union-attr]
    assert list(record) == list(kept)
    for key in ("margin_over_l", "predicted_clearance_over_l"):
        assert record[key] == pytest.approx(kept[key], abs=1e-8)
    for one, other in zip(record["keep_out"], kept["keep_out"], strict=True):
        check_near(*(next(iter(each.values())) for each in (one, other)))


Pose = tuple[float, float, float]
GOALS = [pytest.param(seed, marks=[] if seed < 5 else pytest.mark.rates) for seed in range(40)]


def page_space(regions: Sequence[Circle | Polygon], walls: Polygon | None) -> dict[str, Any]:
    """Return regions and walls as the page has them."""
    return {
        "keepOut": [vars(each) for each in regions],
        "walls": None if walls is None else {"corners": walls.corners},
    }


def goal_call(start: Pose, goal: Pose, robot: Robot | MeasuredVehicle | str, **options: Any) -> tuple[Any, ...]:
    request = call("plan.js", "planRequest", {"start": start, "goal": goal, "objective": "time", **options})
    swims = tracked_of(VEHICLES[robot]) if isinstance(robot, str) else page_vehicle(robot)
    return "plan.js", "makePlan", None, swims, request


@pytest.mark.parametrize("seed", GOALS)
def test_a_way_to_a_goal_among_ten_regions_is_that_of_the_command(seed: int) -> None:
    rng = np.random.default_rng(seed)
    regions: list[Circle | Polygon] = []
    for x, y, size in rng.uniform([1.5, -3, 0.2], [7.5, 3, 0.6], (10, 3)):
        angles = 2 * np.pi * (np.arange(count := rng.integers(3, 7)) + rng.uniform(-0.3, 0.3, count)) / count
        corners = np.stack([x + size * np.cos(angles), y + size * np.sin(angles)], 1)
        regions.append(Circle(x, y, size) if rng.random() < 0.5 else Polygon.of(corners))
    walls = Polygon.of([[-3, -6], [12, -6], [12, 6], [-3, 6]]) if seed % 2 else None
    start, goal = (0.0, *rng.uniform([-2, -3], [2, 3]).tolist()), (9.0, *rng.uniform([-2, -3], [2, 3]).tolist())
    options = {} if seed % 3 else {"objective": "error"}
    found = answers(
        [goal_call(start, goal, CONTROL, space=page_space(regions, walls), **options)], left_out=["vehicle"]
    )[0]
    try:
        wanted = to_goal(start, goal, CONTROL, keep_out=regions, walls=walls, lookup=shipped(), **options)  # type: ignore[arg-type]
    except InputError as no_way:
        refusal = str(no_way)
    if isinstance(found, InputError):
        assert str(found) == refusal
        return
    assert difference(numbers_of_page(found), numbers(wanted)) <= ALIKE
    assert found["length"] == pytest.approx(wanted.job.length, abs=1e-8)
    record = answer("obstacles.js", "keptClearRecord", found["clear"])
    assert wanted.kept_clear is not None
    for key in ("margin_over_l", "predicted_clearance_over_l"):
        assert record[key] == pytest.approx(wanted.kept_clear.to_dict()[key], abs=1e-8)


@pytest.mark.parametrize("robot", VEHICLES)
def test_a_goal_without_regions_is_reached_as_by_the_command(robot: str) -> None:
    start, goal = (0.3, -0.2, 0.4), (3.0, 1.0, -2.0)
    (found,) = answers([goal_call(start, goal, robot)], left_out=["vehicle"])
    wanted = to_goal(start, goal, tracked_of(VEHICLES[robot]))
    assert difference(numbers_of_page(found), numbers(wanted)) <= ALIKE


def test_a_measured_vehicle_leads_its_body_around_a_region_as_by_the_command() -> None:
    car = replace(MEASURED_VEHICLES["with a body"], turn_left=(0.7, 0.005), turn_right=0.6, slip=0.1, lag=0.05)
    regions = (Circle(3.0, 0.0, 0.4), Polygon.of([[3, 2], [4, 2], [4, 3]]))
    start, goal = (0.0, 0.0, 0.0), (6.0, 0.5, 0.3)
    (found,) = answers([goal_call(start, goal, car, space=page_space(regions, None))], left_out=["vehicle"])
    wanted = to_goal(start, goal, car, keep_out=regions)
    assert difference(numbers_of_page(found), numbers(wanted)) <= ALIKE
    assert found["clear"]["clearance"] == pytest.approx(wanted.kept_clear.clearance, abs=1e-8)  # type: ignore[union-attr]


@pytest.mark.parametrize("name", MEASURED_VEHICLES)
def test_what_moves_a_measured_vehicle_and_what_is_uncertain_of_it(name: str) -> None:
    car = MEASURED_VEHICLES[name]
    found, wanted = answer("measured_vehicle.js", "trackedMeasured", car, "pivot"), car.motion()
    assert found["offset"] == pytest.approx(-wanted.pivot_distance)
    moves = found["vehicle"]
    for part in ("twist", "lag", "rest", "spread"):
        check_near(np.reshape(moves[part], np.shape(getattr(wanted, part))), getattr(wanted, part))
    assert [mode["name"] for mode in moves["modes"]] == [mode.name for mode in wanted.modes]
    for mode, other in zip(moves["modes"], wanted.modes, strict=True):
        check_near(mode["twist"], other.twist)
        check_near(np.reshape(mode["lag"], wanted.lag.shape), other.lag)


ROOM = Polygon.of([[-1, -2], [4.5, -2], [4.5, 2], [-1, 2]])
GATE = (
    Polygon.of([[1.5, -2], [2, -2], [2, -0.1], [1.5, -0.1]]),
    Polygon.of([[1.5, 0.1], [2, 0.1], [2, 2], [1.5, 2]]),
)


@pytest.mark.parametrize(
    ("goal", "regions", "walls", "options"),
    [
        ((0.0, 0.0, 0.0), (), None, {}),
        ((3.0, 0.0, 0.0), (Circle(3.2, 0, 0.5),), None, {}),
        ((3.0, 0.0, 0.0), GATE, ROOM, {}),
        ((0.5, 0.0, 0.0), (), None, {"tolerance": 0.001}),
        ((3.0, 0.0, 0.0), (), None, {"minimum_seconds": -2.0}),
    ],
    ids=["same", "goal", "closed", "tolerance", "seconds"],
)
def test_a_goal_that_cannot_be_reached_is_refused_as_by_the_command(
    goal: Pose, regions: tuple[Circle | Polygon, ...], walls: Polygon | None, options: dict[str, Any]
) -> None:
    space = {"space": page_space(regions, walls)} if regions else {}
    (found,) = answers([goal_call((0.0, 0.0, 0.0), goal, CONTROL, **space, **page_options(options))], ["vehicle"])
    refusal = refusal_of(
        to_goal, (0, 0, 0), goal, CONTROL, keep_out=regions, walls=walls, lookup=shipped(), **options
    )
    assert str(found) == refusal


def test_angles_are_unwrapped_as_numpy_does() -> None:
    """A whole turn is no step, and half a turn keeps its sign."""
    angles = np.array([0.1, 0.1 + np.pi, 0.1, 0.1 - np.pi, 0.2, 3.0, 3.0 - 2 * np.pi, -np.pi, np.pi])
    check_near(answer("math.js", "unwrap", typed(angles)), np.unwrap(angles))


@pytest.mark.parametrize("words", ["60,20", "60,20,x", "60,,90", "1,2,3,4", "here"])
def test_words_that_are_no_pose_are_refused(words: str) -> None:
    found = answer("goal.js", "readPose", words, "goal", 11.0)
    assert str(found) == f"goal '{words}'; write X,Y,DEGREES with numbers in cm, such as 60,20,90"


@pytest.mark.parametrize("degrees", [0, 90, 180, -180, 190, -350, 400])
def test_a_pose_is_read_as_by_the_command(degrees: int) -> None:
    found = answer("goal.js", "readPose", f"66,-5.5,{degrees}", "goal", 11.0)
    check_near(found, read_pose(["66", "-5.5", str(degrees)], "cm", CONTROL, "--goal"))


SHAPELESS = {
    "bow": "0,0,9,9,9,0,0,9", "line": "0,0,5,5,9,9", "touches": "0,0,9,0,9,9,4,0,0,9",
    "two notches on one line": "",
}  # fmt: skip


@pytest.mark.parametrize("name", SHAPELESS)
def test_outlines_that_cross_or_touch_themselves_are_refused(name: str) -> None:
    words = f"polygon:{SHAPELESS[name] or '0,0,9,0,9,5,7,5,7,2,5,2,5,5,3,5,3,2,1,2,1,5,0,5'}"
    found = answer("obstacles.js", "readSpace", {"keepOut": words, "walls": ""}, 11.0)
    if not SHAPELESS[name]:
        check_near(found["keepOut"][0]["corners"], region(words).corners)  # type: ignore[union-attr]
        return
    refusal_of(region, words)
    assert str(found).startswith(f"region '{words}'")


@pytest.mark.parametrize("words", ["circle:1,2", "circle:1,2,-3", "box:1,2,3,x", "cube:1,2,3", "polygon:1,2", "5"])
def test_words_that_are_no_region_are_refused(words: str) -> None:
    found = answer("obstacles.js", "readSpace", {"keepOut": words, "walls": ""}, 11.0)
    assert str(found).startswith(f"region '{words}'; write circle:X,Y,RADIUS, box:LEFT,LOW,RIGHT,HIGH or polygon:")


SOLVED = 1e-9  # relative; balances are solved until a correction is 2e-12, on different ways
MOST_LETTERS = 1_350_000
Group = dict[str, Any]


def asked(name: str, robots: list[Group]) -> list[Any]:
    return answers([("table.js", name, TABLE, robot) for robot in robots])


def outside(robots: list[Group]) -> list[bool]:
    return shipped().query(columns_of(robots), flag=True)["outside"].tolist()


def known(count: int) -> list[Group]:
    robots = random_groups(60)
    return [robot for robot, out in zip(robots, outside(robots), strict=True) if not out][:count]


@pytest.mark.parametrize("tails", [None, 1.0])
def test_steady_outputs_and_who_is_outside(tails: float | None) -> None:
    robots = [robot | ({"N": tails} if tails else {}) for robot in random_groups(15 if tails else 100)]
    found, wanted = asked("query", robots), shipped().query(columns_of(robots), flag=True)
    assert [isinstance(one, InputError) for one in found] == wanted.pop("outside").tolist()
    rows = [row for row, one in enumerate(found) if not isinstance(one, InputError)]
    assert len(rows) > 3
    for name, values in wanted.items():
        given = np.array([found[row][name] for row in rows], dtype=float)
        np.testing.assert_allclose(given, values[rows], rtol=SOLVED)


def test_curves_of_the_response_and_modes_of_the_error() -> None:
    robots = known(6)
    wanted = shipped().response(columns_of(robots))
    for row, one in enumerate(asked("response", robots)):
        for name, curve in one.items():
            check_alike(curve, getattr(wanted, name)[row].reshape(-1, 3), SOLVED)
    for robot, modes in zip(robots, asked("tableErrorModes", robots), strict=True):
        errors = shipped().error_modes({name: np.array([value]) for name, value in robot.items()})
        check_alike([mode["twist"] for mode in modes], errors.twist, SOLVED)
        for name in ("lag", "memory"):
            expected = getattr(errors, name)
            curves = np.reshape([mode[name] or np.zeros(expected[0].size) for mode in modes], expected.shape)
            check_alike(curves, expected, SOLVED)


def test_numbers_come_back_exactly_from_a_text_that_means_nothing_in_html() -> None:
    for count in (0, 1, 2, 3, 5, 1000):
        rng = np.random.default_rng(count)
        numbers = rng.normal(size=(count, 2)) * 10.0 ** rng.integers(-300, 300, size=(count, 2))
        found = answer("data.js", "readData", packed_data({"a": [numbers, "text", None, 2.5]}))
        assert found["a"] == [{"shape": [count, 2], "values": numbers.ravel().tolist()}, "text", None, 2.5]
    text = json.dumps(table_data(shipped()))
    assert len(text) <= MOST_LETTERS
    assert not set("<>&`'\\") & set(text)


OUTSIDE = [
    replace(CONTROL, tails=1), replace(CONTROL, disc_offset=0.0016, name="it's"), replace(CONTROL, C_r=0.02),
    replace(CONTROL, tails=12, C_r=0.02), replace(CONTROL, C_t=0.01, C_yr=10.0, motor_speed=9 * np.pi / 30),
    replace(CONTROL, viscosity=40.0), replace(CONTROL, tail_length=0.5),
]  # fmt: skip


@pytest.mark.parametrize("robot", OUTSIDE)
def test_robots_outside_are_refused_in_lab_units(robot: Any) -> None:
    """The command tells which values of the number it knows, the page the range that was learned."""
    found = str(answer("from_table.js", "trackedVehicle", robot, TABLE, "head_centre"))
    wanted = refusal_of(table_vehicle, robot, shipped())
    head = [without_digits(words).split(", learned")[0].split(";")[0] for words in (found, wanted)]
    assert head[0] == head[1]
    assert "\n" not in found


@pytest.mark.parametrize(
    ("twist", "words"),
    [
        ([[-1.0, 1, 1], [0.5, -1, -1]], "robot 'x' does not move forward (v_z = -0.25); turn its motor"),
        ([[1.0, 1, 1], [1, 1, 1]], "robot 'x' turns to the same side in both directions of its motor; it"),
    ],
    ids=["backward", "one side"],
)
def test_vehicles_that_cannot_follow_a_path_are_refused(twist: list[list[float]], words: str) -> None:
    zeros = {"lag": np.zeros(75), "memory": np.zeros(1200), "rest": np.zeros(75), "spread": np.zeros(75)}
    parts = {"twist": twist, "curves": [zeros, zeros], "before": BEFORE, "errors": [], "modes": []}
    assert str(answer("from_table.js", "vehicleOfParts", parts, "x")).startswith(words)


def test_tracked_points() -> None:
    basis = {"vehicle": VEHICLES["biased"], "unmeasured": [], "calibrated": False, "ownTable": True}
    found = answer("vehicle.js", "trackedPoint", CONTROL, basis, "nose", "x")
    assert str(found) == refusal_of(tracked_vehicle, CONTROL, shipped(), "nose", None)
    tip = answer("vehicle.js", "trackedPoint", CONTROL, basis, "head_tip", "x")
    check_near(tip["offset"], CONTROL.head_length / 2 / CONTROL.tail_length)
