"""What users do with the page, in a browser: each journey ends with what they see or take along."""

from __future__ import annotations

import json
import math
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from common.errors import run_command
from planner.goal.trip import to_goal
from planner.jobs.plan import plan
from planner.page.write_page import write_page
from planner.paths.obstacles import Circle
from planner.paths.path import circle
from planner.planning.plan import Plan
from planner.vehicle.vehicle import roll_out
from sim.inputs import load_robot
from sim.model.presets import PRESETS
from sim.model.robot_toml import robot_toml
from softflagella.__main__ import main
from tests.planner.page.cases import MEASURED_VEHICLES, TRIANGLE, shipped, table_of_runs
from tests.planner.page.page_core import check_header
from tests.planner.page.view.browser import (
    FIRST_SCREEN,
    address_of,
    drag,
    drop,
    is_seen,
    middle_of,
    opened_page,
    planned,
    saved,
    text_of,
    unfold,
)
from tests.planner.plans import BIASED, CONTROL, own_table
from tests.planner.plans import planned as planned_by_python
from tracking.tracks import tracking_error

pytestmark = pytest.mark.slow

FIELDS = "#robot-fields input"

# keeps what the page shows when it first says that it is planning, that is before any answer of its planner
KEEP_FIRST = """
    new MutationObserver((_, observer) => {
        window.first = ["message", "facts", "warnings"].map((part) => document.getElementById(part).innerText);
        observer.disconnect();
    }).observe(document, { subtree: true, attributeFilter: ["data-busy"] });
"""


def check_plans(ours: dict[str, Any], theirs: dict[str, Any]) -> None:
    """Assert that two plan.json agree, up to rounding."""
    assert list(ours) == list(theirs)
    assert len(ours["dwell_bar"]) == len(theirs["dwell_bar"])
    for name in ("dwell_bar", "predicted_poses", "reference", "stated_error_over_l", "feedback_error_over_l",
                 "predicted_rms_over_l"):  # fmt: skip
        assert np.abs(np.array(ours[name]) - np.array(theirs[name])).max() < 1e-9, name


def test_the_page_opens_with_a_plan_and_a_saved_link_opens_with_the_same(browser: Any, address: str) -> None:
    with opened_page(browser, address, script=KEEP_FIRST) as page:
        assert "dwells: if the coefficients are exact, 95 of 100 such robots stay within" in planned(page)
        assert page.evaluate("first") == [text_of(page, part) for part in ("#message", "#facts", "#warnings")]
        assert page.get_attribute("#play", "aria-pressed") == "false"  # less motion is wanted
        for part in (*FIRST_SCREEN, "#shape"):
            box = page.locator(part).bounding_box()
            assert box["y"] + box["height"] <= 860, part  # all that the first plan needs is on the first screen
        page.check("#tails")
        assert " l)" in text_of(page, "#facts")
        page.uncheck("#tails")
        page.select_option("#shape", "square")
        page.fill("#size", "31.5")
        page.select_option("#objective", "time")
        words, facts = planned(page), text_of(page, "#facts")
        link = address + address_of(page)
        assert "path=square%3A31.5" in link
    with opened_page(browser, link, reduced_motion="no-preference") as page:
        assert planned(page) == words
        assert text_of(page, "#facts") == facts
        assert page.get_attribute("#play", "aria-pressed") == "true"


def test_a_circle_drawn_with_the_mouse_is_planned_and_its_files_are_those_of_the_command(
    page: Any, tmp_path: Path
) -> None:
    page.get_by_role("button", name="Draw your own path").click()
    x, y = middle_of(page)
    page.mouse.move(x + 110, y)
    page.mouse.down()
    for angle in np.linspace(0.0, 2 * np.pi, 90):
        page.mouse.move(x + 110 * np.cos(angle), y + 110 * np.sin(angle))
    page.mouse.up()
    assert "dwells" in planned(page)
    assert "points=" in address_of(page)
    assert "closed=1" in address_of(page)
    assert "SCHEDULE_H" in saved(page, "Save the schedule", tmp_path).read_text()
    names = ("plan.json", "plan.csv", "schedule.h", "path.csv", "robot.toml", "plan.svg")
    files = {name: saved(page, name, tmp_path) for name in names}
    words = ["plan", str(files["path.csv"]), "--robot", str(files["robot.toml"]), "--objective", "flips"]
    assert run_command(main, [*words, "--out", str(tmp_path / "out")]) == 0
    theirs = {name: (tmp_path / "out" / name).read_text() for name in names[:3]}
    check_plans(json.loads(files["plan.json"].read_text()), json.loads(theirs["plan.json"]))
    assert files["plan.csv"].read_text().split(",p")[0] == theirs["plan.csv"].split(",p")[0]
    ours = files["schedule.h"].read_text().split("\n", 1)  # below the line with the plan's identity
    check_header(ours[1], theirs["schedule.h"].split("\n", 1)[1], 1e-9)
    assert "<svg" in files["plan.svg"].read_text()


