"""What users do with the page, in a browser: each journey ends with what they see or take along."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from planner.files.plan_files import write_plan
from planner.page.write_page import write_page
from planner.paths.path import circle
from planner.planning.plan import plan
from planner.planning.request import PlanRequest
from sim.io.errors import run_command
from sim.model.presets import PRESETS
from softflagella.__main__ import main
from surrogate.one_robot.tabulate import tabulate
from tests.planner.page.view.browser import drag, drop, opened_page, planned, saved, text_of

ROBOT = PRESETS["paper-control"]


def address_of(page: Any) -> str:
    return str(page.evaluate("location.hash"))


def test_the_page_opens_with_a_plan_and_a_saved_link_opens_with_the_same(browser: Any, address: str) -> None:
    with opened_page(browser, address) as page:
        assert "dwells: if the coefficients are exact, 95 of 100 such robots stay within" in planned(page)
        page.select_option("#shape", "square")
        page.fill("#size", "31.5")
        page.select_option("#objective", "time")
        words = planned(page)
        link = address + address_of(page)
        assert "path=square%3A31.5" in link
        facts = text_of(page, "#facts")
    with opened_page(browser, link) as page:
        assert planned(page) == words
        assert text_of(page, "#facts") == facts
    with opened_page(browser, f"{address}#v=1&rubbish=1") as page:
        assert "dwells" in planned(page)
        assert "The link cannot be read" in text_of(page, "#path-problem")


def draw_ring(page: Any, radius: float = 110.0) -> None:
    """Draw a circle with the mouse."""
    box = page.locator("#view").bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    angles = np.linspace(0.0, 2 * np.pi, 90)
    page.mouse.move(x + radius, y)
    page.mouse.down()
    for angle in angles:
        page.mouse.move(x + radius * np.cos(angle), y + radius * np.sin(angle))
    page.mouse.up()


def test_a_circle_drawn_with_the_mouse_is_planned_and_its_files_are_those_of_the_command(
    browser: Any, address: str, tmp_path: Path
) -> None:
    with opened_page(browser, address) as page:
        planned(page)
        page.check("input[value=draw]")
        draw_ring(page)
        assert "dwells" in planned(page)
        assert "points=" in address_of(page)
        assert "closed=1" in address_of(page)
        names = ("plan.json", "plan.csv", "schedule.h", "tracker.h", "path.csv", "robot.toml", "plan.svg")
        files = {name: saved(page, name, tmp_path) for name in names}
    words = ["plan", str(files["path.csv"]), "--robot", str(files["robot.toml"]), "--out", str(tmp_path / "out")]
    assert run_command(main, words) == 0
    theirs = {name: (tmp_path / "out" / name).read_text() for name in names[:4]}
    check_plans(json.loads(files["plan.json"].read_text()), json.loads(theirs["plan.json"]))
    assert files["plan.csv"].read_text().split(",p")[0] == theirs["plan.csv"].split(",p")[0]
    check_headers(files["tracker.h"].read_text(), theirs["tracker.h"])
    assert "<svg" in files["plan.svg"].read_text()


def check_plans(ours: dict[str, Any], theirs: dict[str, Any]) -> None:
    """Assert that two plan.json agree, up to rounding."""
    assert list(ours) == list(theirs)
    assert len(ours["dwell_bar"]) == len(theirs["dwell_bar"])
    for name in ("dwell_bar", "predicted_poses", "reference", "stated_error_over_l", "feedback_error_over_l",
                 "predicted_rms_over_l"):  # fmt: skip
        assert np.abs(np.array(ours[name]) - np.array(theirs[name])).max() < 1e-9, name


def check_headers(ours: str, theirs: str) -> None:
    """Assert that two headers agree up to rounding, below the line with the plan's identity."""
    number = re.compile(r"-?\b\d+(?:\.\d+)?(?:e[-+]\d+)?")
    first, second = (text.split("\n", 1)[1] for text in (ours, theirs))
    assert number.sub("0", first) == number.sub("0", second)
    numbers = (np.array([float(word) for word in number.findall(text)]) for text in (first, second))
    np.testing.assert_allclose(*numbers, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize(("shape", "anew"), [("circle", False), ("eight", False), ("square", True)])
def test_corners_begin_a_new_path(browser: Any, address: str, shape: str, anew: bool) -> None:
    """A path of many points has no corners to add to, and one of few can be left."""
    with opened_page(browser, address) as page:
        planned(page)
        page.select_option("#shape", shape)
        planned(page)
        page.click("#new" if anew else "[value=corners]")
        box = page.locator("#view").bounding_box()
        x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
        for right, down in ((-250, 100), (0, 60), (250, -60)):
            page.mouse.click(x + right, y + down)
        assert "dwells" in planned(page)
        assert not page.is_visible("#path-problem")
        assert page.locator("#corner-table tbody tr").count() == 3
        page.keyboard.press("Control+z")
        page.keyboard.press("Control+z")
        planned(page)
        assert page.input_value("#shape") == shape


def test_a_finger_draws_on_a_phone(browser: Any, address: str) -> None:
    phone = {"viewport": {"width": 390, "height": 844}, "has_touch": True, "is_mobile": True}
    with opened_page(browser, address, **phone) as page:
        planned(page)
        assert page.evaluate("document.documentElement.scrollWidth") <= 390
        page.check("input[value=draw]")
        page.locator("#view").scroll_into_view_if_needed()
        session = page.context.new_cdp_session(page)
        box = page.locator("#view").bounding_box()
        x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
        for k, angle in enumerate(np.linspace(0.0, 2 * np.pi, 40)):
            point = {"x": x + 90 * float(np.cos(angle)), "y": y + 90 * float(np.sin(angle))}
            session.send("Input.dispatchTouchEvent", {"type": "touchStart" if k == 0 else "touchMove",
                                                      "touchPoints": [point]})  # fmt: skip
        session.send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})
        assert "dwells" in planned(page)
        assert "points=" in address_of(page)


