"""The demo: its commands and its page; steps that run side by side; and what a correction is worth."""

from __future__ import annotations

import math
import os
import re
import shlex
import signal
from collections.abc import Mapping
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from urllib.parse import unquote

import numpy as np
import pandas as pd
import pytest

from common.errors import InputError
from common.files import write_csv
from planner.jobs.plan import plan
from planner.paths.path import Path2D, polygon
from sim.model.presets import PRESETS
from sim.model.robot import Robot
from sim.motion.replay import replay
from softflagella.__main__ import WORDS, command, program_of
from softflagella.demo import run_steps
from softflagella.demo_page import documentation, write_page
from softflagella.demo_steps import CHAINS, SWEEP_TOML, Done, Step
from surrogate.tabulate import tabulate
from tests.page_text import PageText
from tracking.tracks import check

STEPS = [step for chain in CHAINS for step in chain]


def parse(line: str) -> None:
    """Parse a command of softflagella as the command itself does."""
    word, *further = shlex.split(line)
    subcommand = command(word) if word in WORDS else program_of(word).commands[further.pop(0)]
    subcommand.parser(word).parse_args(further)


def test_a_stranger_finds_every_step_with_its_commands_and_every_file_one_click_away(tmp_path: Path) -> None:
    picture = Path(__file__).parents[2].joinpath("docs", "plans.png").read_bytes()
    for step in STEPS:
        for file in (*step.files, *filter(None, [step.picture])):
            path = tmp_path / "demo" / file
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(picture)
    write_page(tmp_path / "demo.html", [Done(step, ["printed"] * len(step.commands)) for step in STEPS], 200.0)
    seen, html = PageText(tmp_path / "demo.html"), (tmp_path / "demo.html").read_text()
    assert [step.title for step in STEPS] == seen.headings[:-1]
    links = [unquote(link) for link in seen.links]
    assert [f"#section-{n}" for n in range(1, len(STEPS) + 2)] == [link for link in links if link.startswith("#")]
    files = [link for link in links if not link.startswith("#")]
    assert [file for file in files if not (tmp_path / file).exists()] == []
    assert {f"demo/{file}" for step in STEPS for file in step.files} <= set(files)
    assert {
        "demo/robot.toml", "demo/page.html", "demo/sweep.html", "demo/model.md", "demo/square/schedule.h",
        "demo/triangle/plan.json", "demo/hidden-effect/report.html", "demo/nothing-hidden/corrected.toml",
        "demo/swim/film.csv", "demo/swim/report.html", "demo/swim/corrected.toml", "demo/truth.toml",
    } <= set(files)  # fmt: skip
    assert any(file.endswith(("signs.md", "signs.html")) for file in files)
    assert "prefers-color-scheme: dark" in html  # one file in both colours
    assert html.count("<img") == sum(bool(step.picture) for step in STEPS) + 1  # the page that plans
    assert not re.search(r'(?:src|href)="https?:', html)
    lines = [line.removeprefix("$ ") for line in "\n".join(seen.words).splitlines() if "softflagella " in line]
    typed = [line.removeprefix("softflagella ") for line in lines if line.startswith("softflagella ")]
    assert len(typed) == sum(len(step.commands) for step in STEPS) + 4  # with those for one's own robot
    for line in typed:
        parse(line)
    names = re.findall(r"\b(?:omega_\w+|R_yr\w*|theta_\w+|v_[xz]|l_over_\w+|\w+_bar|\w+_over_l)\b", seen.text)
    assert names == []  # it is in the words of a lab


def test_what_a_step_reads_is_written_before() -> None:
    """By a command before it in its chain or in the first one, or before all steps."""
    before = {"hidden-effect/runs.csv", "nothing-hidden/runs.csv", "truth.toml"}
    for chain in CHAINS:
        written = set(before)
        for step in chain:
            if step.filmed:
                assert step.filmed in written
                written.add(str(Path(step.filmed).with_name("film.csv")))
            for words in map(shlex.split, step.commands):
                options = dict(pairwise(words))
                outputs = {options.get("--out"), options.get("--plot"), str(SWEEP_TOML)}
                inputs = [w for w in words if Path(w).suffix in (".toml", ".csv", ".json") and w not in outputs]
                assert [w for w in inputs if not {w, str(Path(w).parent)} & written] == []
                written |= {str(output) for output in outputs}
        before |= written if chain is CHAINS[0] else set()