@pytest.mark.parametrize(("shape", "anew"), [("eight", False), ("square", True)])
def test_corners_begin_a_new_path(page: Any, shape: str, anew: bool) -> None:
    """A path of many points has no corners to add to, which is said, and one of few can be left."""
    page.select_option("#shape", shape)
    planned(page)
    page.click("#new" if anew else "[value=corners]")
    assert ("too many to be moved" in text_of(page, "#mode-words")) == (not anew)
    x, y = middle_of(page)
    for right, down in ((-250, 100), (0, 60), (250, -60)):
        page.mouse.click(x + right, y + down)
    assert "dwells" in planned(page)
    assert not page.is_visible("#path-problem")
    assert page.locator("#corner-table tbody tr").count() == 3
    page.keyboard.press("Control+z")
    page.keyboard.press("Control+z")
    planned(page)
    assert page.input_value("#shape") == shape


def test_each_field_changes_the_robot_by_number_and_by_slider(page: Any) -> None:
    unfold(page)
    before, fields = text_of(page, "#motion"), page.locator(f"{FIELDS}[type=number]")
    assert fields.count() == 12
    for k in range(fields.count()):
        name, value = fields.nth(k).get_attribute("aria-label"), fields.nth(k).input_value()
        if k % 2 and value != "":
            fields.nth(k).fill(f"{1.02 * float(value):.6g}")
        else:
            page.locator(f"{FIELDS}[type=range]").nth(k).focus()
            page.keyboard.press("ArrowLeft" if name != "Number of tails N" else "ArrowRight")
        planned(page)
        assert text_of(page, "#motion") != before or "Disc" in name, name
        before = text_of(page, "#motion")
    slider = page.get_by_label("Viscosity in Pa s, slider")
    slider.evaluate(  # moved on and on, it leaves the address of its end
        """(input) => {
          for (let i = 0; i < 300; i++) {
            input.value = 1 + i / 1000;
            input.dispatchEvent(new Event("input", { bubbles: true }));
          }
          input.dispatchEvent(new Event("change", { bubbles: true }));
        }"""
    )
    assert "viscosity=1.3" in address_of(page)
    assert "dwells" in planned(page)


def test_changes_are_undone_and_done_again(page: Any) -> None:
    first, addresses = address_of(page), []
    for k in range(6):
        page.select_option("#shape", ["square", "circle"][k % 2])
        page.fill("#size", str(20 + k))
        page.keyboard.press("Tab")
        addresses.append(address_of(page))
    for _ in range(30):
        if address_of(page) == first:
            break
        page.keyboard.press("Control+z")
    assert address_of(page) == first
    for _ in range(30):
        page.keyboard.press("Control+Shift+z")
    planned(page)
    assert address_of(page) == addresses[-1]
    assert page.is_disabled("#redo")


def test_the_robot_plays_pauses_and_goes_to_a_time(page: Any) -> None:
    clock = text_of(page, "#clock")
    page.click("#play")
    page.wait_for_timeout(300)
    page.click("#play")
    assert text_of(page, "#clock") != clock
    page.locator("#time").focus()
    page.keyboard.press("End")
    at, total = re.findall(r"\d+:\d+\.\d", text_of(page, "#clock"))
    assert at == total
    page.emulate_media(media="print")
    assert [page.is_visible(part) for part in ("#view", "#facts", "#controls")] == [True, True, False]
    assert len(page.pdf()) > 10_000
    page.emulate_media(media="screen")


