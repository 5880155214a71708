"""The demo's page: a lab's units and words, sections that a stranger can follow, and links that lead to files."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from urllib.parse import unquote

import numpy as np
import pandas as pd
import pytest

import softflagella as sf
from calibration.report.report import write_report
from planner.__main__ import main as planner
from planner.files.plan_files import write_plan
from planner.files.plan_json import load_plan
from planner.files.tracking_error import tracking_error
from planner.paths.path import circle, polygon
from planner.planning.plan import plan
from sim.__main__ import main as sim
from sim.io.errors import run_command
from sim.model.presets import PRESETS
from sim.model.response import DWELLS
from sim.motion.lab_units import lab_motion
from sim.motion.steady import steady
from softflagella.demo_figures import draw_circles, draw_schedule, in_lab_units
from softflagella.demo_files import documentation, header_excerpt
from softflagella.demo_page import Results, write_page
from softflagella.replanning import Steered
from surrogate.table.model_file import load
from tests.calibration.toy_tables import calibrated_toy, install_toy, shares_verdicts, toy_swimmer, toy_table
from tests.page_text import PageText

ROBOT = PRESETS["paper-control"]
ONE_LENGTH = {"lengths_cm": (8.0,), "end_over_end_drag": 4.0}
SECTIONS = [
    "The robot",
    "Its motion",
    "Three paths, planned without simulating",
    "The schedule itself",
    "A small sweep",
    "Look-up table against simulator",
    "Calibration with a table of runs: hidden effect",
    "Calibration with a table of runs: nothing hidden",
    "Planning again: what the correction is worth",
    "With your own robot: three commands",
]


def sweep_rows() -> pd.DataFrame:
    """Rows of a small sweep, as the shipped table predicts them."""
    rng = np.random.default_rng(1)
    low, high = [2.0, 1.5, 1.0, 4.0, 3.0, 20.0, 3.0], [5.0, 3.5, 7.0, 9.0, 5.0, 45.0, 10.0]
    names = ("C_t", "C_r", "C_yr", "l_over_R", "L_over_R", "l_over_r0", "omega_bar")
    rows = pd.DataFrame(rng.uniform(low, high, (24, 7)), columns=list(names))
    rows = rows.assign(N=2 + np.arange(24) % 3, a_over_R=1.0)
    motion = load().query({name: rows[name].to_numpy(float) for name in rows}, flag=True)
    outputs = ("omega_t_bar", "omega_h_bar", "omega_yr_bar", "R_yr_over_l", "theta_deg", "v_x", "v_z")
    return rows.assign(**{n: motion[n] for n in outputs}, converged=True, failed=False, touching=False)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A page with small results: true plans, their own predictions as replays, and verdicts on the toy."""
    out = tmp_path_factory.mktemp("demo")
    plans = {}
    for name, path in (("circle", circle(1.5)), ("square", polygon(4, 2.0)), ("triangle", polygon(3, 3.0))):
        result = plan(path, ROBOT, lookup=load())
        write_plan(result, out / "demo" / name)
        record = load_plan(out / "demo" / name / "plan.json")
        times = np.concatenate([[0.0], np.cumsum(record["dwell_s"])])
        poses = dict(
            zip(("x_over_l", "y_over_l", "heading_rad"), np.array(record["predicted_poses"]).T, strict=True)
        )
        track = pd.DataFrame({"time_bar": times / ROBOT.time_scale, "time_s": times, **poses})
        track.to_csv(out / "demo" / name / "track.csv", index=False)
        plans[name] = (record, tracking_error(record, track))
    with pytest.MonkeyPatch.context() as patch:
        install_toy(patch)
        runs = toy_swimmer(toy_table(1, **ONE_LENGTH)).runs, toy_swimmer(toy_table(3)).runs  # type: ignore[arg-type]
    verdicts = calibrated_toy(1, **ONE_LENGTH), calibrated_toy(3)  # type: ignore[arg-type]
    loops = dict(zip(("hidden effect", "nothing hidden"), zip(verdicts, runs, strict=True), strict=True))
    for name, (verdict, data) in loops.items():
        case = out / "demo" / name.replace(" ", "-")
        case.mkdir()
        write_report(verdict, data, case / "report.html", title=name)
        for file in ("corrected.toml", "table.csv", "verdict.json"):
            (case / file).touch()
    for file in ("robot.toml", "model.md"):
        (out / "demo" / file).touch()
    (out / "robot.html").touch()
    record, error = plans["square"]
    shares = {"calibrated": 10.0, "corrected": 1.2, "truth known": 1.0}
    groups = ROBOT.groups()
    results = Results(
        robot=ROBOT,
        motions=[steady(replace(groups, omega_bar=sign * groups.omega_bar)) for sign in (1.0, -1.0)],
        net_speed=np.linspace(0.01, 0.03, len(DWELLS)),
        plans=plans,
        rows=sweep_rows(),
        small=load(),
        loops=loops,
        steered={
            label: Steered(record, replace(error, rms=0.01 * share), error.track)
            for label, share in shares.items()
        },
        seconds=200.0,
    )
    write_page(out / "demo.html", results)
    return out


@shares_verdicts
def test_a_stranger_finds_the_parts_in_order(folder: Path) -> None:
    seen = PageText(folder / "demo.html")
    assert seen.headings == SECTIONS
    assert [link for link in seen.links if link.startswith("#")] == [f"#section-{n}" for n in range(1, 11)]


