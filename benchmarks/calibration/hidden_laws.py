"""Laws on head and disc that no effect of the catalogue states: is the place found, and are the exponents?

Tables of 128 runs by `softflagella calibration simulate` (truth on a finer mesh, 2.5 % noise), each with one law
whose place and exponents are drawn at random, at 8, 16 or 32 standard deviations of its score; one table in four
has none. The score is what coefficients and nuisance parameters leave of the law in the linear model. Laws of the
tails are not among the truths.

Usage: python -m benchmarks hidden_laws [TABLES] [FIRST_SEED]

Takes half an hour.
"""

from __future__ import annotations

import math
import time
from dataclasses import replace

import numpy as np

from benchmarks.calibration.law_truths import Setting, hidden_law
from benchmarks.calibration.planted import ROBOT
from benchmarks.proportions import per_cent
from calibration.laws.inputs import EXPONENTS
from calibration.report.robot_laws import RobotLaws, find_robot_laws
from calibration.swimmer.synthetic_table import make_table
from sim.io.errors import InputError
from sim.model.presets import PRESETS


def main(tables: str = "24", first_seed: str = "0") -> None:
    setting = Setting.of()
    in_set = first = laws = covered = exponents = claims = nulls = hedged = 0
    ratios = []
    for seed in range(int(first_seed), int(first_seed) + int(tables)):
        began = time.process_time()
        truth = hidden_law(setting, seed, nothing=seed % 4 == 0)
        place, powers, score, effects = truth.place, truth.powers, truth.score, truth.effects
        try:
            table = make_table(replace(ROBOT, effects=effects), seed=seed, title="")
            described = find_robot_laws(table, PRESETS["paper-measured"], seed=seed, progress=False)
        except InputError as reason:
            print(f"{seed}: {effects}: not made: {reason}")
            continue
        kept = described.laws.kept if described.laws and described.laws.complete else ()
        names_kept = [law.place.name for law in kept]
        error = kept[0].error / described.noise if kept else math.nan
        said = ", ".join(names_kept) or _short(described)
        print(f"{seed:4d} λ = {score:5.0f}  {next(iter(effects), 'nothing'):48} -> {said}; "
              f"{described.error_without / described.noise:.2f} -> {error:.2f}, "
              f"{time.process_time() - began:.0f} s", flush=True)  # fmt: skip
        if not effects:
            nulls += 1
            claims += bool(kept)
            continue
        laws += 1
        hedged += not kept
        if kept:
            ratios.append(error)
            first += names_kept[0] == place.name
            in_set += place.name in names_kept
        for law in kept:
            if law.place == place:
                for name, true in zip(EXPONENTS, (powers.speed, powers.length, powers.tails), strict=True):
                    low, high = law.fit.interval(name)
                    covered += low <= true <= high
                    exponents += 1
    print(f"\nlaws: {laws}; nothing is claimed: {per_cent(hedged, laws)}")
    print(f"of those that are claimed: place first {per_cent(first, laws - hedged)}, "
          f"in the set {per_cent(in_set, laws - hedged)}")  # fmt: skip
    print(f"exponents within their 95 % intervals: {per_cent(covered, exponents)}")
    print(f"error on the held-out runs over the noise of a run: {np.median(ratios):.2f} at the median, "
          f"{np.max(ratios):.2f} at most")  # fmt: skip
    print(f"tables with nothing: {nulls}; a law is claimed in {per_cent(claims, nulls)}")


def _short(described: RobotLaws) -> str:
    return "within the noise" if described.laws is None else "no law"
