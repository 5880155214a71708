"""Laws that no effect of the catalogue states: are place and exponents found, and is the description good?

Tables by `softflagella calibration simulate` (truth on a finer mesh, 2.5 % noise), each with a hidden law:

    hidden     128 runs and a law whose place, exponents and lever are drawn at random, at λ = 8, 16 or 32; one
               table in four has none. A side force whose lever is not told from none counts as named at the disc
               and elsewhere
    foreign    192 runs and a law that the search does not contain (`foreign_laws`), at λ = 16 or 32
    nothing    128 runs without a law

A place is wrong if it is true for nothing of the truth. λ is what coefficients and nuisance parameters leave of
the law in the linear model. FILE keeps the records, and those that it has are not made again.

Usage: python -m benchmarks laws [hidden|foreign|nothing] [TABLES] [FIRST_SEED] [FILE]

Takes a minute a table.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from benchmarks.calibration.foreign_laws import DESIGN, foreign
from benchmarks.calibration.law_truths import Design, Truth, hidden_law
from benchmarks.common import Records, heading, per_cent, row
from calibration.laws.law_model import law_model
from calibration.laws.laws import Laws, elsewhere, find_laws
from calibration.statistics.residual_tests import Directions, examine_residual
from calibration.statistics.study import errors
from calibration.swimmer.measured_table import read_measurements
from calibration.swimmer.swimmer import SwimmerModel
from calibration.verdict.calibrate import first_fit
from common.errors import InputError
from sim.model.presets import PRESETS


def record_of(truth: Truth, seed: int) -> dict[str, Any]:
    """Record what a search says: the places that are not told apart, numbers covered, errors over the noise."""
    model = SwimmerModel(PRESETS["paper-measured"], read_measurements(truth.table()))
    study, base, _ = first_fit(model, seed=seed)
    none = Directions.plain(np.empty((*model.runs.y.shape, 0)))
    missing = examine_residual(study, base, none).general_p < study.level
    found: Laws | None = find_laws(study, base) if missing else None
    laws = found.kept if found else ()
    before, noise = errors(model.runs, base.prediction, study.split.test)[0], base.noise.rms
    after = errors(model.runs, found.prediction, study.split.test)[0] if found and laws else float("nan")
    hidden = truth.kind == "hidden"  # a side force whose lever is not told from none is at the disc and elsewhere
    law = next((one for one in laws if law_model(one).place.name in truth.places), None)
    others = found.fitted if found and hidden else ()
    intervals = {n: law.fitted.interval(n) for n in truth.exponents if n in law.fitted.names} if law else {}
    return {
        "kind": truth.kind,
        "score": truth.score,
        "true": truth.places,
        "described": bool(found and found.complete),
        "named": [law_model(one).place.name for law in laws for one in (law, *elsewhere(law, others))],
        "kept": [law_model(law).place.name for law in laws],
        "before": before / noise,
        "after": after / noise,
        "numbers": len(intervals),
        "covered": sum(low <= truth.exponents[n] <= high for n, (low, high) in intervals.items()),
    }


def summary(records: list[dict[str, Any]]) -> None:
    """Print the table by kind of truth and score."""
    print("\n" + heading("truth", "tables", "described", "a true place named", "first", "a wrong place alone",
                         "several, all wrong", "error / noise before", "after: median (largest)"))  # fmt: skip
    groups = dict.fromkeys(f"{one['kind']}, λ = {one['score']:g}" for one in records if one["true"])
    for group in (*groups, "all"):
        ones = [one for one in records if one["true"] and group in ("all", f"{one['kind']}, λ = {one['score']:g}")]
        described = [one for one in ones if one["described"]]
        right = [one for one in described if {*one["named"]} & {*one["true"]}]
        alone = sum(len(one["kept"]) == 1 for one in described if one not in right)
        after = [one["after"] for one in described] or [float("nan")]
        first = sum(one["kept"][0] in one["true"] for one in right)
        before = np.median([one["before"] for one in ones])
        print(row(group, len(ones), len(described), len(right), first, alone,
                  len(described) - len(right) - alone, f"{before:.2f}",
                  f"{np.median(after):.2f} ({max(after):.2f})"))  # fmt: skip
        if group == "all" and described:
            print(f"\na true place is named in {per_cent(len(right), len(described))} of those described, "
                  f"a wrong one alone in {per_cent(alone, len(ones))} of all")  # fmt: skip
    if numbers := sum(one["numbers"] for one in records):
        covered = sum(one["covered"] for one in records)
        print(f"exponents and levers within their 95 % intervals: {per_cent(covered, numbers)}")
    if nulls := [one for one in records if not one["true"]]:
        print(f"without a law one is described in {per_cent(sum(n['described'] for n in nulls), len(nulls))}")


def main(kind: str = "hidden", tables: str = "24", first_seed: str = "0", file: str = "") -> None:
    setting, records = Design.of(**(DESIGN if kind == "foreign" else {})), Records(file)
    truths: dict[str, Callable[[int], Truth]] = {
        "hidden": lambda seed: hidden_law(setting, seed, nothing=seed % 4 == 0),
        "foreign": lambda seed: foreign(setting, seed),
        "nothing": lambda seed: hidden_law(setting, seed, nothing=True),
    }
    if kind not in truths:
        raise InputError(f"no laws {kind!r}; give one of {', '.join(truths)}")
    for seed in range(int(first_seed), int(first_seed) + int(tables)):
        if seed in records:
            continue
        try:
            record = {"seed": seed, **record_of(truths[kind](seed), seed)}
        except InputError as reason:
            print(f"{seed}: not made: {reason}", flush=True)
            continue
        records.add(record)
        print(record, flush=True)
    summary(records.all)
