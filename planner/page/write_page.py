"""Write the page that plans: markup, style, the planner, and its data in one file without connections.

The numbers of a look-up table are text in the page: lossless, and as small as they get.

    {"identity": hash, "content": the content of a model file, "numbers": text}

Arrays are replaced by {"tensor": shape, "at": place of the first number}. All numbers stand one behind the other
in double precision: first the lowest bytes of all, then the next ones, since only the highest bytes are alike.
They are deflated and written in base 85, with letters that mean nothing in HTML and JSON. `data.js` reads this.
The shipped table takes 1.3 MB; in base 64 it would be 90 kB more. A measured vehicle needs none.
"""

from __future__ import annotations

import base64
import hashlib
import html
import json
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import replace
from os import PathLike
from pathlib import Path
from typing import Any, NamedTuple, Unpack

import numpy as np
from numpy.typing import ArrayLike

from common.arrays import Floats
from common.errors import naming
from common.files import write_text
from common.keywords import checks_keywords
from common.provenance import __version__, code_version
from planner.files.headers import schedule_template
from planner.options import CornerOptions, Length, asked, length_of, request_of, swimmer_of, table_of
from planner.page.bundle import FOLDER, joined
from planner.page.first_state import NamedPath, first_options, first_plan, robots_of, shapes_of, slider_ends
from planner.paths.path import Path2D, circle, shape_of
from planner.paths.path_files import read_path
from planner.planning.request import PlanRequest
from planner.vehicle.from_table import both_directions
from planner.vehicle.measured import MeasuredVehicle
from planner.vehicle.tracked_point import TrackedVehicle, tracked_vehicle
from planner.vehicle.vehicle import Mode
from sim.knowledge import CalibrationKnowledge
from sim.model.robot import Robot
from sim.robot_rows import OneRobot, one_robot
from surrogate.interface import LookupTable
from surrogate.table import NeuralTable, table_content

_LETTERS = str.maketrans("<>&`", ",.:/")  # of RFC 1924, which HTML or a template of JavaScript would read
TITLE = "Plan a path for a soft robot"
_VEHICLE_TITLE = "Plan a path for a vehicle"
_MEASURED = "These numbers were measured; the page plans for this vehicle alone."
_VIEW = FOLDER / "view"


def table_data(lookup: NeuralTable) -> dict[str, Any]:
    """Return the numbers of a table as JSON can hold them."""
    content = {name: part for name, part in table_content(lookup).items() if name != "provenance"}
    return packed_data({"identity": lookup.identity, "content": content})


def packed_data(content: Mapping[str, Any]) -> dict[str, Any]:
    """Return nested dictionaries and lists of arrays and plain values as JSON can hold them."""
    arrays: list[Floats] = []
    plain = _without_arrays(content, arrays)
    numbers = np.concatenate([array.ravel() for array in arrays]) if arrays else np.empty(0)
    by_place = numbers.astype("<f8").view(np.uint8).reshape(-1, 8).T.tobytes()
    return {**plain, "numbers": packed_bytes(by_place)}


def packed_bytes(content: bytes) -> str:
    """Return bytes deflated, in base 85."""
    return base64.b85encode(zlib.compress(content, 9)).decode().translate(_LETTERS)


def _without_arrays(part: Any, arrays: list[Floats]) -> Any:
    """Return `part` as JSON can hold it; its arrays are appended to `arrays`."""
    if isinstance(part, np.ndarray):
        at = sum(array.size for array in arrays)
        arrays.append(np.asarray(part, dtype=float))
        return {"tensor": list(part.shape), "at": at}
    if isinstance(part, Mapping):
        return {name: _without_arrays(value, arrays) for name, value in part.items()}
    if isinstance(part, list | tuple):
        return [_without_arrays(value, arrays) for value in part]
    return part