def test_a_drawing_without_a_unit_is_asked_for_one_and_a_robot_is_opened(page: Any, tmp_path: Path) -> None:
    (tmp_path / "path.csv").write_text("x;y\n0;0\n300;0\n300;200,5\n")
    (tmp_path / "drawing.svg").write_text(
        '<svg xmlns="http://www.w3.org/2000/svg" width="40cm" height="40cm" viewBox="0 0 400 400">'
        "<script>document.title = 'taken'</script>"
        '<path d="M 20 20 h 300 v 250 h -300 z" onload="document.title = \'taken\'"/></svg>'
    )
    (tmp_path / "robot.toml").write_text(robot_toml(TRIANGLE))
    drop(page, tmp_path / "path.csv")
    page.locator("#unit-dialog").wait_for()
    assert "30.0 × 20.1 cm" in text_of(page, "#unit-choices")
    page.get_by_label("mm: 30.0 × 20.1 cm").check()
    page.get_by_role("button", name="Take this path").click()
    assert "dwells" in planned(page)
    inputs = page.locator("#corner-table input").evaluate_all("all => all.map((input) => Number(input.value))")
    assert inputs == [0, 0, 30, 0, 30, 20.05]
    drop(page, tmp_path / "drawing.svg")
    assert "dwells" in planned(page)
    assert "closed=1" in address_of(page)
    assert "name=drawing" in address_of(page)
    drop(page, tmp_path / "robot.toml")
    assert "dwells" in planned(page)
    assert page.input_value("input[aria-label='Number of tails N']") == str(TRIANGLE.tails)


def test_of_several_paths_the_sizes_are_those_of_the_chosen_one(page: Any, tmp_path: Path) -> None:
    drawing = tmp_path / "two.svg"
    drawing.write_text(
        '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 600 400"><path id="bend" d="M0 0L500 0L500 300"/>'
        '<path id="slope" d="M0 0L400 200"/></svg>'
    )
    drop(page, drawing)
    page.locator("#unit-dialog").wait_for()
    assert page.locator(":focus").evaluate("focused => focused.checked")
    assert page.get_by_label("cm: 500 × 300 cm", exact=True).is_checked()
    page.get_by_label("mm: 50.0 × 30.0 cm").check()
    page.get_by_label("slope").check()
    assert page.get_by_label("mm: 40.0 × 20.0 cm").is_checked()
    page.get_by_role("button", name="Take this path").click()
    assert "dwells" in planned(page)
    assert "name=slope" in address_of(page)
    drop(page, drawing)
    page.locator("#unit-dialog").wait_for()
    page.keyboard.press("Escape")
    assert "dwells" in planned(page)
    assert "name=slope" in address_of(page)


def test_a_track_is_shown_over_its_plan_with_its_error(page: Any, tmp_path: Path) -> None:
    result: Plan = planned_by_python("circle:2l", objective="flips")
    starts, share = np.cumsum([0.0, *result.dwells[:-1]]), np.arange(8) / 8
    time = (starts[:, None] + result.dwells[:, None] * share).ravel() * result.robot.time_scale
    poses = roll_out(result.tracked.vehicle, result.switches).poses[:-1]
    track = pd.DataFrame(
        np.column_stack([time, poses * [11, 11, 1]]), columns=["time_s", "x_cm", "y_cm", "heading_rad"]
    )
    track.to_csv(tmp_path / "track.csv", index=False)
    page.select_option("#shape", "circle")
    page.fill("#size", "22")
    planned(page)
    drop(page, tmp_path / "track.csv")
    page.locator("#measured dl").wait_for()
    seen = text_of(page, "#measured")
    assert "the track is within it" in seen
    rms = float(re.search(r"([\d.]+) cm rms", seen).group(1))  # type: ignore[union-attr]
    assert rms == pytest.approx(11 * tracking_error(result.to_dict(), track).rms, rel=0.02)
    (tmp_path / "other.csv").write_text("time_s,x_cm,y_cm,heading_deg\n0,500,0,90\n10,600,1,90\n")
    drop(page, tmp_path / "other.csv")
    page.locator("#measured", has_text="the track is above it").wait_for()
    size = page.viewport_size
    page.set_viewport_size({"width": 390, "height": 844})
    page.wait_for_function("document.querySelector('#strip').lastChild.getBoundingClientRect().right < 390")
    page.wait_for_function(  # it is drawn anew, as wide as the window is now
        """() => {
            const words = [...document.querySelectorAll('#measured svg text')];
            return words.length && words.every((each) => each.getBoundingClientRect().right < 390);
        }"""
    )
    page.set_viewport_size(size)


