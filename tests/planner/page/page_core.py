"""The page's core, run by node: functions of `planner/page/*.js` answer and refuse as Python's do."""

from __future__ import annotations

import base64
import json
import os
import re
import shutil
import subprocess
from collections.abc import Callable, Iterable, Sequence
from dataclasses import fields, is_dataclass
from functools import cache
from pathlib import Path
from threading import Timer
from typing import Any
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

import numpy as np
import pytest

from common.errors import InputError
from planner.page.constants import constants_module
from planner.page.first_state import robot_fields, vehicle_fields
from planner.page.write_page import table_data
from planner.paths.tractrix import Reference
from planner.planning.plan import Plan
from planner.vehicle.measured import MeasuredVehicle
from planner.vehicle.tracked_point import TrackedVehicle
from planner.vehicle.vehicle import Vehicle
from sim.model.robot import Robot
from surrogate.table_file import load
from tests.processes import LIMIT
from tests.shared import FOLDER as SESSION
from tests.shared import shared

FOLDER = Path(__file__).parents[3] / "planner" / "page"
TABLE = "@table"
EXACT = 1e-9  # allowed difference of lengths, times and angles
ERRORS = ("predicted_rms", "predicted_max", "drawn_rms", "drawn_max", "stated", "guaranteed", "closure",
          "table_share")  # fmt: skip


def node() -> str:
    """Return the program that runs JavaScript; without one the test is skipped, but it fails where CI = true."""
    program = shutil.which("node")
    if program is None:
        if os.environ.get("CI") == "true":
            pytest.fail("no node on this machine: the page's core is not tested")
        pytest.skip("no node on this machine")
    return program


@shared
def _table_file() -> Path:
    """Write the shipped look-up table as the page has it."""
    path = SESSION / "table.json"
    path.write_text(json.dumps(table_data(load())))
    return path


@shared
def _core_folder() -> Path:
    """Copy the core, with the constants that Python writes."""
    folder = SESSION / "core"
    shutil.copytree(FOLDER, folder, ignore=shutil.ignore_patterns("*.py", "__pycache__"))
    (folder / "constants.js").write_text(constants_module())
    return folder


@cache
def _core() -> subprocess.Popen[str]:
    """Start the core; it ends with its input."""
    words = [node(), str(Path(__file__).with_name("call.mjs")), str(_core_folder()), str(_table_file())]
    return subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, encoding="utf-8")


def stop_core() -> None:
    """End the core, if it runs."""
    if _core.cache_info().currsize:
        _core().communicate(timeout=LIMIT)
        _core.cache_clear()


def answers(calls: Iterable[tuple[Any, ...]], left_out: Sequence[str] = ()) -> list[Any]:
    """Call functions of the core, each (file, function, arguments …); a refusal is returned as an InputError.

    Args:
        calls: the argument TABLE stands for the look-up table.
        left_out: names of what need not come back.
    """
    content = {"calls": [[file, name, to_page(given)] for file, name, *given in calls], "leftOut": list(left_out)}
    process = _core()
    assert process.stdin is not None
    assert process.stdout is not None
    process.stdin.write(json.dumps(content, allow_nan=False) + "\n")
    process.stdin.flush()
    patience = Timer(LIMIT, process.kill)
    patience.daemon = True
    patience.start()
    line = process.stdout.readline()
    patience.cancel()
    entries = json.loads(line, object_hook=_number)
    broken = [entry["broken"] for entry in entries if "broken" in entry]
    assert broken == [], broken
    return [InputError(entry["refusal"]) if "refusal" in entry else entry.get("answer") for entry in entries]


def answer(file: str, name: str, *given: Any) -> Any:
    """Call one function of the core."""
    return answers([(file, name, *given)])[0]


def call(file: str, name: str, *given: Any) -> dict[str, Any]:
    """Return what stands for the answer of another call, among arguments."""
    return {"call": [file, name, given]}


def page_options(options: dict[str, Any]) -> dict[str, Any]:
    """Return options of a request with the names that they have in the page."""
    return _named(options)


def opened(name: str, text: str | bytes) -> Any:
    """Open a file in the page."""
    content = text.encode() if isinstance(text, str) else text
    tree = drawing_tree(content) if name.endswith(".svg") else None
    return answer("open_file.js", "openFile", {"name": name, "bytes": content, "tree": tree})


def drawing_tree(text: str | bytes) -> dict[str, Any]:
    """Return the elements of a drawing as the page's view gives them to the core."""

    def tree(element: Element) -> dict[str, Any]:
        own = (element.text or "") + "".join(child.tail or "" for child in element)
        return {
            "tag": element.tag,
            "attributes": dict(element.attrib),
            "text": own,
            "children": list(map(tree, element)),
        }

    return tree(ElementTree.fromstring(text))


