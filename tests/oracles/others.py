"""Tables that others published, their models in docs/models, and what is known about them from elsewhere."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import softflagella as sf
from calibration.own_model.model_file import load_model

MODELS = Path(__file__).parents[2] / "docs/models"


class Published(NamedTuple):
    """A published table, its model, and what is known about it from elsewhere."""

    title: str
    table: str
    model: str
    session: str | None
    withheld: str
    known: str  # from theory, or from another instrument
    trace: str | None = None  # column with the traces of readings
    specimen: str | None = None
    held_out: str | None = None  # session, or column


SETS = {
    "tube-2017": Published(
        "balls in a tube, 2017", "tube-2017.csv", "tube.py", "repeat", "wall, inertia", "both: 1"
    ),
    "tube-2019": Published(
        "balls in a tube, 2019", "tube-2019.csv", "tube.py", "repeat", "wall, inertia", "capillary: 0.1946 Pa s"
    ),
    "propellers": Published("thrust of propellers", "propellers.csv", "propeller.py", "test", "square", "1"),
    "motor": Published(
        "speed of a motor", "propellers.csv", "motor.py", "test", "dead zone, resistance", "2600 rpm/V"
    ),
    "ship": Published("side force on a ship", "", "ship.py", None, "cross-flow drag", ""),
    "coil": Published(
        "current in a coil", "coil.csv", "coil.py", None, "resistance, zero", "1.2 Ω; zero 0 ± 0.02 A"
    ),
    "tower": Published(
        "falls from a tower, simulated",
        "tower.csv",
        "tower.py",
        "ball_kg_m3",
        "drag of a sphere",
        "C_D 0.4 to 0.5",
    ),
    "phonefall": Published(
        "fall of a telephone",
        "phonefall.csv",
        "phonefall.py",
        None,
        "turbulent drag",
        "square: 1",
        "trace",
        held_out="third",
    ),
    "balldrop": Published(
        "balls from a bridge",
        "balldrop.csv",
        "balldrop.py",
        None,
        "drag of a sphere",
        "C_D 0.4 to 0.5",
        "trace",
        "ball",
        "second",
    ),
    "shiproll": Published(
        "roll of a ship",
        "shiproll.csv",
        "shiproll.py",
        None,
        "eddies, stiffening",
        "stiffening 0.75 per rad²",
        "test",
        held_out="21338",
    ),
    "tanks": Published(
        "two tanks", "tanks.csv", "tanks.py", None, "overflow of both", "both overflow", "record", held_out="val"
    ),
    "filmcan": Published("water in a film can", "", "filmcan.py", None, "heat of the can", "10 J/K", "trace"),
}


def calibrated(name: str, table: str | Path | None = None, *, progress: bool = False) -> sf.ModelVerdict:
    """Calibrate one of SETS; a table that is not in the project is given."""
    measured = SETS[name]
    model, rows = load_model(MODELS / measured.model, table or MODELS / "data" / measured.table)
    return sf.calibrate(
        rows, model, session=measured.session, specimen=measured.specimen, trace=measured.trace,
        held_out=measured.held_out, progress=progress,
    )  # fmt: skip


def named(record: dict[str, Any]) -> str:
    """Say what a verdict names, in the order in which it was found, and the forms that would do as well."""
    found = [turn["named"] for turn in record["turns"] if turn["named"]] or [c["title"] for c in record["claims"]]
    if not found:
        return "nothing"
    forms = [form["title"] for form in record["forms"]]
    at_theory = record["nearest"] and record["nearest"]["at_theory"]
    best = next((title for title in forms if at_theory and "theory" in title), found[-1])
    others = [title for title in forms if title != best]
    return ", then ".join((*found[:-1], best)) + (f" (or {', '.join(others)})" if others else "")