@checks_keywords
def write_page(
    path: str | Path,
    robot: OneRobot | MeasuredVehicle = "paper-control",
    *,
    paths: Mapping[str, Path2D | ArrayLike] | Sequence[str] = (),
    smooth: Length | None = None,
    title: str | None = None,
    **options: Unpack[CornerOptions],
) -> Path:
    """Write one HTML file in which a path is drawn and planned, without a server or a network.

    Args:
        path: the file.
        robot: robot.toml or the name of a preset, that the page begins with, or the vehicle.toml of a measured
            vehicle. Vehicles, and robots with effects or a calibration, cannot be changed in the page. In Python
            also the robot or the vehicle.
        paths: a path that the page offers: a file, or a shape such as circle:20cm; the first one is planned when
            the page opens. In Python also points (n, 2) or a Path2D by name, in tail lengths l.
        smooth: LENGTH, smooth drawn strokes over this length, such as 1cm.
        title: of the page.
        options: of the first plan, see `CornerOptions`.

    Raises:
        InputError: the table does not know the robot, an option cannot be, or the file cannot be written.

    Example:
        >>> import tempfile
        >>> import softflagella as sf
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     page = sf.write_page(f"{folder}/page.html", paths={"my circle": sf.circle(2.0)})
        ...     0.5e6 < page.stat().st_size < 1.6e6
        True
    """
    swims = swimmer_of(robot if isinstance(robot, MeasuredVehicle | str | PathLike) else one_robot(robot))
    unit = options.get("unit")
    named = []
    if isinstance(paths, Mapping):
        for name, each in paths.items():
            drawn = each if isinstance(each, Path2D) else Path2D.of(each)
            named.append(NamedPath(name, drawn.scaled(swims.length_scale)))
    else:
        for name in paths:
            with naming(name):
                drawn = read_path(name).in_tails(swims, unit)
            short = Path(name).stem if shape_of(name) is None else name
            named.append(NamedPath(short, drawn.scaled(swims.length_scale)))
    over = None if smooth is None else length_of(smooth, unit, swims, "--smooth")
    if isinstance(swims, MeasuredVehicle) or isinstance(robot, MeasuredVehicle):
        asks = _PageParts(*asked(swims, options), why=_MEASURED)
    else:
        asks = _parts_of_robot(robot, swims, options)
    tracked, request, why = asks.tracked, asks.request, asks.why
    # The page shows this plan until its own planner has made it.
    shapes = shapes_of(tracked.vehicle.turn_radius * swims.length_scale, named)
    first = named[0].path if named else circle(shapes[0]["size"] / 100)
    plan = first_plan(first.scaled(1 / swims.length_scale), tracked, request)
    data = {
        "robots": robots_of(swims)[: 1 if why else None],
        "limits": asks.limits,
        "shapes": shapes,
        "first": {
            "robot": swims.name,
            "shape": shapes[0]["name"],
            "options": first_options(request, swims, over),
            "plan": plan and packed_bytes(json.dumps(plan, separators=(",", ":"), allow_nan=False).encode()),
        },
        "locked": {"name": swims.name, "why": why} if why else None,
        "planner": {
            "table": asks.table,
            "files": {"codeVersion": code_version(), "schedule": schedule_template()},
        },
    }
    version = f"softflagella {__version__}"
    is_vehicle = isinstance(swims, MeasuredVehicle)
    whose = f"Vehicle {swims.name}" if is_vehicle else f"Robot {swims.name}. Look-up table {tracked.model}"
    footer = f"{version}, code {code_version()}. {whose}. The page computes in your browser and sends nothing."
    default = _VEHICLE_TITLE if is_vehicle else TITLE
    write_text(path, page_text(title or default, footer, data, version))
    return Path(path)


class _PageParts(NamedTuple):
    """What the page plans with, and what of it can be changed."""

    tracked: TrackedVehicle
    request: PlanRequest  # of the first plan
    why: str  # no other robot can be computed; empty: it can
    limits: Mapping[str, list[float]] = {}  # ends of the sliders of what can be changed
    table: dict[str, Any] | None = None  # numbers for the planner; None: a measured vehicle needs none


def _parts_of_robot(robot: OneRobot, swims: Robot, options: CornerOptions) -> _PageParts:
    """Ask the look-up table that knows a robot."""
    table, known = table_of(robot, swims, options)
    request = request_of(options, swims)
    tracked, why = tracked_vehicle(swims, table, request.point, known), _locked(swims, table, known)
    limits = {} if why else slider_ends(swims, table.domain)
    return _PageParts(tracked, request, why, limits, _planner_data(table, swims, tracked, why))


