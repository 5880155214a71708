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

from benchmarks.calibration.planted import ROBOT
from benchmarks.proportions import per_cent
from calibration.laws.law_model import EXPONENTS
from calibration.laws.places import Place, places
from calibration.report.robot_laws import RobotLaws, find_robot_laws
from calibration.statistics.fit import Fit, fit
from calibration.statistics.residual_tests import Directions, examine_residual
from calibration.statistics.statistical_model import start_values
from calibration.statistics.study import Study, middle_session
from calibration.swimmer.measured_table import read_measurements
from calibration.swimmer.swimmer import SwimmerModel
from calibration.swimmer.synthetic_table import make_table
from sim.inputs import group_columns
from sim.io.errors import InputError
from sim.model.groups import Groups
from sim.model.power_law import COEFFICIENTS, Powers
from sim.model.presets import PRESETS

_SCORES = (8.0, 16.0, 32.0)
_STEEP = 1.0  # largest exponent


def main(tables: str = "24", first_seed: str = "0") -> None:
    null = make_table(ROBOT, seed=1000, title="")
    model = SwimmerModel(ROBOT, read_measurements(null))
    used = ~middle_session(model.runs)
    names = tuple(p.name for p in (*model.coefficients, *model.nuisances))
    study = Study.fitted_to(model, used)
    base = fit(model, start_values(model), names, used, title="")
    on_head = [place for place in places() if place.is_term or place.name in COEFFICIENTS]
    in_set = first = laws = covered = exponents = claims = nulls = hedged = 0
    ratios = []
    for seed in range(int(first_seed), int(first_seed) + int(tables)):
        began = time.process_time()
        rng = np.random.default_rng(seed)
        place = on_head[rng.integers(len(on_head))]
        powers = Powers(*rng.uniform(-_STEEP, _STEEP, 3))
        score = _SCORES[seed % 3] * rng.choice([-1, 1])
        effects: dict[str, float] = {}
        if seed % 4:
            size = score / _signal(study, base, model, place, powers)
            if place.is_term:
                effects = {place.effect(powers).name: size}
            else:
                powers = Powers(*(np.clip(size * p, -4, 4) for p in (powers.speed, powers.length, powers.tails)))
                effects = {place.effect(powers).name: 1.0}
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


def _signal(study: Study, base: Fit, model: SwimmerModel, place: Place, powers: Powers) -> float:
    """Compute the score of a law per unit of its size, or of its exponents."""
    moved = [name for name, _ in place.moves]
    slope = model.derivatives({**base.parameters, **dict.fromkeys(moved, 1.0)}, moved)[1][..., 0]
    robots, of_run = model.robots(base.parameters)
    logs = np.array([powers.logarithm(Groups.from_columns(group_columns([robot])))[0] for robot in robots])[of_run]
    column = slope * (np.exp(logs) if place.is_term else logs)[:, None]
    return float(examine_residual(study, base, Directions.plain(column[..., None]), draws=50).scores.length[0])


def _short(described: RobotLaws) -> str:
    return "within the noise" if described.laws is None else "no law"