def test_a_track_of_another_plan_is_refused_until_its_plan_is_open(page: Any, tmp_path: Path) -> None:
    result: Plan = planned_by_python("circle:2l", objective="flips")
    (tmp_path / "plan.json").write_text(json.dumps(result.to_dict()))
    rows = result.to_frame()[["start_s", "x_cm", "y_cm", "heading_deg"]].rename(columns={"start_s": "time_s"})
    rows.assign(plan_id=result.identity).to_csv(tmp_path / "track.csv", index=False)
    drop(page, tmp_path / "track.csv")
    refusal = page.locator(
        "#measured-problem", has_text=f"track.csv: the track is of plan {result.identity}, not of p"
    )
    refusal.wait_for()
    assert text_of(page, "#measured-problem").endswith("; open its own plan.json first")
    assert text_of(page, "#measured") == ""
    drop(page, tmp_path / "plan.json")
    planned(page)
    drop(page, tmp_path / "track.csv")
    page.locator("#measured", has_text=f"{result.identity}, with whose plan.json, which is open").wait_for()
    assert "the track is within it" in text_of(page, "#measured")


def test_a_region_is_drawn_and_a_path_that_it_blocks_is_refused(page: Any, tmp_path: Path) -> None:
    page.evaluate("location.hash = 'v=1&objective=flips&path=circle%3A22&walls=box%3A-50%2C-50%2C50%2C50'")
    planned(page)
    page.check("input[value=keepOut]")
    x, y = middle_of(page)
    for right, down in ((-30, -30), (30, -30), (0, 40), (-30, -30)):
        page.mouse.click(x + right, y + down)
    page.locator("#scene .region").wait_for(state="attached")
    planned(page)
    kept_clear = r"a margin of [\d.]+ cm covers the error.*; as predicted it passes at a distance of [\d.]+ cm"
    assert re.search(kept_clear, text_of(page, "#facts"))
    ours = json.loads(saved(page, "plan.json", tmp_path).read_text())
    space = {"walls": ours["kept_clear"]["walls"], "keep_out": [ours["kept_clear"]["keep_out"][0]["polygon"]]}
    drawn = circle(22.0).scaled(0.01 / 0.11)
    theirs = plan(drawn, CONTROL, lookup=shipped(), objective="flips", **space).to_dict()
    del ours["code_version"]
    check_plans(ours, theirs)
    for name in ("margin_over_l", "predicted_clearance_over_l"):
        assert ours["kept_clear"][name] == pytest.approx(theirs["kept_clear"][name], abs=1e-8)
    unfold(page)
    page.fill("#keepOut", "circle:22,0,3")
    page.locator("#keepOut").blur()
    page.locator("#path-problem", has_text="the path is blocked at").wait_for()
    page.click("#undo")
    page.locator("#path-problem").wait_for(state="hidden")
    assert "dwells" in planned(page)
    assert "polygon:" in page.input_value("#keepOut")


def test_a_goal_is_set_dragged_typed_and_removed(page: Any, tmp_path: Path) -> None:
    """A click sets it with a heading away from the start; its arrow turns it; the plan is that of the command."""
    page.evaluate("location.hash = 'v=1&objective=time&path=circle%3A22&keepOut=circle%3A33%2C3%2C9'")
    planned(page)
    page.check("input[value=goal]")
    x, y = middle_of(page)
    page.mouse.click(x + 90, y + 40)
    page.locator("#facts", has_text="Goal").wait_for()
    planned(page)
    unfold(page)
    right, up, degrees = map(float, page.input_value("#goal").split(","))
    assert degrees == pytest.approx(math.degrees(math.atan2(up, right)), abs=1)
    page.fill("#goal", "66,0,0")
    page.locator("#goal").blur()
    assert "dwells" in planned(page)
    assert re.search(r"way of [\d.]+ cm; predicted end below", text_of(page, "#facts"))
    ours = json.loads(saved(page, "plan.json", tmp_path).read_text())
    theirs = to_goal(
        (0, 0, 0), (66 / 11, 0, 0), CONTROL, lookup=shipped(), keep_out=[Circle(33 / 11, 3 / 11, 9 / 11)]
    )
    del ours["code_version"]
    check_plans(ours, theirs.to_dict())
    handles = page.locator("#view .handle")
    page.locator("#view").scroll_into_view_if_needed()
    (place, tip) = (handles.nth(k).bounding_box() for k in (2, 3))
    page.mouse.move(tip["x"] + 6, tip["y"] + 6)
    page.mouse.down()
    page.mouse.move(place["x"] + 6, place["y"] - 60, steps=3)
    page.mouse.up()
    planned(page)
    assert page.input_value("#goal") == "66,0,90"
    page.fill("#goal", "33,3")
    page.locator("#goal").blur()
    page.locator("#regions-problem", has_text="write X,Y,DEGREES").wait_for()
    page.fill("#goal", "33,3,0")
    page.locator("#goal").blur()
    page.locator("#path-problem", has_text="there is no way: at the goal").wait_for()
    page.fill("#goal", "")
    page.fill("#keepOut", "")
    page.locator("#keepOut").blur()
    planned(page)
    assert "Drawn points" in text_of(page, "#facts")


