"""Bad input in the page: one line beside what caused it, in the words of the command; the last good plan stays."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from common.errors import run_command
from planner.files.plan_files import write_plan
from softflagella.__main__ import main
from tests.planner.page.page_core import answer, without_digits
from tests.planner.page.view.browser import address_of, drop, is_seen, planned, text_of, unfold
from tests.planner.plans import planned as planned_by_python

OLD = "Picture and numbers are those of the last plan that could be made."
HEADER = "time_s,x_cm,y_cm,heading_deg\n"
PLAN = ["--robot", "paper-control", "--objective", "flips", "--out", "out"]
FILES: dict[str, tuple[str, str | bytes, list[str]]] = {  # part of the page, content, the command that refuses it
    "text.csv": ("path", "x_cm,y_cm\n0,0\na,3\n", ["plan", "text.csv", *PLAN]),
    "picture.png": ("path", b"\x89PNG\r\n\x1a\n\x00\x00\x00\rIHDR\x00", ["plan", "picture.png", *PLAN]),
    "script.svg": ("path", "<svg><script>document.title = 'taken'</script></svg>", ["plan", "script.svg", *PLAN]),
    "tight.csv": ("path", "x_cm,y_cm\n0,0\n4,0\n4,1\n0,1\n0,2\n4,2\n", ["plan", "tight.csv", *PLAN]),
    "robot.toml": ("robot", "[tails]\ncount = 2\nlenght_cm = 11\n",
                   ["plan", "circle:2l", "--robot", "robot.toml", "--out", "out"]),
    "broken.json": ("path", "{", ["replay", "broken.json", "--out", "track.csv"]),
    "back.csv": ("measured", f"{HEADER}0,25,0,90\n10,25,1,90\n5,25,2,90\n20,25,3,90\n",
                 ["check", "plan/plan.json", "back.csv"]),
}  # fmt: skip
FIELDS = {"Number of tails N": ("0", "2.5", "65"), "Viscosity in Pa s": ("-1", "40")}  # 40: outside the table
OPTIONS = {
    "minimumSeconds": ("-1", "minimum dwell -1 s; give a number above 0"),
    "tolerance": ("0", "tolerance 0 l; give a number above 0"),
    "timeWeight": ("-2", "time weight -2; give a number of l², 0 or more"),
}
LINKS = [
    ("v=1&path=cube%3A3", "path", "The link cannot be read: it has an unknown shape, cube."),
    ("v=1&path=circle%3A-3", "path", "circle: its size must be above 0"),
    ("v=1&objective=beauty", "options", "objective 'beauty'; allowed are error, time, flips"),
]


@pytest.fixture(autouse=True)
def _here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Work in an empty folder, so that messages have the file's bare name."""
    monkeypatch.chdir(tmp_path)


def told(page: Any, place: str, name: str, content: str | bytes) -> str:
    """Drop a file, and return the one thing that the page says is wrong: one line beside the given part."""
    Path(name).write_bytes(content if isinstance(content, bytes) else content.encode())
    drop(page, Path(name))
    planned(page)
    said = {part.get_attribute("id"): part.inner_text() for part in page.locator("[role=alert]:visible").all()}
    assert list(said) == [f"{place}-problem"]
    assert "\n" not in said[f"{place}-problem"]
    assert page.locator("#facts dd").count() > 5
    assert page.locator("#scene .declared").count() == 1
    return str(said[f"{place}-problem"])