def test_a_square_is_typed_with_the_keyboard_alone(browser: Any, address: str) -> None:
    with opened_page(browser, address) as page:
        planned(page)
        for _ in range(12):
            page.keyboard.press("Tab")
            if page.evaluate("document.activeElement.id") == "shape":
                break
        page.keyboard.type("square")
        page.keyboard.press("Tab")
        assert page.evaluate("document.activeElement.id") == "size"
        page.keyboard.press("Control+a")
        page.keyboard.type("28")
        assert "dwells" in planned(page)
        assert "path=square%3A28" in address_of(page)


def test_each_field_changes_the_plan_by_number_and_by_slider(browser: Any, address: str) -> None:
    with opened_page(browser, address) as page:
        planned(page)
        page.evaluate("document.querySelectorAll('details').forEach((part) => { part.open = true; })")
        before = text_of(page, "#motion")
        fields = page.locator("#robot-fields input[type=number]")
        assert fields.count() == 12
        for k in range(fields.count()):
            field, slider = fields.nth(k), page.locator("#robot-fields input[type=range]").nth(k)
            name = field.get_attribute("aria-label")
            if name == "Number of tails N":
                field.fill("3")
            elif field.input_value() != "":
                field.fill(f"{1.02 * float(field.input_value()):.6g}")
            planned(page)
            assert text_of(page, "#motion") != before or "Disc" in name, name
            before = text_of(page, "#motion")
            slider.focus()
            page.keyboard.press("ArrowLeft" if name != "Number of tails N" else "ArrowRight")
            planned(page)
            if text_of(page, "#robot-problem") == "":
                assert text_of(page, "#motion") != before, name
            before = text_of(page, "#motion")
        page.fill("input[aria-label='Viscosity in Pa s']", "-1")
        planned(page)
        assert "viscosity = -1; it must be above 0" in text_of(page, "#robot-problem")


def test_twenty_changes_are_undone_and_done_again(browser: Any, address: str) -> None:
    with opened_page(browser, address) as page:
        planned(page)
        first, addresses = address_of(page), []
        for k in range(20):
            page.select_option("#shape", ["square", "circle"][k % 2])
            page.fill("#size", str(20 + k))
            page.keyboard.press("Tab")
            addresses.append(address_of(page))
        for _ in range(60):
            page.keyboard.press("Control+z")
        planned(page)
        assert address_of(page) == first
        assert page.is_disabled("#undo")
        for _ in range(60):
            page.keyboard.press("Control+Shift+z")
        planned(page)
        assert address_of(page) == addresses[-1]


def test_the_robot_plays_pauses_and_goes_to_a_time(browser: Any, address: str) -> None:
    with opened_page(browser, address) as page:
        planned(page)
        assert page.get_attribute("#play", "aria-pressed") == "false"  # less motion is wanted
        clock = text_of(page, "#clock")
        page.click("#play")
        page.wait_for_timeout(400)
        page.click("#play")
        assert text_of(page, "#clock") != clock
        page.locator("#time").focus()
        page.keyboard.press("End")
        at, total = re.findall(r"\d+:\d+\.\d", text_of(page, "#clock"))
        assert at == total
    with opened_page(browser, address, reduced_motion="no-preference") as page:
        planned(page)
        assert page.get_attribute("#play", "aria-pressed") == "true"


def test_a_drawing_without_a_unit_is_asked_for_one_and_a_robot_is_opened(
    browser: Any, address: str, tmp_path: Path
) -> None:
    (tmp_path / "path.csv").write_text("x;y\n0;0\n300;0\n300;200,5\n")
    (tmp_path / "drawing.svg").write_text(
        '<svg xmlns="http://www.w3.org/2000/svg" width="40cm" height="40cm" viewBox="0 0 400 400">'
        '<path d="M 20 20 h 300 v 250 h -300 z"/></svg>'
    )
    assert run_command(main, ["sim", "robot", "paper-triangle", "--out", str(tmp_path / "robot.toml")]) == 0
    with opened_page(browser, address) as page:
        planned(page)
        drop(page, tmp_path / "path.csv")
        page.locator("#unit-dialog").wait_for()
        assert "30.0 × 20.1 cm" in text_of(page, "#unit-choices")
        page.get_by_label("mm: 30.0 × 20.1 cm").check()
        page.get_by_role("button", name="Take this path").click()
        assert "dwells" in planned(page)
        drop(page, tmp_path / "drawing.svg")
        assert "dwells" in planned(page)
        assert "closed=1" in address_of(page)
        assert "name=drawing" in address_of(page)
        drop(page, tmp_path / "robot.toml")
        assert "dwells" in planned(page)
        assert page.input_value("input[aria-label='Number of tails N']") == "4"


