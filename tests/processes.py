"""Waiting for processes that tests start: each wait has a limit, and its failure says what was printed."""

from __future__ import annotations

import subprocess
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]
LIMIT = 1800.0  # s; far more than any wait takes on a busy machine


def until(
    true: Callable[[], Any], process: subprocess.Popen[Any] | None = None, *, log: Path | None = None
) -> None:
    """Wait for a condition, as long as `process` runs; `log` is quoted if the condition does not come true."""
    end = time.monotonic() + LIMIT
    while not true():
        assert process is None or process.poll() is None, printed(process)
        assert time.monotonic() < end, f"nothing in {LIMIT:.0f} s\n{log.read_text() if log else ''}"
        time.sleep(0.05)


def printed(process: subprocess.Popen[Any]) -> tuple[Any, Any]:
    """Wait for the end of a process, and return what it wrote to its output and to its errors."""
    try:
        return process.communicate(timeout=LIMIT)
    except subprocess.TimeoutExpired as error:
        process.kill()
        words: object = error.output
        with suppress(subprocess.TimeoutExpired):  # processes of its own may hold the pipes
            words = process.communicate(timeout=10)
        raise AssertionError(f"still running after {LIMIT:.0f} s: {words}") from None


def alive(process: int) -> bool:
    """Say whether a process of this number runs."""
    try:
        return Path(f"/proc/{process}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except FileNotFoundError:
        return False