def test_steps_print_their_commands_in_order_or_fail(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    first = Step("first", "", ("robot paper-control --out robot.toml",), {})
    others = [(Step(f"other {k}", "", ("--version", "robot robot"), {}),) for k in range(2)]
    with pytest.raises(InputError, match="softflagella robot robot: the following arguments are required: --out"):
        run_steps([(first,), *others], tmp_path)
    assert (tmp_path / "robot.toml").is_file()
    assert capfd.readouterr().out.splitlines() == ["$ softflagella robot paper-control --out robot.toml",
                                                   "paper-control -> robot.toml"]  # fmt: skip
    others = [(step._replace(commands=("--version", "robot vehicle --out v.toml")),) for (step,) in others]
    done = run_steps([(first,), *others], tmp_path)
    assert [each.step.title for each in done] == ["first", "other 0", "other 1"]
    assert [line.split()[0] for line in done[1].lines()] == ["$", "softflagella", "$", "vehicle"]


def _die(folder: Path) -> None:
    os.kill(os.getpid(), signal.SIGKILL)


def test_a_killed_process_of_the_demo_is_one_line(tmp_path: Path) -> None:
    step = Step("first", "", ("robot paper-control --out robot.toml",), {})
    with pytest.raises(InputError, match="was killed; perhaps the machine ran out of memory"):
        run_steps([(step,)], tmp_path, _die)


def test_a_swim_is_filmed_with_errors_half_of_which_are_slow(tmp_path: Path) -> None:
    """The robot goes round a circle, its heading beyond 180°."""
    time = np.arange(0.0, 2000.0, 0.3)
    angle = 0.01 * time
    track = {"time_s": time, "x_cm": 10 * np.cos(angle), "y_cm": 10 * np.sin(angle),
             "heading_deg": (np.degrees(angle) + 180) % 360 - 180}  # fmt: skip
    write_csv(track, tmp_path / "given.csv")
    run_steps([(Step("seen", "", ("--version",), {}, filmed="given.csv"),)], tmp_path)
    film = pd.read_csv(tmp_path / "film.csv")
    assert np.diff(film.time_s) == pytest.approx(0.5)
    seen_at = 0.01 * film.time_s
    errors = np.stack([film.x_cm - 10 * np.cos(seen_at), film.y_cm - 10 * np.sin(seen_at),
                       film.heading_deg - np.degrees(seen_at)], 1) / [0.03, 0.03, 0.5]  # fmt: skip
    assert errors.std(0) == pytest.approx(math.sqrt(2), rel=0.1)
    for later, memory in ((2, math.exp(-0.1)), (20, math.exp(-1)), (200, 0.0)):  # pictures
        assert (errors[later:] * errors[:-later]).mean() == pytest.approx(memory, abs=0.15)


def test_without_a_checkout_there_are_no_links_to_the_documentation(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert len(documentation(tmp_path)) == 7
    monkeypatch.setattr("softflagella.demo_page._DOCS", tmp_path / "docs")
    assert documentation(tmp_path) == []


def rms_on_the_true_robot(models: Mapping[str, Robot], truth: Robot, path: Path2D) -> list[float]:
    """Plan a path with each of several models of a robot, and run the schedules on the true robot, open loop."""
    errors = []
    for model in models.values():
        planned = plan(path, model, lookup=tabulate(model))
        errors.append(check(planned, replay(planned.schedule(truth))).rms)
    return errors


@pytest.mark.rest
def test_the_right_model_brings_the_robot_back_on_its_path() -> None:
    """A robot with end-over-end drag: planned without it, nearly with it, and with the truth."""
    truth = replace(PRESETS["paper-control"], effects={"end_over_end_drag": 5.0})
    models = {
        "without": replace(truth, effects={}),
        "nearly": replace(truth, effects={"end_over_end_drag": 4.9}),
        "truth": truth,
    }
    without, nearly, best = rms_on_the_true_robot(models, truth, polygon(4, 2.5))
    assert without > 5 * best
    assert without - nearly > 0.8 * (without - best)
