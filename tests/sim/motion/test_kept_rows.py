"""A table of robots whose simulation ends early: what is done is kept, and the same command goes on."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from common.errors import run_command
from common.journal import journal
from sim.__main__ import main
from sim.model.presets import PRESETS
from sim.motion import batches
from tests.processes import ROOT, until

DIES = """
import os, sys
from common.journal import Journal
add, count = Journal.add, 0
def dies(*given):
    global count
    add(*given)
    count += 1
    if count == 2: os.kill(os.getpid(), 9)
Journal.add = dies
from sim.__main__ import main
main(sys.argv[1:])
"""


@pytest.fixture
def table(tmp_path: Path) -> Path:
    robots = pd.DataFrame([PRESETS["paper-control"].group_values()] * 530)
    robots["omega_bar"] = np.linspace(3.0, 9.0, len(robots))
    robots["N"] = 2 + np.arange(len(robots)) % 2
    robots.to_csv(tmp_path / "robots.csv", index=False)
    return tmp_path


def test_after_a_kill_the_same_command_goes_on_and_writes_the_same(
    table: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    words = ["steady", str(table / "robots.csv"), "--jobs", "1", "--out"]
    assert run_command(main, [*words, str(table / "whole.csv")]) == 0
    out, kept = table / "motion.csv", table / "motion.csv.journal"
    process = subprocess.Popen([sys.executable, "-c", DIES, *words, str(out)], cwd=ROOT)
    until(lambda: process.poll() is not None)
    assert process.returncode == -9
    assert not out.exists()
    with open(kept, "ab") as file:
        file.write(b'0123456789a [2, {"v_z": [0.1')  # the kill came while a line was written
    capsys.readouterr()

    assert run_command(main, [*words, str(out), "--no-stability"]) == 2  # other columns
    said = capsys.readouterr().err
    assert "is of other robots, options or code" in said
    assert not out.exists()

    simulated: list[int] = []
    direct = batches.steady
    monkeypatch.setattr(
        batches, "steady", lambda groups, **k: simulated.append(len(groups)) or direct(groups, **k)
    )
    assert run_command(main, [*words, str(out)]) == 0
    assert f"goes on with the rows that are kept in {kept}" in capsys.readouterr().err
    assert 0 < sum(simulated) < 530 - 100
    assert out.read_bytes() == (table / "whole.csv").read_bytes()
    assert sorted(file.name for file in table.iterdir()) == ["motion.csv", "robots.csv", "whole.csv"]


def test_a_journal_is_written_by_one_process_and_replaces_no_other_file(
    table: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = table / "motion.csv"
    words = ["steady", str(table / "robots.csv"), "--out", str(out)]
    path = table / "motion.csv.journal"
    for content in ("a diary", "a diary\nof a week\n"):
        path.write_text(content)
        assert run_command(main, words) == 2
        assert "give another --out, or remove it" in capsys.readouterr().err
        assert path.read_text() == content
    path.unlink()
    os.mkfifo(path)
    assert run_command(main, words) == 2
    assert f"cannot write {path}" in capsys.readouterr().err
    path.unlink()
    assert run_command(main, [*words[:-1], str(table), "--jobs", "0"]) == 2
    assert "is a folder; give the name of a file" in capsys.readouterr().err  # before anything is simulated
    assert run_command(main, [*words, "--jobs", "0"]) == 2
    assert "jobs = 0" in capsys.readouterr().err
    assert not path.exists()
    with journal(path, "key"):
        assert run_command(main, words) == 2
        assert "another process" in capsys.readouterr().err
    assert not path.exists()
    assert not out.exists()
