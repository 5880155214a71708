"""Laws that no effect of the catalogue states: is the place found, and are the exponents and the lever?

Tables of 128 runs by `softflagella calibration simulate` (truth on a finer mesh, 2.5 % noise), each with one law
whose place, exponents and lever are drawn at random, at 8, 16 or 32 standard deviations of its score; one table in
four has none. The score is what coefficients and nuisance parameters leave of the law in the linear model. A side
force whose lever is not told from none counts as named at the disc and elsewhere. FILE keeps the records, and
those that it has are not made again.

Usage: python -m benchmarks hidden_laws [TABLES] [FIRST_SEED] [FILE]

Takes a minute a table.
"""

from __future__ import annotations

import time
from dataclasses import replace
from typing import Any

import numpy as np

from benchmarks.calibration.law_truths import SCORES, HiddenLaw, Setting, hidden_law, record_of
from benchmarks.calibration.planted import ROBOT
from benchmarks.markdown import heading, row
from benchmarks.proportions import per_cent
from benchmarks.records import Records
from calibration.laws.places import place_named
from calibration.report.robot_laws import RobotLaws, find_robot_laws
from calibration.swimmer.synthetic_table import make_table
from sim.io.errors import InputError
from sim.model.presets import PRESETS


def main(tables: str = "24", first_seed: str = "0", file: str = "") -> None:
    setting, records = Setting.of(), Records(file)
    for seed in range(int(first_seed), int(first_seed) + int(tables)):
        if seed in records:
            continue
        began = time.process_time()
        truth = hidden_law(setting, seed, nothing=seed % 4 == 0)
        try:
            table = make_table(replace(ROBOT, effects=truth.effects), seed=seed, title="")
            described = find_robot_laws(table, PRESETS["paper-measured"], seed=seed, progress=False)
        except InputError as reason:
            print(f"{seed}: {truth.effects}: not made: {reason}")
            continue
        record = {
            "seed": seed,
            "score": float(abs(truth.score)),
            "law": next(iter(truth.effects), ""),
            "place": truth.place.name,
            **_numbers(described, truth),
            **record_of(described),
        }
        records.add(record)
        said = ", ".join(record["kept"]) or ("within the noise" if described.laws is None else "no law")
        part = "" if record["complete"] or not record["kept"] else "not the whole residual, the nearest "
        print(f"{seed:4d} λ = {truth.score:5.0f}  {record['law'] or 'nothing':48} -> {part}{said}; "
              f"{record['before']:.2f} -> {record['after']:.2f}, {time.process_time() - began:.0f} s",
              flush=True)  # fmt: skip
    _summary(records.all)


def _numbers(described: RobotLaws, truth: HiddenLaw) -> dict[str, int]:
    """Count the exponents and levers of the true place, and those within their 95 % intervals."""
    laws = described.laws.kept if described.laws else ()
    law = next((one for one in laws if one.place == truth.place), None)
    if law is None or not truth.effects:
        return {"numbers": 0, "covered": 0}
    intervals = {name: law.fit.interval(name) for name in truth.exponents if name in law.fit.names}
    covered = [low <= truth.exponents[name] <= high for name, (low, high) in intervals.items()]
    return {"numbers": len(intervals), "covered": int(np.count_nonzero(covered))}


def _summary(records: list[dict[str, Any]]) -> None:
    columns = ("score", "tables", "described", "the true place in the set", "first in it", "on the true part",
               "a wrong part", "error over noise, median (largest)")  # fmt: skip
    with_law = [one for one in records if one["law"]]
    print("\n" + heading(*columns))
    for score in (*SCORES, None):
        ones = [one for one in with_law if score in (one["score"], None)]
        described = [one for one in ones if one["complete"]]
        in_set = [one for one in described if one["place"] in one["named"]]
        parts = [{place_named(name).part for name in one["named"]} for one in described]
        true = [place_named(one["place"]).part for one in described]
        after = [one["after"] for one in described]
        print(row(
            f"{score:g}" if score else "all", len(ones), len(described), len(in_set),
            sum(one["kept"][0] == one["place"] for one in described),
            sum(part == {part_true} for part, part_true in zip(parts, true, strict=True)),
            sum(part_true not in part for part, part_true in zip(parts, true, strict=True)),
            f"{np.median(after):.2f} ({np.max(after):.2f})" if after else "-",
        ))  # fmt: skip
    described = [one for one in with_law if one["complete"]]
    print(
        f"\nof those that are described, the true place is in the set: "
        f"{per_cent(sum(one['place'] in one['named'] for one in described), len(described))}"
    )
    numbers = sum(one["numbers"] for one in with_law)
    covered = sum(one["covered"] for one in with_law)
    print(f"exponents and levers within their 95 % intervals: {per_cent(covered, numbers)}")
    nulls = [one for one in records if not one["law"]]
    claimed = sum(one["complete"] for one in nulls)
    print(f"tables with nothing: {len(nulls)}; a law is claimed in {per_cent(claimed, len(nulls))}")
