"""Tests of one group run in one process, so that what a module's tests share is made once."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from tests.conftest import without_group
from tests.processes import LIMIT

FILE = """
import os, pytest
pytestmark = pytest.mark.xdist_group("together")
@pytest.mark.parametrize("case", range(6))
def test_case(case):
    with open("workers.txt", "a") as file:
        file.write(os.environ["PYTEST_XDIST_WORKER"] + "\\n")
"""


def test_a_group_stays_in_one_process(tmp_path: Path) -> None:
    # pytest 9.2 ignored the groups of pytest-xdist 3.8: https://github.com/pytest-dev/pytest-xdist/issues/1386
    (tmp_path / "test_together.py").write_text(FILE)
    options = ["-q", "-n", "2", "--dist", "loadgroup", "-p", "no:cacheprovider"]
    result = subprocess.run(
        [sys.executable, "-m", "pytest", *options], cwd=tmp_path, capture_output=True, text=True, timeout=LIMIT
    )
    assert result.returncode == 0, result.stdout
    workers = (tmp_path / "workers.txt").read_text().split()
    assert len(workers) == 6
    assert len(set(workers)) == 1


@pytest.mark.parametrize("test", ["tests/a.py::test_b", "tests/a.py::test_b[c@d]", "tests/a.py::test_b[x]"])
@pytest.mark.parametrize("group", ["", "@tests/a.py", "@tests/a.py::test_b", "@one", "@tests/a.py::test_b[x]"])
def test_durations_are_noted_without_the_group(test: str, group: str) -> None:
    assert without_group(test + group) == test
