"""Bad input in the page: one line beside what caused it, in the words of the command; the last good plan stays.

All cases share one page, which goes back to its first plan after each of them.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from planner.files.plan_files import write_plan
from planner.paths.path import circle
from planner.paths.path_files import read_path
from planner.planning.plan import plan
from sim.io.errors import run_command
from sim.model.presets import PRESETS
from sim.model.robot_toml import robot_toml
from softflagella.__main__ import main
from tests.planner.page.page_core import answer, without_digits
from tests.planner.page.view.browser import drop, opened_page, planned, text_of

ROBOT = PRESETS["paper-control"]
HEADER = "time_s,x_cm,y_cm,heading_deg\n"
OLD = "Picture and numbers are those of the last plan that could be made."
SCRIPT = """<svg width="40cm" height="40cm" viewBox="0 0 40 40"><script>document.title = "taken"</script>
<path d="M0 0 L30 0 L30 20" onload="document.title = 'taken'"/></svg>"""


def stroke(noise: float) -> str:
    """Write a stroke that wanders."""
    rng = np.random.default_rng(0)
    points = np.stack([np.linspace(0, 60, 1200), np.zeros(1200)], 1) + noise * rng.normal(size=(1200, 2))
    return "x_cm,y_cm\n" + "".join(f"{x:.3f},{y:.3f}\n" for x, y in points)


UNREADABLE: dict[str, str | bytes] = {
    "empty.csv": "",
    "blank.csv": "\n\n",
    "one point.csv": "x_cm,y_cm\n1,2\n",
    "one place.csv": "x_cm,y_cm\n1,2\n1,2\n",
    "nan.csv": "x_cm,y_cm\n0,0\nnan,3\n",
    "text.csv": "x_cm,y_cm\n0,0\na,3\n",
    "names.csv": "a,b\n1,2\n3,4\n",
    "one unit.csv": "x_cm,y\n1,2\n3,4\n",
    "commas.csv": "x_cm,y_cm\n1,5,2,5\n3,5,4,5\n",
    "huge.csv": "x_cm,y_cm\n0,0\n1e200,0\n",
    "picture.csv": b"\x89PNG\r\n\x1a\n\x00\x00\x00\rIHDR\x00",
    "picture.png": b"\x89PNG\r\n\x1a\n\x00\x00\x00\rIHDR\x00",
    "no path.svg": "<svg xmlns='http://www.w3.org/2000/svg'><text>a</text></svg>",
    "broken.svg": "<svg><path d='M0 0 L9",
    "script.svg": "<svg><script>document.title = 'taken'</script></svg>",
    "transform.svg": "<svg><path d='M0 0 L9 9' transform='rotate(a)'/></svg>",
}
NO_PLAN = {
    "very long.csv": "x_m,y_m\n0,0\n2000,0\n",
    "very short.csv": "x_mm,y_mm\n0,0\n1,0\n",
    "too tight.csv": "x_cm,y_cm\n0,0\n9,0\n9,2\n0,2\n0,4\n9,4\n",
    "turning back.csv": "x_cm,y_cm\n0,0\n4,0\n4,1\n0,1\n0,2\n4,2\n",
    "too noisy.csv": stroke(0.3),
}
READABLE = {
    "no header.csv": "0,0\n30.5,0\n30.5,20.25\n",
    "semicolons.csv": "x_cm;y_cm\n0;0\n30,5;0\n30,5;20,25\n",
    "quotes.csv": '"x_cm","y_cm"\n"0","0"\n"30.5","0"\n"30.5","20.25"\n',
    "mark.csv": "\ufeffx_cm,y_cm\n0,0\n30.5,0\n30.5,20.25\n",
    "script and path.svg": SCRIPT,
}
ROBOTS = {
    "unknown key.toml": "[tails]\ncount = 2\nlenght_cm = 11\n",
    "broken.toml": "[tails\n",
    "empty.toml": "",
    "too many.toml": robot_toml(ROBOT).replace("count = 2", "count = 2.5"),
}
PLANS = {
    "other version.json": '{"format": 1}',
    "list.json": "[1, 2]",
    "broken.json": "{",
}
TRACKS = {
    "still.csv": f"{HEADER}0,0,0,0\n0,1,0,0\n",
    "back.csv": f"{HEADER}0,25,0,90\n10,25,1,90\n5,25,2,90\n20,25,3,90\n",
    "gaps.csv": f"{HEADER}0,25,0,90\n10,,1,90\n15,25,2,90\n",
    "columns.csv": "time_s,x_cm,heading_deg\n0,0,0\n1,1,0\n",
    "units.csv": "time_s,x,y,heading_deg\n0,25,0,90\n1,25,1,90\n",
}
FIELDS = {
    "Number of tails N": ("0", "2.5", "65"),  # 1 and 9 are planned, as by the command
    "Viscosity in Pa s": ("-1", "40", "1e9"),  # 40: outside the look-up table
    "Tail length l in cm": ("-3", "1000"),
    "Motor speed in rpm": ("0", "1e6"),
}
OPTIONS = {
    "minimumSeconds": ("-1", "minimum dwell -1 s; give a number above 0"),
    "tolerance": ("0", "tolerance 0 l; give a number above 0"),
    "timeWeight": ("-2", "time weight -2; give a number of l², 0 or more"),
}


@pytest.fixture(scope="module")
def page(browser: Any, address: str) -> Iterator[Any]:
    """Open a page with a plan."""
    with opened_page(browser, f"{address}#v=1&objective=flips") as opened:
        planned(opened)
        yield opened


@pytest.fixture(scope="module")
def saved_plan(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Write a plan as the command does."""
    return write_plan(plan(circle(2.0), ROBOT, objective="flips"), tmp_path_factory.mktemp("plan"))[0]