def _number(entry: dict[str, Any]) -> Any:
    """Read the numbers that JSON lacks, and typed arrays."""
    if list(entry) == ["floats"]:
        return np.frombuffer(base64.b64decode(entry["floats"])).tolist()
    return float(entry["number"]) if list(entry) == ["number"] else entry


def typed(numbers: np.ndarray) -> dict[str, str]:
    """Return what stands for a typed array, among arguments."""
    return {"floats": base64.b64encode(np.ascontiguousarray(numbers, dtype=float).tobytes()).decode()}


def to_page(value: Any) -> Any:
    """Write a value as the core has it: names in camel case, tables of vehicles flat."""
    if isinstance(value, dict):
        return {name: to_page(part) for name, part in value.items()}
    if isinstance(value, Robot):
        own = {"timeScale": value.time_scale, "omegaBar": value.omega_bar, "sigmas": _named(value.sigmas)}
        return to_page({**robot_fields(value), **own})
    if isinstance(value, MeasuredVehicle):
        return to_page(vehicle_fields(value))
    if isinstance(value, Vehicle):
        tables = {name: list(map(typed, getattr(value, name))) for name in ("lag", "rest", "spread")}
        modes = [{"name": mode.name, "twist": mode.twist, "current": mode.current,
                  "lag": None if mode.lag is None else list(map(typed, mode.lag))}
                 for mode in value.modes]  # fmt: skip
        return to_page({**_parts(value), **tables, "modes": modes})
    if isinstance(value, TrackedVehicle):
        more = {"warnings": value.warnings, "calibrated": value.calibrated}
        return to_page({**_named(value._asdict()), **more, "unmeasured": []})
    if isinstance(value, Reference):
        return to_page({**_parts(value), "arc": value.arc, "curvature": value.curvature})
    if isinstance(value, Plan):
        errors = _named({name: getattr(value.errors, name) for name in ERRORS})
        own = {"errors": errors | {"feedback": value.feedback_error}, "unmeasured": value.unmeasured_error,
               "objective": value.request.objective}  # fmt: skip
        return to_page({**_parts(value), **own})
    if hasattr(value, "_asdict"):
        return to_page(_named(value._asdict()))
    if is_dataclass(value):
        return to_page(_parts(value))
    if isinstance(value, np.ndarray | np.generic):
        return to_page(value.tolist())
    if isinstance(value, bytes):
        return list(value)
    if isinstance(value, list | tuple):
        return [to_page(part) for part in value]
    if isinstance(value, float) and not np.isfinite(value):
        return {"number": str(value).replace("inf", "Infinity").replace("nan", "NaN")}
    return value


def _parts(value: Any) -> dict[str, Any]:
    return _named({field.name: getattr(value, field.name) for field in fields(value)})


def _named(parts: dict[str, Any]) -> dict[str, Any]:
    return {re.sub(r"_([a-z])", lambda match: match[1].upper(), name) if not name.startswith("C_") else name: part
            for name, part in parts.items()}  # fmt: skip


def check_near(found: Any, wanted: Any, allowed: float = EXACT) -> None:
    """Assert that numbers of any shape differ by at most `allowed`; a flat table has the numbers of any other."""
    found, wanted = np.asarray(found, dtype=float), np.asarray(wanted, dtype=float)
    assert found.shape in (wanted.shape, (wanted.size,))
    found = found.reshape(wanted.shape)
    assert np.array_equal(np.isfinite(found), np.isfinite(wanted))
    finite = np.isfinite(wanted)
    assert np.array_equal(found[~finite], wanted[~finite], equal_nan=True)
    assert np.abs(found[finite] - wanted[finite]).max(initial=0.0) <= allowed


def refusal_of(function: Callable[..., object], *given: Any, **options: Any) -> str:
    """Return the message with which Python refuses."""
    with pytest.raises(InputError) as refusal:
        function(*given, **options)
    return str(refusal.value)


def without_digits(message: object) -> str:
    """Leave numbers out of a message."""
    return re.sub(r"\d", "#", str(message))


def check_alike(found: Any, wanted: Any, allowed: float) -> None:
    """Assert that numbers are alike relative to the largest one of each column, the last axis."""
    columns = np.asarray(wanted, dtype=float).reshape(-1, np.shape(wanted)[-1])
    sizes = np.abs(columns).max(0)
    sizes[sizes == 0] = 1.0
    check_near(np.reshape(found, columns.shape) / sizes, columns / sizes, allowed)


def check_header(found: str, wanted: str, allowed: float) -> None:
    """Assert that two headers in C differ by rounding alone; the last bits of products are the processor's."""
    number = re.compile(r"(?<![\w.])-?\d+\.?\d*(?:e[-+]?\d+)?(?![\w.])")
    assert number.sub("#", found).splitlines() == number.sub("#", wanted).splitlines()
    numbers = (np.array([float(word) for word in number.findall(text)]) for text in (found, wanted))
    np.testing.assert_allclose(*numbers, rtol=allowed, atol=allowed)
    assert "@" not in found
