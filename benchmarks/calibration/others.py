"""Measurements that others published, calibrated with the models of docs/models: what is named, errors held out.

One table in Markdown, for docs/explanation/found.md: what was withheld, what is named, and the error on runs that
were held out, before and after, by sessions and by conditions. Then a table of traces, with errors on traces that
were held out, and the falls of 2019 with other laws of wall and inertia. Tables that are not in the project are
read from a FOLDER. With a PICTURE.png the errors of the first table are drawn.

Usage: python -m benchmarks others [PICTURE.png] [FOLDER]

Takes three minutes, with all tables ten.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from scipy.optimize import minimize_scalar

import softflagella as sf
from benchmarks.common import heading, row
from calibration.own_model.model_file import load_model
from tests.oracles.others import MODELS, SETS, calibrated, named, table_of

_ERRORS = ("error_before", "error_after")


def by_fits(columns: Mapping[str, Any], p: Mapping[str, float]) -> dict[str, Any]:
    """Compute speeds of falls in a tube [m/s], (n,), with laws fitted to experiments.

    Source: wall, Ladenburg (1907); inertia, Schiller and Naumann (1935).
    """
    d, fluid = columns["diameter_mm"] / 1e3, columns["rho_fluid_kg_m3"]
    stokes = (columns["rho_ball_kg_m3"] - fluid) * 9.81 * d**2 / (18 * p["viscosity"])
    v = slow = stokes / (1 + p["wall"] * 2.1 * columns["diameter_mm"] / columns["tube_mm"])
    for _ in range(60):
        reynolds = fluid * v * d / p["viscosity"]
        v = (v + slow / (1 + p["inertia"] * 0.15 * reynolds**0.687)) / 2
    return {"v": v / (1 + p["late"] * v / columns["distance_mm"] * 1e3)}


def of_theory(laws: Callable[..., Mapping[str, Any]], rows: Any) -> tuple[float, float]:
    """Fit the viscosity of falls whose wall and inertia have the sizes of theory; return it and the rms error."""

    def rms(log_viscosity: float) -> float:
        p = {"viscosity": math.exp(log_viscosity), "wall": 1.0, "inertia": 1.0, "late": 0.0}
        return float(np.sqrt(np.mean(np.log(laws(rows, p)["v"] / rows["v"]) ** 2)))

    best = minimize_scalar(rms, bounds=(math.log(0.05), math.log(1.0)), method="bounded")
    return math.exp(best.x), float(best.fun)


def compare_laws() -> None:
    """Print what the falls of 2019 say with series and with laws fitted to experiments."""
    model, rows = load_model(MODELS / "tube.py", MODELS / "data/tube-2019.csv")
    for title, laws in (("Faxén, Oseen", model.function), ("Ladenburg, Schiller and Naumann", by_fits)):
        viscosity, rms = of_theory(laws, rows)
        record = sf.calibrate(rows, replace(model, function=laws), session="repeat", progress=False).facts
        print(f"{title}: both at theory {viscosity:.4f} Pa s, {100 * rms:.1f} %; named {named(record)}")


def percent(verdict: sf.ModelVerdict, *errors: float) -> list[float]:
    """Return errors in per cent; of a difference, of the mean of what was measured."""
    output = next(iter(verdict.model.outputs.values()))
    mean = 1.0 if output.kind == "ratio" else float(np.abs(verdict.runs.y).mean())
    return [100 * error / mean for error in errors]


def print_traces(verdicts: Mapping[str, sf.ModelVerdict]) -> None:
    """Print the table of sets of traces, with errors in their units."""
    print(heading("traces", "withheld", "verdict", "named", "held-out traces", "noise", "numbers", "known"))
    for name, verdict in verdicts.items():
        record, measured = verdict.facts, SETS[name]
        unit = next(iter(verdict.model.outputs.values())).unit
        noise = f"{record['noise_ceiling']:.3g} {unit}" if verdict.runs.noise_known else "unknown"
        shared = [title for title, value in verdict.corrected.items() if not isinstance(value, Mapping)]
        print(row(
            measured.title, measured.withheld, verdict.verdict, named(record),
            f"{record['error_before']:.3g} → {record['error_after']:.3g} {unit}", noise,
            ", ".join(f"{title} {verdict.corrected[title]:.3g}" for title in shared), measured.known,
        ))  # fmt: skip


def main(picture: str = "", folder: str = "") -> None:
    """Print the tables; draw the picture."""
    names = [name for name in SETS if table_of(SETS[name], folder)]
    all_verdicts = {name: calibrated(name, folder) for name in names}
    verdicts = {name: verdict for name, verdict in all_verdicts.items() if SETS[name].trace is None}
    print(heading("set", "withheld", "named", "sessions, %", "conditions, %", "noise, %", "number", "known"))
    drawn = {}
    for name, verdict in verdicts.items():
        record, measured = verdict.facts, SETS[name]
        of_conditions = record["errors_of_conditions"]
        errors = (*(record[e] for e in _ERRORS), of_conditions["before"], of_conditions["after"])
        noise = record["noise_ceiling"] if verdict.runs.noise_known else np.nan
        drawn[name] = percent(verdict, *errors, noise)
        numbers = [
            f"{number['title']} {number['value']:.4g} ({number['interval'][0]:.4g} to {number['interval'][1]:.4g})"
            for number in record["parameters"].values()
        ]
        before, after, b, a, left = (f"{value:.1f}" for value in drawn[name])
        print(row(
            measured.title, measured.withheld, named(record), f"{before} → {after}", f"{b} → {a}",
            left if verdict.runs.noise_known else "unknown", ", ".join(numbers), measured.known,
        ))  # fmt: skip
    print_traces({name: verdict for name, verdict in all_verdicts.items() if name not in verdicts})
    compare_laws()
    if picture:
        draw(drawn, picture)


def draw(drawn: dict[str, list[float]], picture: str) -> None:
    """Draw errors before and after, by sessions and by conditions, and the noise."""
    figure, axes = plt.subplots(figsize=(7.2, 0.4 * len(drawn) + 1.1), layout="constrained")
    arrow = {"arrowstyle": "-|>", "lw": 1.5, "shrinkA": 0, "shrinkB": 0}
    for place, errors in enumerate(drawn.values()):
        for side, what in enumerate(("sessions", "conditions")):
            (before, after), y = errors[2 * side : 2 * side + 2], -place + (0.16, -0.16)[side]
            axes.annotate("", (after, y), (before, y), arrowprops={**arrow, "color": f"C{side}"})
            axes.plot(before, y, "o", color=f"C{side}", ms=5, label=None if place else f"held-out {what}")
        noise, label = errors[-1], None if place else "noise of a run, if known"
        axes.plot([noise] * 2, [-place - 0.32, -place + 0.32], "k", lw=1.5, label=label)
    axes.set_xscale("log")
    axes.set_xticks([0.5, 1, 2, 5, 10, 20, 50, 100], ["0.5", "1", "2", "5", "10", "20", "50", "100"])
    axes.set_xlim(0.9 * min(min(errors[:4]) for errors in drawn.values()))
    axes.set_ylim(0.6 - len(drawn), 0.6)
    axes.minorticks_off()
    axes.set_yticks(-np.arange(len(drawn)), [SETS[name].title for name in drawn])
    axes.set_xlabel("error, %: without what was withheld → with what is named")
    axes.grid(axis="x", alpha=0.3)
    figure.legend(loc="outside upper center", ncols=3, frameon=False, fontsize="small")
    figure.savefig(picture, dpi=110)
