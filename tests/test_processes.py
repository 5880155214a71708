"""No test waits without a limit."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import tests.processes
from tests.processes import printed, until

FILES = sorted(Path(__file__).parent.rglob("*.py"))


def without_limit(call: ast.Call) -> bool:
    """Tell whether a call waits for a process without saying how long."""
    if not isinstance(call.func, ast.Attribute):
        return False
    started = isinstance(call.func.value, ast.Name) and call.func.value.id == "subprocess"
    waits = call.func.attr in {"communicate", "wait"} or (started and call.func.attr in {"run", "check_output"})
    return waits and "timeout" not in {keyword.arg for keyword in call.keywords}


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.relative_to(FILES[0].parents[1]).as_posix())
def test_every_wait_has_a_limit(file: Path) -> None:
    calls = [node for node in ast.walk(ast.parse(file.read_text())) if isinstance(node, ast.Call)]
    assert [call.lineno for call in calls if without_limit(call)] == []


def test_a_wait_that_is_too_long_fails_with_the_log(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tests.processes, "LIMIT", 0.3)
    (tmp_path / "log").write_text("no room left")
    with pytest.raises(AssertionError, match="no room left"):
        until(lambda: False, log=tmp_path / "log")
    sleeper = [sys.executable, "-c", "import time; print('asleep', flush=True); time.sleep(60)"]
    process = subprocess.Popen(sleeper, text=True, stdout=subprocess.PIPE)
    with pytest.raises(AssertionError, match="still running"):
        printed(process)
    assert process.poll() is not None