@pytest.fixture(autouse=True)
def first_plan(page: Any) -> Iterator[None]:
    """Go back to the page's first plan after a test; nothing that was dropped has run."""
    yield
    assert page.title() != "taken"
    assert not page.is_visible("#problem")
    while page.is_enabled("#undo"):
        page.click("#undo")
    assert "dwells" in planned(page)


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Work in a folder, so that messages have the file's bare name."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


def write(folder: Path, name: str, content: str | bytes) -> Path:
    (folder / name).write_bytes(content if isinstance(content, bytes) else content.encode())
    return folder / name


def told(page: Any, place: str, file: Path | dict[str, Any]) -> str:
    """Drop a file, and return the one thing that the page says is wrong: one line beside the given part."""
    drop(page, file)
    planned(page)
    said = {part.get_attribute("id"): part.inner_text() for part in page.locator("[role=alert]:visible").all()}
    assert list(said) == [f"{place}-problem"]
    assert "\n" not in said[f"{place}-problem"]
    assert page.locator("#facts dd").count() > 5
    assert page.locator("#scene .declared").count() == 1
    return str(said[f"{place}-problem"])


def refused(capsys: pytest.CaptureFixture[str], *words: str) -> str:
    """Return the line with which the command refuses."""
    capsys.readouterr()
    assert run_command(main, list(words)) == 2
    return capsys.readouterr().err.strip().removeprefix("error: ")


@pytest.mark.parametrize("name", UNREADABLE)
def test_a_file_that_is_no_path_is_refused_in_the_words_of_the_command(
    page: Any, folder: Path, capsys: pytest.CaptureFixture[str], name: str
) -> None:
    file = write(folder, name, UNREADABLE[name])
    assert told(page, "path", file) == refused(capsys, "plan", name, "--robot", "paper-control", "--out", "out")
    assert "dwells" in text_of(page, "#message")  # the plan is that of the path as before


@pytest.mark.parametrize("name", NO_PLAN)
def test_a_path_that_cannot_be_planned_leaves_the_last_plan_marked_as_old(
    page: Any, folder: Path, capsys: pytest.CaptureFixture[str], name: str
) -> None:
    file = write(folder, name, NO_PLAN[name])
    theirs = refused(capsys, "plan", name, "--robot", "paper-control", "--objective", "flips", "--out", "out")
    ours = told(page, "path", file)
    advised = answer("advice.js", "inPage", theirs, {"tailLength": ROBOT.tail_length})
    assert without_digits(ours) == without_digits(advised)
    assert text_of(page, "#message") == OLD
    assert page.locator("#scene .old").count() == 1
    assert page.get_by_role("button", name="schedule.h").is_disabled()


@pytest.mark.parametrize("name", READABLE)
def test_what_the_command_reads_has_the_same_points_in_the_page(page: Any, folder: Path, name: str) -> None:
    drawing = read_path(write(folder, name, READABLE[name]))
    drop(page, folder / name)
    if drawing.unit is None:
        page.locator("#unit-dialog[open]").wait_for()
        page.get_by_label("cm: 30.5 × 20.3 cm").check()
        page.get_by_role("button", name="Take this path").click()
    assert "dwells" in planned(page)
    inputs = page.locator("#corner-table input").evaluate_all("all => all.map((input) => Number(input.value))")
    points = drawing.path.points * (1.0 if drawing.unit is None else 100 * drawing.unit)
    assert np.abs(np.reshape(inputs, (-1, 2)) - points).max() < 1e-3


@pytest.mark.parametrize("name", ROBOTS)
def test_a_bad_robot_is_refused_in_the_words_of_the_command(
    page: Any, folder: Path, capsys: pytest.CaptureFixture[str], name: str
) -> None:
    file = write(folder, name, ROBOTS[name])
    assert told(page, "robot", file) == refused(capsys, "plan", "circle:2l", "--robot", name, "--out", "out")


@pytest.mark.parametrize("name", PLANS)
def test_a_bad_plan_is_refused(page: Any, folder: Path, capsys: pytest.CaptureFixture[str], name: str) -> None:
    file = write(folder, name, PLANS[name])
    ours, theirs = told(page, "path", file), refused(capsys, "replay", name, "--out", "track.csv")
    assert ours.split("(")[0] == theirs.split("(")[0]


