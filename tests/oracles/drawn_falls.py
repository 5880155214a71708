"""Balls that fall in a tube: a model of one's own, and tables drawn from it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

import softflagella as sf
from calibration.own_model.function_model import FunctionModel
from calibration.own_model.table_of_runs import Roles, read_runs_of

DIAMETERS = np.array([2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 7.5, 8.0, 9.0])  # mm, in a tube of 75 mm
NOISE = 0.02
EFFECTS = (
    sf.Effect("wall", "wall of the tube", low=-1, high=3, theory=1.0),
    sf.Effect("surface", "drag of the surface", low=-2, high=2, typical=0.2),
    sf.Effect("late", "stop-watch late", low=-0.5, high=2, typical=0.1),
    sf.Effect("inertia", "inertia of the fluid", low=-0.5, high=20, typical=0.5),
    sf.Effect("warming", "warming from round to round", low=-0.3, high=0.3, typical=0.02),
)


def fall(columns: Mapping[str, Any], p: Mapping[str, float]) -> dict[str, Any]:
    """Compute the speed of a ball, as ratios of a scale; effects that are not in `p` are at their null."""
    d, of = columns["d"], {effect.name: p.get(effect.name, 0.0) for effect in EFFECTS}
    v = d**2 / p["viscosity"] * (1 - of["wall"] * 2.104 * d / 75) * np.exp(of["surface"] / d)
    v = 2 * v / (1 + np.sqrt(1 + of["inertia"] * d * v / 100)) / (1 + of["late"] * d**2 / 100)
    number = np.array([float(name[-1]) for name in columns["round"]])
    return {"v": v * np.exp(of["warming"] * (number - 2))}


def falls(
    seed: int, *, rounds: int = 5, repeats: int = 2, scatter: float = 0.0, bump: float = 0.0, **truth: float
) -> pd.DataFrame:
    """Draw a table: rounds of all balls, each shifted by `scatter`, with a bump at middle diameters."""
    rng = np.random.default_rng(seed)
    rows = [(f"round {k}", d) for k in range(rounds) for _ in range(repeats) for d in DIAMETERS]
    table = pd.DataFrame(rows, columns=["round", "d"])
    columns = {name: table[name].to_numpy() for name in table}
    v = fall(columns, {"viscosity": 1.0, **truth})["v"] * np.exp(bump * np.sin(columns["d"]))
    shift = scatter * rng.standard_normal(rounds)
    place = table["round"].str[-1].astype(int).to_numpy()
    return table.assign(v=v * np.exp(shift[place] + NOISE * rng.standard_normal(len(table))))


def declared(effects: Sequence[str] = ("wall", "surface", "late")) -> sf.Model:
    """Declare the model, with some effects in its catalogue."""
    return sf.Model(
        fall,
        outputs={"v": sf.Output("speed", unit="mm/s")},
        numbers=[sf.Number("viscosity", 1.0, unit="Pa s", low=0.01, high=100)],
        effects=[effect for effect in EFFECTS if effect.name in effects],
        settings=["d"],
    )


def model_of(
    table: pd.DataFrame, effects: Sequence[str] = ("wall", "surface", "late"), **roles: Any
) -> FunctionModel:
    """Make the model of a table, with some effects in its catalogue."""
    return read_runs_of(table, declared(effects), Roles(**({"session": "round"} | roles)))[0]
