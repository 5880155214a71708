"""The pages' examples run: the blocks of a page, in order, in an empty folder."""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any

import pytest

from common.errors import run_command
from sim.inputs import load_robot
from softflagella.__main__ import main
from tests.docs.pages import DOCS, PAGES, blocks, page_name
from tests.processes import LIMIT, ROOT

RUN = ("sh", "python")
LONG = {"tutorial/schedule.md", "howto/sweep.md", "howto/goal.md", "howto/jobs.md", "howto/page.md",
        "howto/query.md", "howto/tracker.md"}  # fmt: skip
LONGEST = {"tutorial/calibration.md", "tutorial/bad-day.md", "tutorial/film.md", "tutorial/one-swim.md"}
SIMPLE = re.compile(r"softflagella [^|<>$*;&`]+")  # a command that needs no shell
SHOWN = {*RUN, "toml", "text", "js"}


def marked() -> list[Any]:
    """Return the pages with something to run."""
    pages = [p for p in PAGES if any(b.language in RUN and not b.reason for b in blocks(p))]
    marks = {**dict.fromkeys(LONG, pytest.mark.rest), **dict.fromkeys(LONGEST, pytest.mark.rates)}
    return [pytest.param(p, id=page_name(p), marks=marks.get(page_name(p), ())) for p in pages]


def environment(folder: Path) -> dict[str, str]:
    """Make an environment in which `softflagella` is the command of this source tree, and `python` this Python."""
    for name, words in (("softflagella", " -m softflagella"), ("python", "")):
        command = folder / name
        command.write_text(f'#!/bin/sh\nexec "{sys.executable}"{words} "$@"\n')
        command.chmod(0o755)
    path = os.pathsep.join([str(folder), os.environ.get("PATH", "")])
    return {**os.environ, "PATH": path, "PYTHONPATH": str(ROOT)}


def run_shell(code: str, shell: dict[str, str]) -> None:
    """Run lines of a shell; commands of the package that need none run in this process, which has imported it."""
    rest = ""
    for line in [*code.replace("\\\n", " ").splitlines(), ""]:
        simple = SIMPLE.fullmatch(line)
        if rest and (simple or not line):
            command = ["sh", "-e", "-c", rest]
            done = subprocess.run(command, env=shell, capture_output=True, text=True, timeout=LIMIT)
            assert done.returncode == 0, f"{rest}\n{done.stdout}\n{done.stderr}"
        rest = "" if simple else f"{rest}{line}\n"
        assert not simple or run_command(main, shlex.split(line, comments=True)[1:]) == 0, line


@pytest.mark.slow
@pytest.mark.parametrize("page", marked())
def test_the_blocks_of_a_page_run(page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    commands, work = tmp_path / "bin", tmp_path / "work"
    commands.mkdir()
    work.mkdir()
    monkeypatch.chdir(work)
    shell, names = environment(commands), {"__name__": "__page__"}
    for block in blocks(page):
        if block.reason or block.language not in RUN:
            continue
        if block.language == "python":
            exec(compile(block.code, page_name(page), "exec"), names)
        else:
            run_shell(block.code, shell)


def test_every_block_is_of_a_known_language() -> None:
    """A block that is to be run but is written as another language would pass unseen."""
    for page in PAGES:
        fences = [line for line in page.read_text().splitlines() if line.startswith("```") and line != "```"]
        directives = [line for line in fences if line.startswith("```{")]
        page_blocks = blocks(page)
        assert len(page_blocks) == len(fences) - len(directives), page_name(page)
        assert {block.language for block in page_blocks} <= SHOWN, page_name(page)
        for block in page_blocks:
            if block.language == "toml":
                tomllib.loads(block.code)


def test_the_robot_on_the_page_of_files_is_one(tmp_path: Path) -> None:
    robot = next(block for block in blocks(DOCS / "reference" / "files.md") if block.language == "toml")
    file = tmp_path / "robot.toml"
    file.write_text(robot.code.replace("# [effects]", "[effects]").replace("# end_", "end_"))
    assert load_robot(file).tails == 2
    assert load_robot(file).effects == {"end_over_end_drag": 5.0}
