"""Spheres settling in a vessel: another model for the calibration.

    v = Δρ g d²/(18 μ) × (1 − ε_w (2.104 x − 2.089 x³ + 0.948 x⁵)) / (1 + ε_i 3/16 Re),   x = d/D, Re = ρ v d/μ

Stokes's law with the viscosity μ as the one coefficient. Effects that it may lack: the wall of the vessel (Faxén;
ε_w = 1) and inertia (Oseen; ε_i = 1). With their names withheld, a law describes what is missing: drag ×
(d/d_m)^p, with d_m the geometric mean of the diameters. A table has one row for each fall: set, bead, diam_mm,
trial, v_mm_s. The first falls of all beads are one session, the second ones another, and so on.

Usage: python -m tests.oracles.spheres TABLE.csv [SET]
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from calibration.statistics.excluded import Excluded
from calibration.statistics.forward import secants
from calibration.statistics.statistical_model import Parameter, Parameters, Predict, Runs
from calibration.verdict.calibrate import calibrate
from calibration.verdict.verdict import Verdict
from common.arrays import Flags, Floats
from common.errors import InputError, run_command

GRAVITY, FLUID, BEAD = 9.81, 1260.0, 2200.0  # m/s², kg/m³ of glycerol and Teflon


_LAW = Parameter("drag_exponent", "drag by a power of the diameter", 0.0, (-3.0, 3.0), 0.2)


@dataclass(frozen=True)
class Spheres:
    """Settling speeds of spheres of diameter d [m]."""

    runs: Runs
    diameter: Floats  # (n,)
    vessel: float = 0.094  # inner diameter [m]
    coefficients: tuple[Parameter, ...] = (
        Parameter("viscosity", "viscosity", 1.0, (0.01, 100.0), 1.0, logarithmic=True, unit="Pa s"),
    )
    nuisances: tuple[Parameter, ...] = ()
    effects: tuple[Parameter, ...] = (
        Parameter("wall", "wall of the vessel", 0.0, (0.0, 2.0), 1.0, unit="Faxén's correction"),
        Parameter("inertia", "inertia of the fluid", 0.0, (0.0, 20.0), 1.0, unit="Oseen's correction"),
    )
    untestable: Mapping[str, str] = field(default_factory=dict)

    def predict(self, sets: Sequence[Parameters], *, title: str = "") -> Floats:
        """Compute ln v, (P, n, 1)."""
        return np.array([np.log(self.speed(p))[:, None] for p in sets])

    def speed(self, parameters: Parameters) -> Floats:
        """Compute settling speeds [m/s], (n,)."""
        d, viscosity = self.diameter, parameters["viscosity"]
        x = d / self.vessel
        stokes = (BEAD - FLUID) * GRAVITY * d**2 / (18 * viscosity)
        stokes = stokes * (1 - parameters.get("wall", 0.0) * (2.104 * x - 2.089 * x**3 + 0.948 * x**5))
        stokes = stokes * (d / np.exp(np.log(d).mean())) ** -parameters.get(_LAW.name, 0.0)
        slope = parameters.get("inertia", 0.0) * 3 / 16 * FLUID * d / viscosity  # of 1 + slope v
        return np.asarray(2 * stokes / (1 + np.sqrt(1 + 4 * slope * stokes)))

    def linearised(
        self, at: Parameters, along: Sequence[Parameter], *, title: str = "", quick: bool = False
    ) -> Predict:
        """Return the linear model, by differences."""
        return secants(self, at, along)

    def check(self, prediction: Floats) -> None:
        """Accept any speed: the viscosity is not known beforehand."""

    def possible(self) -> tuple[Spheres, list[dict[str, Any]]]:
        """Return beads of other diameters."""
        diameter = np.linspace(1.0, 12.0, 23) / 1000
        count = len(diameter)
        runs = replace(
            self.runs, y=np.zeros((count, 1)), weight=None, specimen=None, condition=np.arange(count),
            session=np.zeros(count, int),
            session_names=("next",), inputs=np.log(diameter)[:, None], rows=np.arange(count),
            excluded=(), caveats=(),
        )  # fmt: skip
        return replace(self, runs=runs, diameter=diameter), [
            {"d_mm": round(1000 * d, 2)} for d in diameter.tolist()
        ]

    def guess(self, start: dict[str, float], used: Flags) -> dict[str, float]:
        """Return the start as it is: the fit is linear in ln μ."""
        return start


def read_spheres(source: str | Path, name: str) -> Spheres:
    """Read one set of a table of falls.

    Raises:
        InputError: the table lacks a column, or the set has too few beads.
    """
    table = pd.read_csv(source, comment="#")
    for column in ("set", "bead", "diam_mm", "trial", "v_mm_s"):
        if column not in table:
            raise InputError(f"the table has no column {column!r}")
    part = table[table["set"] == name].reset_index(drop=True)
    bad = ~(np.isfinite(part["v_mm_s"]) & (part["v_mm_s"] > 0))
    aside = tuple(Excluded("no speed above 0", f"row {i + 1}") for i in np.flatnonzero(bad))
    part = part[~bad]
    beads, condition = np.unique(part["bead"].astype(str), return_inverse=True)
    rounds, session = np.unique(part["trial"].astype(int), return_inverse=True)
    if len(beads) < 4 or len(rounds) < 3:
        raise InputError(
            f"set {name!r} has {len(beads)} beads in {len(rounds)} rounds; at least 4 in 3 are needed"
        )
    diameter = part["diam_mm"].to_numpy(dtype=float) / 1000
    runs = Runs(
        outputs=("v",),
        y=np.log(part[["v_mm_s"]].to_numpy(dtype=float) / 1000),
        condition=condition,
        session=session,
        session_names=tuple(f"round {n}" for n in rounds),
        inputs=np.log(diameter)[:, None],
        input_names=("ln d",),
        rows=np.flatnonzero(~bad) + 1,
        excluded=aside,
        caveats=(),
    )
    return Spheres(runs, diameter)


def law_of_diameter(model: Spheres) -> str:
    """Describe what is missing by a power of the diameter, with the wall and inertia withheld."""
    verdict = calibrate(replace(model, effects=(_LAW,)), progress=False)
    if _LAW.name not in verdict.final.names:
        return "not described by a power of the diameter"
    power, (low, high) = verdict.final.parameters[_LAW.name], verdict.final.interval(_LAW.name)
    before, after = 100 * verdict.error_before, 100 * verdict.error_after
    errors = f"held out {verdict.split.names}: {before:.1f} % -> {after:.1f} %"
    return f"drag as d^{power:.2f} ({low:.2f} to {high:.2f}); {errors}"


def median_error(model: Spheres, verdict: Verdict, effects: Parameters) -> float:
    """Compute the relative rms of the beads' median speeds, the viscosity fitted to them, with given `effects`."""
    at = {**verdict.base.parameters, **effects}
    residual = model.runs.y[:, 0] - model.predict([at])[0, :, 0]
    medians = np.array([np.median(residual[model.runs.condition == c]) for c in np.unique(model.runs.condition)])
    return float((medians - medians.mean()).std())


