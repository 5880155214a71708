"""Where a power law is not enough: is it rejected, and does its curve get the right name?

A law along the motor speed is no power law in a resonance and in a threshold
(`benchmarks.calibration.foreign_laws`, λ = 16 or 32). In tables with a power law on the head
(`benchmarks.calibration.law_truths`, λ = 8, 16 or 32) none should be rejected. The name is that of the law that
describes best with a curve along ω. A threshold on a coefficient, a constant with a kink, counts as right.

With SOLVER "toy", tables and fits are of a robot with rigid tails in closed form, which has the statistics of
the real one and takes seconds; with "simulator" they are those of `foreign_laws`. SPEEDS is 4 or 8, the number of
motor speeds. FILE keeps the records, and those that it has are not made again.

Usage: python -m benchmarks curved_laws [TABLES] [FIRST_SEED] [SPEEDS] [SOLVER] [FILE]

Takes ten seconds a table, with the simulator three minutes.
"""

from __future__ import annotations

import math
import time
from contextlib import nullcontext
from dataclasses import replace
from typing import Any

import pandas as pd
import pytest

from benchmarks.calibration.foreign_laws import DESIGN, KINDS, foreign
from benchmarks.calibration.law_truths import Setting, hidden_law
from benchmarks.calibration.planted import ROBOT
from benchmarks.markdown import heading, row
from benchmarks.proportions import per_cent
from benchmarks.records import Records
from calibration.laws.law import Law
from calibration.laws.law_fits import Laws
from calibration.report.robot_laws import find_robot_laws
from calibration.swimmer.synthetic_table import make_table
from sim.io.errors import InputError
from sim.model.presets import PRESETS
from tests.calibration.toy_tables import install_toy

_TRUTHS = ("resonance", "threshold", "power law")
_SPEEDS = {"4": DESIGN["motor_rpm"], "8": (80.0, 90.0, 100.0, 110.0, 120.0, 130.0, 140.0, 150.0)}
_RIGHT = {"resonance": {"resonance"}, "threshold": {"threshold", "kink"}, "power law": set()}
_OUTCOMES = ("right, alone", "right, among several", "wrong", "no simple curve", "not rejected", "no law")


def main(
    tables: str = "30", first_seed: str = "8000", speeds: str = "4", solver: str = "toy", file: str = ""
) -> None:
    records = Records(file)
    with pytest.MonkeyPatch.context() if solver == "toy" else nullcontext() as patch:
        if patch is not None:
            install_toy(patch)
        setting = Setting.of(**{**DESIGN, "motor_rpm": _SPEEDS[speeds]})
        for seed in range(int(first_seed), int(first_seed) + int(tables)):
            if seed not in records:
                _add(records, setting, seed)
    print("\n" + heading("truth", "tables", *_OUTCOMES, "at the true place", "rejected along l or N"))
    for truth in _TRUTHS:
        ones = [one for one in records.all if one["kind"] == truth]
        counts = [sum(one["outcome"] == outcome for one in ones) for outcome in _OUTCOMES]
        at_place = sum(bool(one["named"]) and one["place"] in one["true"] for one in ones)
        print(row(truth, len(ones), *counts, at_place, sum(one["elsewhere"] for one in ones)))
    curved = [one for one in records.all if one["kind"] != "power law"]
    named = [one for one in curved if one["named"]]
    wrong = sum(one["outcome"] == "wrong" for one in named)
    power = [one for one in records.all if one["kind"] == "power law" and one["outcome"] != "no law"]
    rejections = sum(one["outcome"] != "not rejected" or one["elsewhere"] for one in power)
    print()
    for said, hits, count in (
        ("a name is given", len(named), len(curved)),
        ("of the names, wrong", wrong, len(named)),
        ("a true power law is rejected along any input", rejections, len(power)),
    ):
        print(f"{said}: {per_cent(hits, count) if count else '-'}")


def _add(records: Records, setting: Setting, seed: int) -> None:
    """Make a table, describe it, and keep what is said."""
    began = time.process_time()
    kind = _TRUTHS[seed % len(_TRUTHS)]
    try:
        score, true, table = _table(setting, kind, seed)
    except InputError as reason:
        print(f"{seed}: not made: {reason}", flush=True)
        return
    described = find_robot_laws(table, PRESETS["paper-measured"], seed=seed, progress=False)
    record = {"seed": seed, "kind": kind, "score": score, "true": true, **_said(described.laws, kind)}
    records.add(record)
    print(f"{seed} {kind} at {true[0]}, λ = {abs(score):g} -> {record['outcome']}: {record['place']}, "
          f"{record['named']}, {time.process_time() - began:.0f} s", flush=True)  # fmt: skip


def _table(setting: Setting, kind: str, seed: int) -> tuple[float, list[str], pd.DataFrame]:
    """Make a table; return the score and the true places, too."""
    if kind == "power law":
        law = hidden_law(setting, seed // len(_TRUTHS), nothing=False)  # all scores in turn
        robot = replace(ROBOT, effects=law.effects)
        return law.score, [law.place.name], make_table(robot, seed=seed, title="", **setting.design)
    # Seeds of `foreign` count kinds and scores: the same number for each kind, one score after the other.
    of_kind = (seed // len(_TRUTHS)) * len(KINDS) + KINDS.index(kind)
    return foreign(setting, of_kind)[1:]


def _said(laws: Laws | None, kind: str) -> dict[str, Any]:
    """Record what is said about the curve along ω of the best law with one."""
    told = laws.curved or (laws.kept[0] if laws.kept else None) if laws else None
    if laws is None or told is None:
        return {"outcome": "no law", "place": "", "named": [], "complete": False, "elsewhere": False,
                "p_value": math.nan, "left": math.nan}  # fmt: skip
    curve = next((one for one in told.curves if one.symbol == "ω"), None)
    named = [one.name for one in curve.named] if curve else []
    return {
        "outcome": _outcome(told, named, kind),
        "place": told.place.name,
        "named": named,
        "complete": laws.complete,
        "elsewhere": any(one.rejected for one in told.curves if one.symbol != "ω"),
        "p_value": curve.p_value if curve else math.nan,
        "left": curve.left if curve else math.nan,
    }


def _outcome(told: Law, named: list[str], kind: str) -> str:
    if not any(one.rejected for one in told.curves if one.symbol == "ω"):
        return "not rejected"
    if not named:
        return "no simple curve"
    if not set(named) & _RIGHT[kind]:
        return "wrong"
    return "right, alone" if set(named) <= _RIGHT[kind] else "right, among several"
