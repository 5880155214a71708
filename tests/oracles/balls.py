"""Balls dropped from a bridge: a model whose missing effect differs from ball to ball.

A body that falls from rest has the speed v at the depth h below its release:

    free fall        v² = 2 g h,
    quadratic drag   v² = (g/c) (1 − exp(−2 c h)),   c = C_D ρ π r²/(2 m),
    linear drag      v = (g/k) (1 + W(−exp(−1 − k² h/g))),

with Lambert's W, and C_D or k as the size of the effect. g is known to 0.1 %. Further effects are an error of the
release's height, and the buoyancy of the air. Of two kinds of drag the factors are multiplied. A table has one row
for each speed: ball, drop, mass_kg, radius_m, depth_m, speed_m_s. A drop of all balls is a session, and a ball is
a specimen.

Usage: python -m tests.oracles.balls TABLE.csv [--without EFFECT …] [--out DIR]
"""

from __future__ import annotations

import argparse
import json
import math
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from scipy.special import lambertw

from calibration.report.report import write_report
from calibration.statistics.excluded import Excluded
from calibration.statistics.forward import secants
from calibration.statistics.statistical_model import Parameter, Parameters, Predict, Runs, Value
from calibration.verdict.calibrate import calibrate
from calibration.verdict.record import verdict_record
from common.arrays import Flags, Floats
from common.errors import InputError, run_command
from common.files import files_together, write_text

GRAVITY, AIR = 9.81, 1.19  # m/s², kg/m³
COLUMNS = ("ball", "drop", "mass_kg", "radius_m", "depth_m", "speed_m_s")
_SMALL = 1e-3  # k √(2 h/g) below which a series is more exact than W; least depth [m] and share of gravity


@dataclass(frozen=True)
class Balls:
    """Speeds of falling balls, over those of free fall with standard gravity."""

    runs: Runs
    depth: Floats  # (n,) [m]
    area: Floats  # (n,) π r²/m [m²/kg]
    volume: Floats  # (n,) 4/3 π r³/m [m³/kg]
    coefficients: tuple[Parameter, ...] = ()
    nuisances: tuple[Parameter, ...] = (
        Parameter("gravity", "gravity", GRAVITY, (1.0, 100.0), 1.0, logarithmic=True, unit="m/s²", sigma=1e-3),
    )
    effects: tuple[Parameter, ...] = (
        Parameter("quadratic_drag", "quadratic drag", 0.0, (0.0, 5.0), 0.2, unit="C_D"),
        Parameter("linear_drag", "linear drag", 0.0, (0.0, 5.0), 0.2, unit="1/s"),
        Parameter("release", "release above its mark", 0.0, (-1.0, 1.0), 0.1, unit="m"),
        Parameter("buoyancy", "buoyancy of the air", 0.0, (0.0, 5.0), 1.0, unit="displaced air"),
    )
    untestable: Mapping[str, str] = field(default_factory=dict)

    def predict(self, sets: Sequence[Parameters], *, title: str = "") -> Floats:
        """Compute ln v − ½ ln 2 g₀ h, (P, n, 1)."""
        free = np.sqrt(2 * GRAVITY * self.depth)
        return np.array([np.log(self.speed(p) / free)[:, None] for p in sets])

    def speed(self, parameters: Parameters) -> Floats:
        """Compute speeds [m/s], (n,); each parameter is one number, or one for each run (n,)."""
        buoyancy, release = parameters.get("buoyancy", 0.0), parameters.get("release", 0.0)
        gravity = parameters["gravity"] * np.maximum(1 - buoyancy * AIR * self.volume, _SMALL)
        depth = np.maximum(self.depth + release, _SMALL)
        exponent = parameters.get("quadratic_drag", 0.0) * AIR * self.area * depth
        slower = np.where(exponent > 0, -np.expm1(-exponent) / np.where(exponent > 0, exponent, 1.0), 1.0)
        fall = np.sqrt(depth / gravity)
        linear = _by_linear_drag(parameters.get("linear_drag", 0.0), fall)
        return np.asarray(gravity * fall * np.sqrt(2 * slower) * linear)

    def linearised(
        self, at: Parameters, along: Sequence[Parameter], *, title: str = "", quick: bool = False
    ) -> Predict:
        """Return the linear model, by differences."""
        return secants(self, at, along)

    def check(self, prediction: Floats) -> None:
        """Accept any speed."""

    def guess(self, start: dict[str, float], used: Flags) -> dict[str, float]:
        """Return the start as it is: the fit is linear in ln g."""
        return start

    def possible(self) -> tuple[Balls, list[dict[str, Any]]]:
        """Return the falls of the table, which can be made again."""
        return self, [{"depth_m": depth} for depth in self.depth.tolist()]