@pytest.mark.parametrize("name", FILES)
def test_a_file_is_refused_in_the_words_of_the_command(
    page: Any, capsys: pytest.CaptureFixture[str], name: str
) -> None:
    place, content, command = FILES[name]
    if place == "measured":
        write_plan(planned_by_python("circle:2l", objective="flips"), Path("plan"))
    ours = told(page, place, name, content)
    assert run_command(main, command) == 2
    theirs = capsys.readouterr().err.strip().removeprefix("error: ")
    if name == "tight.csv":  # there is no plan of it
        assert without_digits(ours) == without_digits(answer("words.js", "inPage", theirs, {"tailLength": 0.11}))
        assert text_of(page, "#message") == OLD
        assert page.locator("#scene .old").count() == 1
        assert page.evaluate("getComputedStyle(document.querySelector('#lens .flip')).opacity") == "0.35"
        assert page.get_by_role("button", name="schedule.h").is_disabled()
        assert text_of(page, "#next") == "Draw your own path"  # there is no schedule to save
        return
    assert "dwells" in text_of(page, "#message")  # the plan is that of the path as before
    parts = (ours.split("(")[0], theirs.split("(")[0]) if name.endswith(".json") else (ours, theirs)
    assert parts[0] == parts[1]


def test_a_bad_track_leaves_the_one_before(page: Any) -> None:
    Path("good.csv").write_text(f"{HEADER}0,25,0,90\n10,25,1,90\n")
    drop(page, Path("good.csv"))
    planned(page)
    page.evaluate("scrollTo(0, 0)")
    told(page, "measured", "still.csv", f"{HEADER}0,0,0,0\n0,1,0,0\n")
    assert is_seen(page, "#measured-problem")
    assert "good.csv" in text_of(page, "#measured")
    page.fill("#size", "27")
    assert "dwells" in planned(page)
    assert not page.is_visible("#measured-problem")


def test_large_files_are_refused(page: Any) -> None:
    assert (
        told(page, "path", "large.csv", b"1,2\n" * 5_500_000) == "large.csv has 22 MB; the page reads up to 20 MB."
    )
    angles = np.linspace(0, 6, 30_000)
    rows = "".join(f"{300 * x:.3f},{300 * y:.3f}\n" for x, y in zip(np.cos(angles), np.sin(angles), strict=True))
    refusal = told(page, "path", "many.csv", f"x_cm,y_cm\n{rows}")
    assert "points, and the page takes up to 20000: give fewer" in refusal


@pytest.mark.parametrize("field", FIELDS)
def test_a_bad_number_is_refused_beside_its_field(page: Any, field: str) -> None:
    good = page.input_value(f"input[aria-label='{field}']")
    for text in FIELDS[field]:
        page.fill(f"input[aria-label='{field}']", text)
        planned(page)
        assert len(text_of(page, "#robot-problem").splitlines()) == 1, text
        assert text_of(page, "#message") == OLD
        assert not page.is_visible("#path-problem")
        assert page.locator("#scene .old .declared").count() == 1
    page.fill(f"input[aria-label='{field}']", good)
    assert "dwells" in planned(page)
    assert not page.is_visible("#robot-problem")


@pytest.mark.parametrize("option", [*OPTIONS, "kept"])
def test_a_bad_option_is_refused_beside_it(page: Any, option: str) -> None:
    name = "tolerance" if option == "kept" else option
    text, words = OPTIONS.get(option, ("0.0001", "cannot be kept: the smallest stated error is"))
    page.fill(f"#{name}", text)
    page.keyboard.press("Tab")
    planned(page)
    assert words in text_of(page, "#options-problem")
    assert text_of(page, "#message") == OLD


@pytest.mark.parametrize(("link", "place", "words"), LINKS, ids=[link for link, _, _ in LINKS])
def test_a_bad_link_is_refused_with_a_reason(page: Any, link: str, place: str, words: str) -> None:
    page.evaluate(f"location.hash = '{link}'")
    page.locator(f"#{place}-problem:visible").wait_for()
    planned(page)
    assert words in text_of(page, f"#{place}-problem")
    assert page.locator("#scene .declared").count() == 1


def test_what_is_wrong_with_a_link_is_told_until_the_next_change(page: Any) -> None:
    """A change that plans nothing anew counts, too."""
    page.evaluate("location.hash = 'v=1&path=cube%3A3'")
    page.locator("#path-problem", has_text="The link cannot be read").wait_for()
    planned(page)
    unfold(page)
    page.fill("#smooth", "2.5")
    page.locator("#smooth").blur()
    assert "smooth=2.5" in address_of(page)
    assert not page.is_visible("#path-problem")