def test_a_plan_without_a_path_is_refused(page: Any, folder: Path) -> None:
    for content in ('{"format": 2}', '{"format": 2, "robot": {"tail_length_m": 0.1}, "raw_path": 3}'):
        assert "plan again" in told(page, "path", write(folder, "part.json", content))


@pytest.mark.parametrize("name", TRACKS)
def test_a_bad_track_is_refused_in_the_words_of_the_command(
    page: Any, folder: Path, saved_plan: Path, capsys: pytest.CaptureFixture[str], name: str
) -> None:
    file = write(folder, name, TRACKS[name])
    assert told(page, "measured", file) == refused(capsys, "planner", "check", str(saved_plan), name)


def test_a_bad_track_leaves_the_one_before(page: Any, folder: Path) -> None:
    drop(page, write(folder, "good.csv", f"{HEADER}0,25,0,90\n10,25,1,90\n"))
    planned(page)
    told(page, "measured", write(folder, "still.csv", TRACKS["still.csv"]))
    assert "good.csv" in text_of(page, "#measured")
    page.fill("#size", "27")
    assert "dwells" in planned(page)
    assert not page.is_visible("#measured-problem")
    page.get_by_role("button", name="Remove", exact=True).click()


def test_the_track_of_another_robot_is_above_the_stated_error(page: Any, folder: Path) -> None:
    drop(page, write(folder, "other.csv", f"{HEADER}0,500,0,90\n10,600,1,90\n"))
    planned(page)
    assert "the track is above it" in text_of(page, "#measured")
    page.get_by_role("button", name="Remove", exact=True).click()


def test_two_files_and_large_ones_are_refused(page: Any, folder: Path) -> None:
    one = write(folder, "a.csv", "x_cm,y_cm\n0,0\n30,0\n")
    drop(page, one, write(folder, "b.csv", "x_cm,y_cm\n0,0\n30,0\n"))
    planned(page)
    assert text_of(page, "#path-problem") == "Give one file at a time."
    large = write(folder, "large.csv", b"1,2\n" * 13_000_000)
    assert told(page, "path", large) == "large.csv has 52 MB; the page reads up to 20 MB."
    angles = np.linspace(0, 6, 1_000_000)
    rows = "".join(f"{300 * x:.3f},{300 * y:.3f}\n" for x, y in zip(np.cos(angles), np.sin(angles), strict=True))
    refusal = told(page, "path", write(folder, "million.csv", f"x_cm,y_cm\n{rows}"))
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


@pytest.mark.parametrize("option", OPTIONS)
def test_a_bad_option_is_refused_beside_it(page: Any, option: str) -> None:
    text, words = OPTIONS[option]
    page.fill(f"#{option}", text)
    page.keyboard.press("Tab")
    planned(page)
    assert text_of(page, "#options-problem") == words
    assert text_of(page, "#message") == OLD


def test_a_tolerance_that_cannot_be_kept_is_refused_beside_it(page: Any) -> None:
    page.fill("#tolerance", "0.0001")
    page.keyboard.press("Tab")
    planned(page)
    assert "cannot be kept: the smallest stated error is" in text_of(page, "#options-problem")


@pytest.mark.parametrize(
    ("link", "place", "words"),
    [
        ("v=2&N=3", "path", "The link cannot be read: it is of another version of this page."),
        ("v=1&points=", "path", "The link cannot be read: it is cut off or damaged."),
        ("v=1&path=cube%3A3", "path", "The link cannot be read: it has an unknown shape, cube."),
        ("v=1&path=circle%3A-3", "path", "circle: its size must be above 0"),
        ("v=1&objective=beauty", "options", "objective 'beauty'; allowed are error, time, flips"),
        ("v=1&corner=cut", "options", "corner 'cut'; allowed are"),
        ("v=1&point=tail", "options", "point 'tail'; allowed are"),
    ],
)
def test_a_bad_link_is_refused_with_a_reason(page: Any, link: str, place: str, words: str) -> None:
    page.evaluate(f"location.hash = '{link}'")
    page.locator(f"#{place}-problem:visible").wait_for()
    planned(page)
    assert words in text_of(page, f"#{place}-problem")
    assert page.locator("#scene .declared").count() == 1
    page.evaluate("location.hash = ''")
    planned(page)


def test_a_slider_that_is_moved_on_and_on_leaves_the_address_of_its_end(page: Any) -> None:
    slider = page.get_by_label("Viscosity in Pa s, slider")
    slider.evaluate(
        """(input) => {
          for (let i = 0; i < 300; i++) {
            input.value = 1 + i / 1000;
            input.dispatchEvent(new Event("input", { bubbles: true }));
          }
          input.dispatchEvent(new Event("change", { bubbles: true }));
        }"""
    )
    assert "viscosity=1.3" in page.evaluate("location.hash")
    assert "dwells" in planned(page)
