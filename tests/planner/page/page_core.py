"""The page's core, run by node: functions of `planner/page/*.js` answer in the same test run as Python's."""

from __future__ import annotations

import base64
import json
import os
import shutil
import subprocess
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from planner.paths.path import Path2D
from sim.io.errors import InputError
from tests.processes import LIMIT

FOLDER = Path(__file__).parents[3] / "planner" / "page"
TABLE = "@table"
EXACT = 1e-9  # allowed difference of lengths, times and angles


def node() -> str:
    """Return the program that runs JavaScript; without one the test is skipped, but it fails where CI = true."""
    program = shutil.which("node")
    if program is None:
        if os.environ.get("CI") == "true":
            pytest.fail("no node on this machine: the page's core is not tested")
        pytest.skip("no node on this machine")
    return program


def answers(calls: Sequence[tuple[Any, ...]], table: str | None = None, left_out: Sequence[str] = ()) -> list[Any]:
    """Call functions of the core, each (file, function, arguments …); a refusal is returned as an InputError.

    Args:
        calls: the argument TABLE stands for the look-up table.
        table: the table, as `planner.page.table_data` writes it.
        left_out: names of what need not come back.
    """
    content = {
        "folder": str(FOLDER),
        "calls": [[file, name, given] for file, name, *given in calls],
        "table": table,
        "leftOut": list(left_out),
    }
    script = Path(__file__).with_name("call.mjs")
    process = subprocess.run(
        [node(), str(script)],
        input=json.dumps(content, default=_plain, allow_nan=False),
        capture_output=True,
        text=True,
        timeout=LIMIT,
        encoding="utf-8",
    )
    assert process.returncode == 0, process.stderr
    return [
        InputError(entry["refusal"]) if "refusal" in entry else entry.get("answer")
        for entry in json.loads(process.stdout, object_hook=_number)
    ]


def call(file: str, name: str, *given: Any) -> dict[str, Any]:
    """Return what stands for the answer of another call, among arguments."""
    return {"call": [file, name, given]}


def typed(numbers: np.ndarray) -> dict[str, str]:
    """Return what stands for a typed array, among arguments."""
    return {"floats": base64.b64encode(np.ascontiguousarray(numbers, dtype=float).tobytes()).decode()}


def answer(file: str, name: str, *given: Any) -> Any:
    """Call one function of the core."""
    return answers([(file, name, *given)])[0]


def refusal_of(function: Callable[..., object], *given: Any, **options: Any) -> str:
    """Return the message with which Python refuses."""
    with pytest.raises(InputError) as refusal:
        function(*given, **options)
    return str(refusal.value)


def without_digits(message: object) -> str:
    """Leave numbers out of a message."""
    return "".join("#" if letter.isdigit() else letter for letter in str(message))


def check_near(found: Any, wanted: Any, allowed: float = EXACT) -> None:
    """Assert that numbers of any shape differ by at most `allowed`."""
    found, wanted = np.asarray(found, dtype=float), np.asarray(wanted, dtype=float)
    assert found.shape == wanted.shape
    assert np.array_equal(np.isfinite(found), np.isfinite(wanted))
    finite = np.isfinite(wanted)
    assert np.array_equal(found[~finite], wanted[~finite], equal_nan=True)
    assert np.abs(found - wanted)[finite].max(initial=0.0) <= allowed


def path_to_page(path: Path2D) -> dict[str, Any]:
    """Write a path as the core has it."""
    return {"points": path.points.tolist(), "closed": path.closed}


def _plain(value: Any) -> Any:
    if isinstance(value, Path2D):
        return path_to_page(value)
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    raise TypeError(f"{value!r} cannot be sent to the core")


def _number(entry: dict[str, Any]) -> Any:
    """Read the numbers that JSON lacks, and typed arrays."""
    if list(entry) == ["floats"]:
        return np.frombuffer(base64.b64decode(entry["floats"])).tolist()
    return float(entry["number"]) if list(entry) == ["number"] else entry