def test_a_replay_is_shown_over_its_plan_with_the_error_of_the_command(
    browser: Any, address: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    result = plan(circle(1.5).scaled(1.0), ROBOT, objective="flips")
    write_plan(result, tmp_path)
    words = ["replay", str(tmp_path / "plan.json"), "--out", str(tmp_path / "track.csv"), "--no-error"]
    assert run_command(main, words) == 0
    with opened_page(browser, address) as page:
        planned(page)
        page.select_option("#shape", "circle")
        page.fill("#size", "16.5")
        page.select_option("#objective", "flips")
        planned(page)
        drop(page, tmp_path / "track.csv")
        page.locator("#measured dl").wait_for()
        seen = text_of(page, "#measured")
    assert "the track is within it" in seen
    capsys.readouterr()
    assert run_command(main, ["planner", "check", str(tmp_path / "plan.json"), str(tmp_path / "track.csv")]) == 0
    rms = float(re.search(r"tracking error ([\d.]+) (mm|cm)", capsys.readouterr().out).group(1))  # type: ignore[union-attr]
    ours = float(re.search(r"([\d.]+) cm rms", seen).group(1))  # type: ignore[union-attr]
    assert ours * 10 == pytest.approx(rms, rel=0.02)


def test_files_and_folders_are_dragged_onto_the_picture(browser: Any, address: str, tmp_path: Path) -> None:
    one, other = tmp_path / "one.csv", tmp_path / "other.csv"
    one.write_text("x_cm,y_cm\n0,0\n40,0\n40,30\n")
    other.write_text("x_cm,y_cm\n0,0\n50,0\n")
    with opened_page(browser, address) as page:
        planned(page)
        before = address_of(page)
        drag(page, one, other)
        page.locator("#path-problem", has_text="Give one").wait_for()
        assert text_of(page, "#path-problem") == "Give one file at a time."
        drag(page, tmp_path)
        page.locator("#path-problem", has_text="cannot be read; give a file").wait_for()
        assert address_of(page) == before
        drag(page, one)
        page.locator("#path-problem").wait_for(state="hidden")
        assert "dwells" in planned(page)
        assert "points=" in address_of(page)


def test_an_opened_path_is_smoothed(browser: Any, address: str, tmp_path: Path) -> None:
    """What the refusal of a noisy path advises can be done in the page."""
    x = np.linspace(0, 60, 240)
    noise = 0.5 * np.random.default_rng(0).normal(size=(2, 240))
    rows = "".join(f"{a:.3f},{b:.3f}\n" for a, b in np.stack([x, 8 * np.sin(x / 10)], 1) + noise.T)
    (tmp_path / "camera.csv").write_text("x_cm,y_cm\n" + rows)
    with opened_page(browser, address) as page:
        planned(page)
        drop(page, tmp_path / "camera.csv")
        page.locator("#path-problem", has_text="it looks noisy").wait_for()
        planned(page)
        refusal = text_of(page, "#path-problem")
        advised = re.search(r'set "Smooth over" to ([\d.]+) cm', refusal)
        assert advised, refusal
        page.evaluate("document.querySelectorAll('details').forEach((part) => { part.open = true; })")
        page.fill("#smooth", advised[1])
        page.get_by_role("button", name="Smooth this path").click()
        page.locator("#path-problem").wait_for(state="hidden")
        assert "dwells: if the coefficients are exact, 95 of 100" in planned(page)


def test_the_page_prints_on_paper(browser: Any, address: str, tmp_path: Path) -> None:
    with opened_page(browser, address) as page:
        planned(page)
        page.emulate_media(media="print")
        assert page.is_visible("#view")
        assert page.is_visible("#facts")
        assert not page.is_visible("#controls")
        assert len(page.pdf()) > 10_000


def test_a_robot_with_an_effect_is_planned_for_as_the_command_does(browser: Any, tmp_path: Path) -> None:
    robot = replace(ROBOT, effects={"left_right_bias": 0.1})
    table = tabulate(robot)
    path = write_page(tmp_path / "page.html", robot, table, PlanRequest())
    with opened_page(browser, path.as_uri()) as page:
        planned(page)
        page.select_option("#shape", "circle")
        page.fill("#size", "22")
        planned(page)
        assert "left_right_bias" in text_of(page, "#locked")
        assert not page.is_visible("#robot-fields")
        ours = json.loads(saved(page, "plan.json", tmp_path).read_text())
    cm = 100 * robot.tail_length
    theirs = plan(circle(22.0).scaled(0.01 / (cm / 100)), robot, lookup=table).to_dict()
    del ours["code_version"]
    check_plans(ours, theirs)
