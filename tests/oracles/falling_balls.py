"""Falls of balls and of beads for the models of docs/models: tables with a hidden truth, and their reader."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from calibration.own_model.function_model import FunctionModel
from calibration.own_model.table_of_runs import Roles, read_runs_of

BALLS_MODEL: Any = import_module("docs.models.balls")
SPHERES_MODEL: Any = import_module("docs.models.spheres")
GRAVITY, AIR = 9.81, 1.19  # m/s², kg/m³
COLUMNS = ["ball", "drop", "mass_kg", "radius_m", "depth_m", "speed_m_s"]

BALLS, DROPS, DEPTHS, NOISE, STEPS = 10, 2, 8, 0.06, 600
NULLS = ("nothing", "shifts of whole drops, 5 %")
DRAGS = ("linear drag, one rate", "linear drag, differs", "quadratic drag, one C_D", "quadratic drag, differs")
OUTSIDE = ("slopes of either sign", "a bump in depth", "a wave in depth")  # no form of the catalogue is like them


def speeds(depths: np.ndarray, slowing: Callable[[float], float]) -> np.ndarray:
    """Integrate d(v²)/dh = 2 (g − slowing(v)) from rest with Heun's rule."""
    places, width = np.linspace(0.0, float(depths.max()), STEPS + 1, retstep=True)
    squares = [0.0]
    for _ in range(STEPS):
        first = 2 * (GRAVITY - slowing(squares[-1] ** 0.5))
        second = 2 * (GRAVITY - slowing((squares[-1] + width * first) ** 0.5))
        squares.append(squares[-1] + width * (first + second) / 2)
    return np.sqrt(np.interp(depths, places, squares))


def falls(truth: str, seed: int) -> pd.DataFrame:
    """Make a table of falls with one of NULLS, DRAGS or OUTSIDE hidden in it."""
    rng = np.random.default_rng(seed)
    mass, radius = np.exp(rng.uniform(np.log(0.03), np.log(0.6), BALLS)), rng.uniform(0.02, 0.12, BALLS)
    sizes = np.full(BALLS, 0.4) * (np.exp(0.6 * rng.normal(size=BALLS)) if "differs" in truth else 1.0)
    slopes, phase = 0.12 * rng.normal(size=BALLS), rng.uniform(0, 6)
    shifts = 0.05 * rng.normal(size=DROPS) if truth.startswith("shifts") else np.zeros(DROPS)
    rows = []
    for ball in range(BALLS):
        area = np.pi * radius[ball] ** 2 / mass[ball]
        rate = sizes[ball] if truth.startswith("linear") else 0.0
        cd = sizes[ball] if truth.startswith("quadratic") else 0.0
        for drop in range(DROPS):
            depths = np.linspace(4.0, 32.0, DEPTHS) + rng.uniform(-0.2, 0.2, DEPTHS)
            v = speeds(depths, lambda v, k=rate, c=cd * AIR * area / 2: k * v + c * v**2)  # type: ignore[misc]
            extra = {
                "slopes of either sign": slopes[ball] * np.log(depths / 12),
                "a bump in depth": 0.25 * np.exp(-(((depths - 16) / 4) ** 2)),
                "a wave in depth": 0.12 * np.sin(depths / 3 + phase),
            }.get(truth, 0.0)
            noise = NOISE * rng.normal(size=DEPTHS) + shifts[drop]
            v = v * np.exp(extra + noise)
            rows += [
                (f"ball {ball}", drop + 1, mass[ball], radius[ball], h, speed)
                for h, speed in zip(depths.tolist(), v.tolist(), strict=True)
            ]
    return pd.DataFrame(rows, columns=COLUMNS)


def balls(table: str | Path | pd.DataFrame, without: Sequence[str] = ()) -> FunctionModel:
    """Make the model of falling balls with its runs, without the effects that are withheld."""
    frame = pd.read_csv(table, comment="#") if isinstance(table, str | Path) else table
    roles = Roles(session="drop", specimen="ball")
    return read_runs_of(BALLS_MODEL.at_marks(frame), BALLS_MODEL.MODEL.without(*without), roles)[0]


def spheres(table: str | Path | pd.DataFrame, name: str = "") -> FunctionModel:
    """Make the model of beads with its runs, or with those of one set of a table."""
    frame = pd.read_csv(table, comment="#") if isinstance(table, str | Path) else table
    part = frame[frame["set"] == name] if name else frame
    return read_runs_of(part, SPHERES_MODEL.MODEL, Roles(session="trial", specimen="bead"))[0]