@shares_verdicts
def test_the_page_speaks_in_words_and_in_a_lab_s_units(folder: Path) -> None:
    seen = PageText(folder / "demo.html")
    names = re.findall(r"\b(?:omega_\w+|R_yr\w*|theta_\w+|v_[xz]|l_over_\w+|\w+_bar|\w+_over_l)\b", seen.text)
    assert names == []
    assert re.findall(r"/ ?l\b|\bl rms", seen.text) == []  # errors and axes were in tail lengths
    for value in ("N = 2", "11 cm", "3.2 mm", "1.2 MPa", "43.3 rpm", "1.49 Pa s"):
        assert value in seen.text, value
    motion = {name: values[0] for name, values in lab_motion([ROBOT], steady(ROBOT.groups()).columns()).items()}
    for value in (f"{motion['R_yr_cm']:.3g} cm", f"{motion['v_cm_s']:.3g} cm/s", f"{motion['theta_deg']:.3g}°"):
        assert value in seen.text, value
    assert re.search(r"\d mm rms", seen.text)
    assert {"x [cm]", "heading [°]", "net speed [cm/min]", "motor speed [rpm]"} <= set(seen.words)


@shares_verdicts
def test_every_link_leads_to_a_file(folder: Path) -> None:
    seen = PageText(folder / "demo.html")
    files = [unquote(link) for link in seen.links if not link.startswith("#")]
    for file in files:
        assert (folder / file).exists(), file
    assert {
        "demo/robot.toml", "demo/model.md", "demo/square/schedule.h", "demo/triangle/plan.json",
        "demo/hidden-effect/report.html", "demo/nothing-hidden/corrected.toml", "robot.html",
    } <= set(files)  # fmt: skip
    assert any(file.endswith(("signs.md", "signs.html")) for file in files)


@shares_verdicts
def test_one_file_in_both_colours(folder: Path) -> None:
    html = (folder / "demo.html").read_text()
    assert "prefers-color-scheme: dark" in html
    assert html.count("<figure>") == html.count("<svg ") >= 15
    assert html.count("<img") == 1  # the page that plans; figures are vectors
    assert not re.search(r'(?:src|href)="https?:', html)


@shares_verdicts
def test_the_three_commands_are_commands(folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As they stand on the page; the last one, a replay, takes long and is only read."""
    text = "".join(PageText(folder / "demo.html").words)
    commands = [line.split()[1:] for line in text.splitlines() if line.startswith("softflagella ")]
    assert [words[0] for words in commands] == ["robot", "plan", "replay"]
    monkeypatch.chdir(tmp_path)
    assert run_command(sim, commands[0]) == 0
    assert run_command(planner, commands[1]) == 0
    assert (tmp_path / commands[2][1]).exists()
    assert sf.load_robot("robot.toml") == ROBOT


def test_circles_are_drawn_to_scale() -> None:
    motions = [steady(replace(ROBOT.groups(), omega_bar=sign * ROBOT.groups().omega_bar)) for sign in (1.0, -1.0)]
    lines = draw_circles(ROBOT, motions).axes[0].get_lines()[:2]
    for line, side in zip(lines, (1.0, -1.0), strict=True):
        x, y = np.asarray(line.get_xdata()), np.asarray(line.get_ydata())
        assert np.ptp(x) / 2 == pytest.approx(100 * ROBOT.tail_length * float(motions[0].turn_radius[0]), rel=1e-3)
        assert np.sign(y.mean()) == side  # a motor at +1 turns left
        assert np.diff(y)[0] * side > 0  # and moves to the left


def test_the_schedule_is_drawn_from_its_first_direction() -> None:
    """Dwells of 2 s at +1 and 1 s at −1, then one long dwell, which the magnified interval shows."""
    dwells = [2.0, 1.0] * 20 + [30.0] + [1.0, 2.0] * 20
    track = pd.DataFrame({"time_s": np.arange(150.0), "heading_rad": np.zeros(150)})
    for first in (1, -1):
        figure = draw_schedule({"dwell_s": dwells, "first_direction": first}, track)
        bars = figure.axes[1].collections
        longest = [max(np.ptp(path.vertices[:, 0]) for path in collection.get_paths()) for collection in bars[:2]]
        assert longest[0 if first == 1 else 1] == pytest.approx(30.0)
        low, high = figure.axes[1].get_xlim()
        assert low < 60.0 < high


def test_rows_are_read_as_robots_with_this_head_and_silicone() -> None:
    """The control robot's own row gives its own motion."""
    motion = steady(ROBOT.groups()).columns()
    rows = pd.DataFrame({name: [value] for name, value in ROBOT.group_values().items()})
    lab = in_lab_units(rows, motion, ROBOT).iloc[0]
    assert lab["l_cm"] == pytest.approx(11.0)
    assert lab["omega_rpm"] == pytest.approx(43.26, rel=1e-3)
    for name, values in lab_motion([ROBOT], motion).items():
        assert lab[name] == pytest.approx(values[0])


def test_the_excerpt_of_a_header_ends_with_its_first_numbers() -> None:
    defined = "#define SCHEDULE_FIRST_DIRECTION (1)\n#define SCHEDULE_START_X -0.5\n"
    macros = "#ifdef __AVR__\n#define SCHEDULE_TABLE(name) name\n#endif\n"
    header = f"/* 1 */\n{defined}{macros}static x[] = {{\n    12, 34,\n    56,\n}};"
    assert header_excerpt(header) == [*defined.splitlines(), "static x[] = {", "    12, 34,", "    …"]


def test_without_a_checkout_there_are_no_links_to_the_documentation(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert len(documentation(tmp_path)) == 5
    monkeypatch.setattr("softflagella.demo_files._DOCS", tmp_path / "docs")
    assert documentation(tmp_path) == []