def _by_linear_drag(rate: Value, fall: Floats) -> Floats:
    """Compute the speed with linear drag over that of free fall; `rate` is k, `fall` is √(h/g)."""
    s = math.sqrt(2.0) * rate * fall
    large = np.maximum(s, _SMALL)
    exact = (1 + np.asarray(lambertw(-np.exp(-1 - large**2 / 2))).real) / large  # type: ignore[call-overload]
    return np.asarray(np.where(s > _SMALL, exact, 1 - s / 3 + s**2 / 36))


def read_balls(source: str | Path | pd.DataFrame, without: Sequence[str] = ()) -> Balls:
    """Read a table of falls.

    Args:
        source: the table.
        without: names of effects that are withheld.

    Raises:
        InputError: the table lacks a column, or has too few falls; or there is no such effect.
    """
    for name in without:
        if name not in (effect.name for effect in Balls.effects):
            raise InputError(f"no effect {name!r}; there are {', '.join(e.name for e in Balls.effects)}")
    effects = tuple(effect for effect in Balls.effects if effect.name not in without)
    table = source if isinstance(source, pd.DataFrame) else pd.read_csv(source, comment="#")
    for column in COLUMNS:
        if column not in table:
            raise InputError(f"the table has no column {column!r}")
    numbers = table[list(COLUMNS[2:])].apply(pd.to_numeric, errors="coerce")
    good = (np.isfinite(numbers) & (numbers > 0)).all(axis=1).to_numpy()
    part, numbers = table[good], numbers[good]
    balls, specimen = np.unique(part["ball"].astype(str), return_inverse=True)
    drops, session = np.unique(part["drop"].astype(str), return_inverse=True)
    if len(balls) < 3 or len(drops) < 2:
        raise InputError(f"{len(balls)} balls in {len(drops)} drops; at least 3 in 2 are needed")
    place = numbers["depth_m"].groupby([specimen, session]).rank().to_numpy(dtype=int)  # in its fall
    mass, radius, depth, speed = numbers.to_numpy(dtype=float).T
    runs = Runs(
        outputs=("v",),
        y=np.log(speed / np.sqrt(2 * GRAVITY * depth))[:, None],
        condition=np.unique(np.stack([specimen, place]), axis=1, return_inverse=True)[1].reshape(-1),
        session=session,
        session_names=tuple(f"drop {name}" for name in drops),
        inputs=np.stack([np.log(depth), np.log(radius), np.log(mass)], 1),
        input_names=("ln h", "ln r", "ln m"),
        rows=np.flatnonzero(good) + 1,
        excluded=tuple(
            Excluded("a number is missing or not above 0", f"row {i + 1}") for i in np.flatnonzero(~good)
        ),
        caveats=(),
        specimen=specimen,
        specimen_names=tuple(balls.tolist()),
    )
    area, volume = math.pi * radius**2 / mass, 4 / 3 * math.pi * radius**3 / mass
    return Balls(runs, depth, area, volume, effects=effects)


def main(table: str, without: Sequence[str] = (), out: str | None = None) -> None:
    model = read_balls(table, without)
    verdict = calibrate(model, progress=False)
    print(verdict.sentence)
    if out:
        with files_together(out, ("verdict.json", "report.html")) as folder:
            record = verdict_record(verdict, table=Path(table).name)
            write_report(verdict, record, folder / "report.html")
            write_text(folder / "verdict.json", json.dumps(record, indent=1) + "\n")
        print(f"-> {out}/report.html, {out}/verdict.json")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(prog="python -m tests.oracles.balls")
    parser.add_argument("table", help="CSV of falls")
    parser.add_argument("--without", nargs="+", default=(), metavar="EFFECT", help="effects that are withheld")
    parser.add_argument("--out", metavar="DIR", help="write verdict.json and report.html into this folder")
    arguments = parser.parse_args()
    sys.exit(run_command(lambda _: main(arguments.table, arguments.without, arguments.out)))