def _locked(robot: Robot, lookup: LookupTable, knowledge: CalibrationKnowledge) -> str:
    """Say why the page cannot compute another robot than this one; empty: it can."""
    if robot.effects:
        return f"This robot has effects ({', '.join(robot.effects)}), which the page does not compute anew."
    if knowledge.names or any(knowledge.current):
        return "A calibration has measured this robot; the page has its vehicle, and computes no other."
    if not isinstance(lookup, NeuralTable):
        return "The look-up table is of this robot alone, so the page computes no other."
    if lookup.intervals is None or lookup.curve_errors is None:
        return "The look-up table states one error for all robots, which the page does not compute anew."
    return ""


def _shorter(mode: Mode) -> Mode:
    """Round the lags of a mode to four bits, which changes the stated error by less than a per cent."""
    if mode.lag is None:
        return mode
    bits, exponent = np.frexp(mode.lag)
    return replace(mode, lag=np.ldexp(np.round(16 * bits) / 16, exponent))


def _mode_data(mode: Mode) -> dict[str, Any]:
    lag = None if mode.lag is None else list(mode.lag)
    return {"name": mode.name, "twist": mode.twist.tolist(), "lag": lag, "current": mode.current.tolist()}


def _planner_data(lookup: LookupTable, robot: Robot, tracked: TrackedVehicle, why: str) -> dict[str, Any]:
    """Return the look-up table's numbers, or those of the vehicle alone, for the planner in JavaScript."""
    if not why and isinstance(lookup, NeuralTable):
        return table_data(lookup)
    vehicle, columns = tracked.vehicle, both_directions(robot.group_values())
    curves, errors = lookup.response(columns), lookup.error_modes(columns)
    content = {
        "identity": lookup.identity,
        "name": robot.name,
        "ownTable": tracked.own_table,
        "calibrated": tracked.calibrated,
        "groups": robot.group_values(),
        "unmeasured": [_mode_data(_shorter(mode)) for mode in tracked.unmeasured],
        "vehicle": {
            "twist": vehicle.twist.tolist(),
            "curves": [
                {name: getattr(curves, name)[i] for name in ("lag", "memory", "rest", "spread")} for i in (0, 1)
            ],
            "before": curves.before,
            "phaseRate": vehicle.phase_rate.tolist(),
            # A steady error has no curves, and tables of zeros need not be on the page.
            "errors": [
                {"twist": twist.tolist(), "lag": lag, "memory": memory}
                if lag.any() or memory.any()
                else {"twist": twist.tolist(), "lag": None, "memory": None}
                for twist, lag, memory in zip(errors.twist, errors.lag, errors.memory, strict=True)
            ],
            "modes": [_mode_data(mode) for mode in vehicle.modes if not mode.name.startswith("table: ")],
            "current": vehicle.current.tolist(),
            "tailGap": vehicle.tail_gap,
            "leastGap": vehicle.least_gap,
        },
    }
    return packed_data(content)


def page_text(title: str, footer: str, data: dict[str, Any], generator: str) -> str:
    """Put the page together.

    Args:
        title: of the page.
        footer: what it is made of.
        data: what the page begins with; JSON.
        generator: the program and its version.
    """
    style = (_VIEW / "page.css").read_text()
    script = _closed(joined("view/main.js"))
    parts = {
        "@POLICY@": _policy(script, style),
        "@GENERATOR@": html.escape(generator),
        "@TITLE@": html.escape(title),
        "@STYLE@": style,
        "@FOOTER@": html.escape(footer),
        "@DATA@": _closed(json.dumps(data, sort_keys=True, separators=(",", ":"), allow_nan=False)),
        "@PLANNER@": packed_bytes(joined("worker.js").encode()),
        "@PAGE@": script,
    }
    text = (_VIEW / "page.html").read_text()
    pieces: list[str] = []
    while text:  # a part is not searched for the marks of others
        marks = [(text.index(mark), mark) for mark in parts if mark in text]
        if not marks:
            break
        at, mark = min(marks)
        pieces += [text[:at], parts[mark]]
        text = text[at + len(mark) :]
    return "".join([*pieces, text])


def _closed(script: str) -> str:
    """Write a script so that the page's markup does not end it."""
    return script.replace("</", "<\\/").replace("<!--", "<\\!--")


def _policy(script: str, style: str) -> str:
    """Allow this script, this style and a worker from a text of the page, and no connection."""
    return (
        f"default-src 'none'; script-src {_digest(script)} blob:; worker-src blob:; style-src {_digest(style)}; "
        "base-uri 'none'; form-action 'none'"
    )


def _digest(text: str) -> str:
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"