def test_files_and_folders_are_dragged_onto_the_picture(page: Any, tmp_path: Path) -> None:
    one, other = tmp_path / "one.csv", tmp_path / "other.csv"
    one.write_text("x_cm,y_cm\n0,0\n40,0\n40,30\n")
    other.write_text("x_cm,y_cm\n0,0\n50,0\n")
    before = address_of(page)
    drag(page, one, other)
    page.locator("#path-problem", has_text="Give one file at a time.").wait_for()
    drag(page, tmp_path)
    page.locator("#path-problem", has_text="cannot be read; give a file").wait_for()
    assert address_of(page) == before
    drag(page, one)
    page.locator("#path-problem").wait_for(state="hidden")
    assert "dwells" in planned(page)
    assert "points=" in address_of(page)


def test_an_opened_path_is_smoothed(page: Any, tmp_path: Path) -> None:
    """What the refusal of a noisy path advises can be done in the page."""
    x = np.linspace(0, 60, 240)
    noise = 0.5 * np.random.default_rng(0).normal(size=(2, 240))
    rows = "".join(f"{a:.3f},{b:.3f}\n" for a, b in np.stack([x, 8 * np.sin(x / 10)], 1) + noise.T)
    (tmp_path / "camera.csv").write_text("x_cm,y_cm\n" + rows)
    drop(page, tmp_path / "camera.csv")
    page.locator("#path-problem", has_text="it looks noisy").wait_for()
    planned(page)
    refusal = text_of(page, "#path-problem")
    advised = re.search(r'set "Smooth over" to ([\d.]+) cm', refusal)
    assert advised, refusal
    unfold(page)
    page.fill("#smooth", advised[1])
    page.locator("#smooth").blur()
    assert page.locator("body").get_attribute("data-busy") == "0"  # nothing is planned anew, so the button stays
    page.get_by_role("button", name="Smooth this path").click()
    page.locator("#path-problem").wait_for(state="hidden")
    assert "dwells: if the coefficients are exact, 95 of 100" in planned(page)


def test_runs_are_compared_and_the_command_is_copied(page: Any, tmp_path: Path) -> None:
    runs = table_of_runs()
    runs.loc[4, "theta_deg"] = -3.0
    runs[runs["N"] == 3].to_csv(tmp_path / "my table.csv", index=False)
    runs.rename(columns={"theta_deg": "thetta_deg"}).to_csv(tmp_path / "misspelt.csv", index=False)
    page.context.grant_permissions(["clipboard-read", "clipboard-write"])
    page.select_option("#robot-name", "paper-measured")
    page.evaluate("scrollTo(0, 0)")
    drop(page, tmp_path / "my table.csv")
    page.locator("#runs table").wait_for()
    planned(page)
    assert is_seen(page, "#runs")
    assert page.locator("#runs tbody tr").count() == 23
    table = page.locator("#runs .wide")  # is wider than its place, and has a bar that shows it
    assert table.evaluate("part => part.scrollWidth > part.clientWidth")
    assert table.evaluate("part => getComputedStyle(part, '::-webkit-scrollbar').height") == "12px"
    seen = text_of(page, "#runs")
    assert "answers for 23 of 23 usable runs" in seen
    assert "row 5 (line 6): theta_deg = -3.0 is not above 0" in seen
    assert "all have N = 3" in seen
    assert "elapsed_min: tests a drift of the viscosity" in seen
    command = "softflagella calibrate 'my table.csv' --robot robot.toml --out calibrated"
    assert text_of(page, "#runs pre") == command
    page.get_by_role("button", name="Copy the command").click()
    page.locator("#runs [role=status]", has_text="Copied.").wait_for()
    assert page.evaluate("navigator.clipboard.readText()") == command
    with page.expect_download() as download:
        page.locator("#runs").get_by_role("button", name="Save robot.toml").click()
    download.value.save_as(tmp_path / "robot.toml")
    assert load_robot(tmp_path / "robot.toml") == replace(PRESETS["paper-measured"], name="paper-measured")
    summary = text_of(page, "#runs .soft")
    page.fill("input[aria-label='Viscosity in Pa s']", "1.5")
    planned(page)
    assert text_of(page, "#runs .soft") != summary  # the table's answers are for the robot of the page
    page.get_by_role("button", name="Remove the runs").click()
    assert text_of(page, "#runs") == ""
    drop(page, tmp_path / "misspelt.csv")
    page.locator("#runs-problem", has_text="unknown column 'thetta_deg': is it 'theta_deg'?").wait_for()


