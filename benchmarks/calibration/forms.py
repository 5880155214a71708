"""Claims and intervals for a model of one's own, where forms resemble each other: balls in a tube.

Tables by `tests.oracles.drawn_falls`: nine balls, twice in each of three or five rounds, 2 % of noise. Planted
effects have the size λ in standard deviations of their score. The interval is that of the viscosity, whose truth
is known: of the fitted form alone, and over all forms that left-out runs cannot tell apart.

Usage: python -m benchmarks forms [TABLES] [FIRST_SEED]

Takes 10 minutes.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from benchmarks.common import heading, in_parallel, per_cent, row
from calibration.statistics.residual_tests import directions, examine_residual
from calibration.verdict.calibrate import calibrate, first_fit
from calibration.verdict.verdict import Verdict
from tests.oracles.drawn_falls import EFFECTS, falls, model_of

NAMES = tuple(effect.name for effect in EFFECTS)
PLANTED = ("wall", "surface", "late", "inertia")


class FormsCase(NamedTuple):
    """How tables are drawn."""

    label: str
    rounds: int = 5
    scatter: float = 0.01
    strength: tuple[float, float] = (0.0, 0.0)  # least and largest λ
    in_catalogue: bool = True


class Said(NamedTuple):
    """What a verdict says of a table."""

    label: str
    named: bool
    right: bool
    alone: bool  # the interval of the fitted form contains the truth
    joined: bool  # that over all forms does
    width: float  # of the latter, relative
    withdrawn: bool  # a claim with the truth in it
    raises: bool  # a wrong claim is made under which the held-out error rises beyond its interval


CASES = (
    *(
        FormsCase(f"nothing, {rounds} rounds that scatter by {100 * s:.0f} %", rounds, s)
        for rounds in (3, 5)
        for s in (0.0, 0.01, 0.03)
    ),
    FormsCase("one effect, λ = 8", strength=(8.0, 8.0)),
    FormsCase("… rounds scatter by 3 %", scatter=0.03, strength=(8.0, 8.0)),
    FormsCase("one effect, λ = 20", strength=(20.0, 20.0)),
    FormsCase("an effect that is not in the catalogue, λ = 8 to 20", strength=(8.0, 20.0), in_catalogue=False),
)


def length(name: str, case: FormsCase) -> float:
    """Return the signal of an effect per unit of its size, in standard deviations of its score."""
    model = model_of(falls(0, rounds=case.rounds), NAMES)
    study, base, _ = first_fit(model, draws=20)
    misfit = examine_residual(study, base, directions(model, base.parameters, model.effects))
    return float(misfit.scores.length[[effect.name for effect in model.effects].index(name)])


def drawn(case: FormsCase, seed: int) -> tuple[pd.DataFrame, list[str], str]:
    """Draw a table; return it, the names of the catalogue, and that of the effect which is planted, if any is."""
    truth = PLANTED[seed % len(PLANTED)]
    size = np.random.default_rng(seed).uniform(*case.strength) / length(truth, case) if case.strength[1] else 0.0
    planted: dict[str, Any] = {truth: size}
    table = falls(seed, rounds=case.rounds, scatter=case.scatter, **planted)
    return table, [name for name in NAMES if case.in_catalogue or name != truth], truth


def said(case: FormsCase, seed: int) -> Said:
    """Draw a table, and say what its verdict is worth."""
    table, catalogue, truth = drawn(case, seed)
    verdict: Verdict = calibrate(model_of(table, catalogue), draws=300, seed=seed, progress=False)
    named = {*verdict.effects, *([verdict.nearest.effect.name] if verdict.nearest else [])}
    alone, joined = verdict.final.interval("viscosity"), verdict.final_intervals["viscosity"]
    gain = verdict.errors.gain_interval
    return Said(
        case.label, bool(named), truth in named, alone[0] < 1.0 < alone[1], joined[0] < 1.0 < joined[1],
        joined[1] / joined[0] - 1, any(e.name == truth for claim in verdict.withdrawn for e in claim.added),
        bool(named - {truth}) and truth not in named and gain is not None and gain[1] < 0,
    )  # fmt: skip


def main(tables: str = "100", first: str = "0") -> None:
    done = in_parallel(said, [(case, int(first) + seed) for case in CASES for seed in range(int(tables))])
    print(
        heading("case", "named", "right", "withdrawn", "raises the error", "interval alone", "over forms", "width")
    )
    for case in CASES:
        part = [each for each in done if each.label == case.label]
        shares = [per_cent(sum(getattr(s, key) for s in part), len(part)) for key in
                  ("named", "right", "withdrawn", "raises", "alone", "joined")]  # fmt: skip
        print(row(case.label, *shares, f"{100 * float(np.median([s.width for s in part])):.1f} %"))
