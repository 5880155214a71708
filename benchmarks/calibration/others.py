"""Measurements that others published, calibrated with the models of docs/models: what is named, errors held out.

One table in Markdown, for docs/explanation/found.md: what was withheld, what is named, and the error on runs that
were held out, before and after, by sessions and by conditions. SHIP.csv, which has no licence, is read if it is
given. With a PICTURE.png the errors are drawn.

Usage: python -m benchmarks others [PICTURE.png] [SHIP.csv]

Takes 30 seconds.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import matplotlib.pyplot as plt
import numpy as np

import softflagella as sf
from benchmarks.common import ROOT, heading, row
from calibration.own_model.model_file import load_model
from calibration.verdict.record import facts

MODELS = ROOT / "docs/models"
_ERRORS = ("error_before", "error_after")


class Measured(NamedTuple):
    """A published table, its model, and what is known about it from elsewhere."""

    title: str
    table: str
    model: str
    session: str | None
    withheld: str
    known: str


SETS = {
    "tube-2017": Measured("balls in a tube, 2017", "tube-2017.csv", "tube.py", "repeat", "wall, inertia", "theory: 1"),
    "tube-2019": Measured(
        "balls in a tube, 2019", "tube-2019.csv", "tube.py", "repeat", "wall, inertia", "capillary: 0.1946 Pa s"
    ),
    "tower": Measured("falls from a tower", "tower.csv", "tower.py", "ball_kg_m3", "drag", "C_D 0.4 to 0.5"),
    "propellers": Measured("thrust of propellers", "propellers.csv", "propeller.py", "test", "square", "theory: 1"),
    "motors": Measured("speed of motors", "propellers.csv", "motor.py", "test", "dead zone, resistance", ""),
    "ship": Measured("side force on a ship", "", "ship.py", None, "cross-flow drag", "v abs(v), or v³"),
}


def calibrated(name: str, table: str | Path | None = None) -> sf.ModelVerdict:
    """Calibrate one of SETS; a table that is not in the project is given."""
    measured = SETS[name]
    model, rows = load_model(MODELS / measured.model, table or MODELS / "data" / measured.table)
    return sf.calibrate(rows, model, session=measured.session, progress=False)


def named(record: dict[str, Any]) -> str:
    """Say what a verdict names, in the order in which it was found, and what would do as well."""
    found = [turn["named"] for turn in record["turns"] if turn["named"]] or [c["title"] for c in record["claims"]]
    size = " at the size of theory" if (record["nearest"] or {}).get("at_theory") else ""
    others = [f["title"] for f in record["forms"] if (f["title"] != found[-1] or size) and not f["title"].startswith(found[-1] + size)]
    return ", then ".join(found) + size + (f"; as well: {', '.join(others)}" if others else "")


def percent(verdict: sf.ModelVerdict, *errors: float) -> list[float]:
    """Return errors in per cent; of a difference, of the mean of what was measured."""
    output = next(iter(verdict.model.outputs.values()))
    mean = 1.0 if output.kind == "ratio" else float(np.abs(verdict.runs.y).mean())
    return [100 * error / mean for error in errors]


def main(picture: str = "", ship: str = "") -> None:
    """Print the table; draw the picture."""
    names = [name for name in SETS if ship or SETS[name].table]
    verdicts = {name: calibrated(name, None if SETS[name].table else ship) for name in names}
    print(heading("set", "withheld", "named", "held-out sessions, %", "conditions, %", "noise, %", "known"))
    drawn = {}
    for name, verdict in verdicts.items():
        record, measured = facts(verdict), SETS[name]
        of_conditions = record["errors_of_conditions"]
        errors = (*(record[e] for e in _ERRORS), of_conditions["before"], of_conditions["after"])
        drawn[name] = percent(verdict, *errors, record["noise_ceiling"] if verdict.runs.noise_known else np.nan)
        before, after, b, a, noise = (f"{value:.1f}" for value in drawn[name])
        print(row(measured.title, measured.withheld, named(record), f"{before} → {after}", f"{b} → {a}",
                  noise if verdict.runs.noise_known else "unknown", measured.known))  # fmt: skip
    if picture:
        draw(drawn, picture)


def draw(drawn: dict[str, list[float]], picture: str) -> None:
    """Draw errors before and after, by sessions and by conditions, and the noise."""
    figure, axes = plt.subplots(figsize=(7.2, 0.55 * len(drawn) + 1.1), layout="constrained")
    for place, (before, after, *of_conditions, noise) in enumerate(drawn.values()):
        pairs = ((0.16, "C0", "sessions", before, after), (-0.16, "C1", "conditions", *of_conditions))
        for shift, colour, what, one, other in pairs:
            y = -place + shift
            axes.annotate("", (other, y), (one, y), arrowprops={"arrowstyle": "-|>", "color": colour, "lw": 1.5})
            axes.plot(one, y, "o", color=colour, ms=5, label=f"held-out {what}" if not place else None)
        axes.plot([noise] * 2, [-place - 0.32, -place + 0.32], "k", lw=1.5, label=None if place else "noise of a run")
    axes.set_xscale("log")
    axes.set_xticks([1, 2, 5, 10, 20, 50], ["1", "2", "5", "10", "20", "50"])
    axes.minorticks_off()
    axes.set_yticks(-np.arange(len(drawn)), [SETS[name].title for name in drawn])
    axes.set_xlabel("error, %: without what was withheld → with what is named")
    axes.grid(axis="x", alpha=0.3)
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, 1.16), ncols=3, frameon=False, fontsize="small")
    figure.savefig(picture, dpi=110)