def main(table: str, name: str = "KW2023") -> None:
    model = read_spheres(table, name)
    verdict = calibrate(model, progress=False)
    print(f"{name}: {verdict.sentence}")
    for candidate in verdict.found.candidates:
        print(f"  {candidate.effect.title}: score {candidate.z:+.1f}, {candidate.reason}")
    for label, effects in (
        ("Stokes", {}),
        ("with the wall", {"wall": 1.0}),
        ("with inertia", {"inertia": 1.0}),
        ("with both", {"wall": 1.0, "inertia": 1.0}),
    ):
        print(f"  rms of the medians, {label}: {100 * median_error(model, verdict, effects):.1f} %")
    for run in verdict.next_runs:
        print(f"  next: {run.record()}")
    print(f"  as a law: {law_of_diameter(model)}")
    before, after = 100 * verdict.error_before, 100 * verdict.error_after
    print(f"  held out {verdict.split.names}: {before:.1f} % -> {after:.1f} %")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(prog="python -m tests.oracles.spheres")
    parser.add_argument("table", help="CSV of falls")
    parser.add_argument("name", nargs="?", default="KW2023", help="whose falls (default: %(default)s)")
    arguments = parser.parse_args()
    sys.exit(run_command(lambda _: main(arguments.table, arguments.name)))
