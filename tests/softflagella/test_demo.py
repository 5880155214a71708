"""The demo: its page, in a lab's words; steps that run side by side; and what a correction is worth."""

from __future__ import annotations

import re
import subprocess
from dataclasses import replace
from pathlib import Path
from urllib.parse import unquote

import numpy as np
import pandas as pd
import pytest

from planner.files.plan_files import write_plan
from planner.files.saved_plan import load_plan
from planner.jobs.plan import plan
from planner.paths.path import circle, polygon
from sim.model.presets import PRESETS
from sim.model.response import DWELLS
from sim.motion.steady import steady
from sim.motion.steady_motion import lab_motion
from softflagella.__main__ import command
from softflagella.demo import _beside, steer
from softflagella.demo_figures import draw_circles, draw_path, draw_schedule, in_lab_units
from softflagella.demo_page import Results, documentation, write_page
from surrogate.table_file import load
from tests.calibration.toy_tables import DRAG, ambiguous, none, toy_swimmer, toy_table
from tests.page_text import PageText
from tests.planner.plans import predicted_track
from tracking.tracks import tracking_error

ROBOT = PRESETS["paper-control"]


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


def write_demo(out: Path) -> None:
    """Write a page with small results: a true plan, its prediction as its replay, and verdicts on the toy."""
    planned = plan(circle(1.5), ROBOT, lookup=load())
    plans = {}
    for name in ("circle", "square", "triangle"):
        write_plan(planned, out / "demo" / name)
        record = load_plan(out / "demo" / name / "plan.json")
        track = predicted_track(planned)
        track["time_s"] = ROBOT.time_scale * track["time_bar"]
        track.to_csv(out / "demo" / name / "track.csv", index=False)
        plans[name] = (record, tracking_error(record, track))
    loops = {
        "hidden effect": (ambiguous(), toy_swimmer(toy_table(1, lengths_cm=(8.0,), **{DRAG: 4.0})).runs),
        "nothing hidden": (none(), toy_swimmer(toy_table(3)).runs),
    }
    for name in loops:
        case = out / "demo" / name.replace(" ", "-")
        case.mkdir()
        for file in ("report.html", "corrected.toml", "table.csv", "verdict.json"):
            (case / file).touch()
    for file in ("demo/robot.toml", "demo/model.md", "robot.html"):
        (out / file).touch()
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
        steered={label: (record, replace(error, rms=0.01 * share)) for label, share in shares.items()},
        seconds=200.0,
    )
    write_page(out / "demo.html", results)


@pytest.mark.slow
def test_a_stranger_finds_the_parts_of_the_page_in_order_in_the_words_of_a_lab(tmp_path: Path) -> None:
    write_demo(tmp_path)
    seen = PageText(tmp_path / "demo.html")
    assert len(seen.headings) == 10
    assert [link for link in seen.links if link.startswith("#")] == [f"#section-{n}" for n in range(1, 11)]
    names = re.findall(r"\b(?:omega_\w+|R_yr\w*|theta_\w+|v_[xz]|l_over_\w+|\w+_bar|\w+_over_l)\b", seen.text)
    assert names == []
    assert re.findall(r"/ ?l\b|\bl rms", seen.text) == []  # errors and axes are not in tail lengths
    motion = {name: values[0] for name, values in lab_motion([ROBOT], steady(ROBOT.groups()).columns()).items()}
    for value in (
        "N = 2", "11 cm", "3.2 mm", "1.2 MPa", "43.3 rpm", "1.49 Pa s",
        f"{motion['R_yr_cm']:.3g} cm", f"{motion['v_cm_s']:.3g} cm/s", f"{motion['theta_deg']:.3g}°",
    ):  # fmt: skip
        assert value in seen.text, value
    assert re.search(r"\d mm rms", seen.text)
    assert {"x [cm]", "heading [°]", "net speed [cm/min]", "motor speed [rpm]"} <= set(seen.words)
    files = [unquote(link) for link in seen.links if not link.startswith("#")]
    assert [file for file in files if not (tmp_path / file).exists()] == []
    assert {
        "demo/robot.toml", "demo/model.md", "demo/square/schedule.h", "demo/triangle/plan.json",
        "demo/hidden-effect/report.html", "demo/nothing-hidden/corrected.toml", "robot.html",
    } <= set(files)  # fmt: skip
    assert any(file.endswith(("signs.md", "signs.html")) for file in files)
    html = (tmp_path / "demo.html").read_text()  # one file in both colours
    assert "prefers-color-scheme: dark" in html
    assert html.count("<figure>") == html.count("<svg ") >= 15
    assert html.count("<img") == 1  # the page that plans; figures are vectors
    assert not re.search(r'(?:src|href)="https?:', html)
    commands = [line.split()[1:] for line in "".join(seen.words).splitlines() if line.startswith("softflagella ")]
    assert [words[0] for words in commands] == ["robot", "plan", "replay"]
    for word, *further in commands:
        command(word).parser(word).parse_args(further)


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


def test_without_a_checkout_there_are_no_links_to_the_documentation(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert len(documentation(tmp_path)) == 5
    monkeypatch.setattr("softflagella.demo_page._DOCS", tmp_path / "docs")
    assert documentation(tmp_path) == []


def test_a_command_beside_a_step_prints_after_it_or_fails(capfd: pytest.CaptureFixture[str]) -> None:
    with _beside("--version"):
        print("the step")
    first, second, third = capfd.readouterr().out.splitlines()
    assert first.split() == ["softflagella", "--version"]
    assert second == "the step"
    assert third.startswith("softflagella ")
    with pytest.raises(subprocess.CalledProcessError), _beside("train", "no-such-folder", "--out", "m"):
        pass
    assert "no-such-folder" in capfd.readouterr().out.splitlines()[-1]


def test_a_step_that_fails_ends_the_command_beside_it(monkeypatch: pytest.MonkeyPatch) -> None:
    started: list[subprocess.Popen[str]] = []
    start = subprocess.Popen
    monkeypatch.setattr(subprocess, "Popen", lambda *a, **k: (started.append(start(*a, **k)), started[0])[1])
    with pytest.raises(KeyboardInterrupt), _beside("steady", "paper-control"):
        raise KeyboardInterrupt
    assert started[0].poll() is not None


@pytest.mark.rest
def test_the_right_model_brings_the_robot_back_on_its_path() -> None:
    """A robot with end-over-end drag: planned without it, nearly with it, and with the truth."""
    truth = replace(PRESETS["paper-control"], effects={"end_over_end_drag": 5.0})
    models = {
        "without": replace(truth, effects={}),
        "nearly": replace(truth, effects={"end_over_end_drag": 4.9}),
        "truth": truth,
    }
    steered = steer(models, truth, polygon(4, 2.5))
    without, nearly, best = (error.rms for _, error in steered.values())
    assert without > 5 * best
    assert without - nearly > 0.8 * (without - best)
    assert [len(draw_path(*run).axes[0].get_lines()) for run in steered.values()] == [4, 4, 4]
