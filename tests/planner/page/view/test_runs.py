"""A table of runs in the page: its comparison, its command and the robot to calibrate."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

from planner.page.write_page import write_page
from planner.planning.request import PlanRequest
from sim.inputs import load_robot
from sim.model.presets import PRESETS
from surrogate.one_robot.tabulate import tabulate
from tests.planner.page.runs import table_of_runs
from tests.planner.page.view.browser import drop, opened_page, planned, text_of


def test_runs_are_compared_and_the_command_is_copied(browser: Any, address: str, tmp_path: Path) -> None:
    runs = table_of_runs()
    runs.loc[4, "theta_deg"] = -3.0
    runs[runs["N"] == 3].to_csv(tmp_path / "my table.csv", index=False)
    with opened_page(browser, address, permissions=["clipboard-read", "clipboard-write"]) as page:
        planned(page)
        page.select_option("#robot-name", "paper-measured")
        drop(page, tmp_path / "my table.csv")
        page.locator("#runs table").wait_for()
        planned(page)
        assert page.locator("#runs tbody tr").count() == 23
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
        page.locator("#runs").scroll_into_view_if_needed()
        with page.expect_download() as download:
            page.get_by_role("button", name="Save robot.toml").click()
        download.value.save_as(tmp_path / "robot.toml")
        assert load_robot(tmp_path / "robot.toml") == replace(PRESETS["paper-measured"], name="paper-measured")
        summary = text_of(page, "#runs .soft")
        page.fill("input[aria-label='Viscosity in Pa s']", "1.5")
        planned(page)
        assert text_of(page, "#runs .soft") != summary  # the table's answers are for the robot of the page
        page.get_by_role("button", name="Remove the runs").click()
        assert text_of(page, "#runs") == ""


def test_a_table_that_is_no_table_of_runs_is_refused_in_one_line(
    browser: Any, address: str, tmp_path: Path
) -> None:
    runs = table_of_runs()
    texts = {
        "lacking.csv": runs.drop(columns="N").to_csv(index=False),
        "misspelt.csv": runs.rename(columns={"theta_deg": "thetta_deg"}).to_csv(index=False),
        "words.csv": runs.assign(l_cm="long").to_csv(index=False),
    }
    for name, text in texts.items():
        (tmp_path / name).write_text(text)
    with opened_page(browser, address) as page:
        planned(page)
        drop(page, tmp_path / "lacking.csv")
        page.locator(
            "#runs-problem", has_text="the table has no column 'N'; it needs N, l_cm, omega_rpm"
        ).wait_for()
        drop(page, tmp_path / "misspelt.csv")
        waits_for(page, "unknown column 'thetta_deg': is it 'theta_deg'?")
        drop(page, tmp_path / "words.csv")
        waits_for(page, "0 usable runs (row 1 (line 2): l_cm = long is not a finite number)")


def test_a_page_of_one_robot_says_that_it_cannot_compare(browser: Any, tmp_path: Path) -> None:
    robot = replace(PRESETS["paper-control"], effects={"left_right_bias": 0.1})
    path = write_page(tmp_path / "page.html", robot, tabulate(robot), PlanRequest())
    table_of_runs().to_csv(tmp_path / "table.csv", index=False)
    with opened_page(browser, path.as_uri()) as page:
        planned(page)
        drop(page, tmp_path / "table.csv")
        waits_for(page, "runs can only be compared with the trained look-up table")


def waits_for(page: Any, words: str) -> None:
    """Wait until the page says why it does not show the runs."""
    page.locator("#runs-problem", has_text=words).wait_for()
