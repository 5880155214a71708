"""Tables that others published, their models in docs/models, and what is known about them from elsewhere.

Tables that are not in docs/models/data are read from a folder that is given; the model's docstring names their
source.
"""

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
    "ship": Published("side force on a ship", "ship_captive.csv", "ship.py", None, "cross-flow drag", ""),
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
    "filmcan": Published(
        "water in a film can", "filmcan.csv", "filmcan.py", None, "heat of the can", "10 J/K", "trace"
    ),
    "pipes": Published(
        "friction of pipes", "pipes.csv", "pipes.py", "series", "fall with Reynolds's number", "exponent 0.25"
    ),
    "steiner": Published(
        "body on a spiral spring", "steiner.csv", "steiner.py", "round", "theorem of Steiner", "1"
    ),
    "stormer": Published("Stormer's viscometer", "stormer.csv", "stormer.py", None, "friction", "2.2 g"),
    "puromycin": Published(
        "enzyme", "puromycin.csv", "puromycin.py", None, "saturation", "16 and 21 per ppm", specimen="state"
    ),
    "moseley": Published("X-rays of elements", "moseley.csv", "moseley.py", "group", "screening", "1 to 2"),
    "cars": Published("stopping cars", "cars.csv", "cars.py", None, "braking", "1/μ 1.4 to 3.3"),
    "spheredrag": Published("drag of spheres", "spheredrag.csv", "spheredrag.py", None, "inertia", "1"),
    "gyroscope": Published(
        "gyroscope", "gyroscope.csv", "gyroscope.py", "weights", "slowing of the rotor", "0.75 per 1000 s"
    ),
    "dnase": Published("assay", "dnase.csv", "dnase.py", "assay", "saturation", "0.20 to 0.26 ml/ng"),
    "silver": Published(
        "activated silver", "silver.csv", "silver.py", None, "second isotope", "half-life 24.6 s", "run"
    ),
    "coastdown": Published(
        "coasting car", "coastdown.csv", "coastdown.py", None, "drag of the air", "0.064 m², simulated", "run"
    ),
    "disk": Published("disk on springs", "disk.csv", "disk.py", None, "dry friction", "0.1 rad", "run"),
    "phonependulum": Published(
        "telephone as pendulum",
        "phonependulum.csv",
        "phonependulum.py",
        None,
        "sine of the angle",
        "1",
        "run",
        "pendulum",
    ),
    "barium": Published("barium-137m", "barium.csv", "barium.py", None, "nothing", "half-life 153.1 s", "run"),
}


def table_of(measured: Published, folder: str | Path = "") -> Path | None:
    """Find a table in the project, or else in a folder; None where it is in neither."""
    places = [MODELS / "data" / measured.table, *([Path(folder, measured.table)] if folder else [])]
    return next((place for place in places if place.exists()), None)


def calibrated(name: str, folder: str | Path = "", *, progress: bool = False) -> sf.ModelVerdict:
    """Calibrate one of SETS; a table that is not in the project is in a folder."""
    measured = SETS[name]
    table = table_of(measured, folder)
    assert table is not None
    model, rows = load_model(MODELS / measured.model, table)
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