@pytest.mark.parametrize("why", ["one error for all", pytest.param("left_right_bias", marks=pytest.mark.rest)])
def test_a_locked_robot_is_planned_for_as_by_the_command(browser: Any, tmp_path: Path, why: str) -> None:
    one_error = replace(shipped(), curve_errors=None)
    robot, table = (CONTROL, one_error) if "one error" in why else (BIASED, own_table())
    path = write_page(tmp_path / "page.html", robot, lookup=table)
    table_of_runs().to_csv(tmp_path / "table.csv", index=False)
    with opened_page(browser, f"{path.as_uri()}#v=1&objective=flips&path=circle%3A22") as page:
        planned(page)
        assert why in text_of(page, "#locked")
        assert not page.is_visible("#robot-fields")
        ours = json.loads(saved(page, "plan.json", tmp_path).read_text())
        drop(page, tmp_path / "table.csv")
        refusal = "runs can only be compared with the trained look-up table"
        page.locator("#runs-problem", has_text=refusal).wait_for()
    theirs = plan(circle(22.0).scaled(0.01 / 0.11), robot, lookup=table, objective="flips").to_dict()
    del ours["code_version"]
    check_plans(ours, theirs)


def test_a_measured_vehicle_is_shown_with_its_numbers_and_planned_for_as_by_the_command(
    browser: Any, tmp_path: Path
) -> None:
    car = MEASURED_VEHICLES["with a body"]
    path = write_page(tmp_path / "page.html", car, objective="flips", paths=["circle:80cm"])
    (tmp_path / "robot.toml").write_text(robot_toml(CONTROL))
    table_of_runs().to_csv(tmp_path / "table.csv", index=False)
    with opened_page(browser, path.as_uri()) as page:
        assert "dwells: 95 of 100" in planned(page)
        assert (text_of(page, "#robot-title"), text_of(page, ".legend li:nth-child(3)")) == ("Vehicle", "left")
        for words in ("it's a car", "25 ± 0.5 cm/s", "40.107 ± 1.15 degrees/s", "0.05 ± 0.1 s", "30 × 18 cm"):
            assert words in text_of(page, "#motion")
        for part in ("#robot-fields", "#or-runs", "#problem", "#robot-problem"):
            assert not page.is_visible(part)
        names = ("plan.json", "plan.csv", "schedule.h", "path.csv", "vehicle.toml")
        files = {name: saved(page, name, tmp_path) for name in names}
        drop(page, tmp_path / "robot.toml")
        page.locator(
            "#robot-problem", has_text="this page plans for it's a car alone; make a page of robot.toml"
        ).wait_for()
        drop(page, tmp_path / "table.csv")
        page.locator("#runs-problem", has_text="this page has one vehicle alone").wait_for()
    words = ["plan", str(files["path.csv"]), "--robot", str(files["vehicle.toml"]), "--objective", "flips"]
    assert run_command(main, [*words, "--out", str(tmp_path / "out")]) == 0
    theirs = {name: (tmp_path / "out" / name).read_text() for name in names[:3]}
    check_plans(json.loads(files["plan.json"].read_text()), json.loads(theirs["plan.json"]))
    assert files["plan.csv"].read_text().split(",p")[0] == theirs["plan.csv"].split(",p")[0]
    ours = files["schedule.h"].read_text().split("\n", 1)  # below the line with the plan's identity
    check_header(ours[1], theirs["schedule.h"].split("\n", 1)[1], 1e-9)
