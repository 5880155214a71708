"""Rates of the calibration: how often its verdict is right, wrong or silent on planted truths.

The whole procedure (`calibration.verdict.calibrate.calibrate`) runs on tables of 192 runs in the paper's design.

    linear       tables of the linear stand-in (`planted`): wrong nuisance parameters, one effect, and physics
                 outside the catalogue. "Numbers exact": every nuisance parameter is fixed to its given value
    simulator    tables of the simulator, with tails of 5 to 11 cm and a truth that is stepped in time on twice as
                 many edges with half the step: each testable effect at λ = 8, nothing, and a fluid that thins

A truth "is named" if it is named alone, in a set of effects, or beside a wrong number that does the same. A number
"is wrong" if it explains the residual, alone or beside effects that explain as much.

Usage: python -m benchmarks rates [linear|simulator|balls] [TABLES] [FIRST_SEED] [CASES]
       CASES: words of the cases to run, separated by |; default all. A case has the same seeds in every run.

Takes 100 minutes of one core (linear), an hour (simulator), half an hour (balls).
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np

from benchmarks.calibration.planted import (
    ROBOT,
    LinearSwimmer,
    Signals,
    design,
    in_days,
    linearised,
    measured,
    outside,
    restated,
)
from benchmarks.calibration.simulated_truth import LENGTHS_CM, THINNING, simulated, sized, thinning
from benchmarks.common import heading, in_parallel, per_cent, row
from calibration.statistics.statistical_model import Experiment, Parameter
from calibration.swimmer.swimmer import SwimmerModel
from calibration.verdict.calibrate import calibrate
from calibration.verdict.verdict import Verdict
from common.arrays import Floats
from tests.oracles.falling_balls import DRAGS, NULLS, OUTSIDE, balls, falls

_DAYS, _MOVING = 4, ("C_t", "C_r", "C_yr", "youngs_modulus", "camera_scale")
_AT_ONCE = 10  # tables of a case in one call
_NULLS = 20
_CLAIMED, _CLAIMED_PLAINLY = "an effect is claimed", "an effect is claimed without a warning"
_WRONG, _UNEXPLAINED, _COVERED = "a number is wrong", "unexplained", "interval covers the true value"
_ADOPTED, _RISES = "a form is adopted", "a form is adopted, and the error on the held-out runs rises"
_MOVED, _MOVED_NAMED = "a number moved", "the number that moved and the day, or in the set"
_OF_AN_EFFECT = (_NAMED, _OTHER, _NUMBER) = (
    "named, or in the set",
    "another effect",
    "a number, and the effect is not named",
)


@dataclass(frozen=True)
class RateCase:
    """A truth, and what is asked of the verdicts on it."""

    label: str
    tables: Callable[[list[int]], list[Experiment]]  # models with data, one for each seed of the noise
    asked: tuple[str, ...]
    planted: tuple[str, float] = ("", 0.0)  # an effect or a nuisance parameter, and its true value
    weight: float = 1.0  # tables of this case, as a share of those that are asked for


class Result(NamedTuple):
    """What came out of a table."""

    label: str
    answers: dict[str, bool]  # some questions cannot be asked of every verdict
    error: float  # on the held-out session, over the noise of a run
    seconds: float


def answers(verdict: Verdict, case: RateCase) -> dict[str, bool]:
    """Answer every question that can be asked of a verdict."""
    sets = [{e.name for e in c.added} for c in verdict.claims]
    beside = [{e.name for e in c.added} for c in verdict.attribution.rival_effects]
    name, value = case.planted
    found = {
        _CLAIMED: bool(sets),
        _CLAIMED_PLAINLY: bool(sets) and not any(c.doubts for c in verdict.claims),
        _WRONG: verdict.verdict == "number" or bool(verdict.attribution.rival_numbers),
        _UNEXPLAINED: verdict.verdict == "unexplained",
        _MOVED: bool(verdict.moves),
        _MOVED_NAMED: any(case.planted[0] in move["words"] for move in verdict.facts["moves"]),
        _ADOPTED: verdict.nearest is not None,
        _RISES: verdict.nearest is not None and not verdict.held_out_error_falls,
        _NAMED: {name} in (*sets, *beside),
        _OTHER: bool(sets) and {name} not in sets,
        _NUMBER: verdict.verdict == "number" and {name} not in beside,
    }
    fits = [verdict.final, verdict.base] if sets in ([], [{name}]) else []
    intervals = [fit.interval(name) for fit in fits if name in fit.names]
    return found | ({_COVERED: intervals[-1][0] <= value <= intervals[-1][1]} if intervals else {})


def results(case: RateCase, seeds: list[int]) -> list[Result]:
    """Calibrate the tables of some seeds."""
    done = []
    for model in case.tables(seeds):
        began = time.process_time()
        verdict: Verdict = calibrate(model, progress=False)
        ratio = verdict.error_after / verdict.noise_ceiling
        done.append(Result(case.label, answers(verdict, case), ratio, time.process_time() - began))
    return done


def linear_tables(model: LinearSwimmer, signal: Floats, seeds: list[int]) -> list[Experiment]:
    """Add the same signal to every table."""
    return [measured(model, signal, seed) for seed in seeds]


def drawn_tables(model: LinearSwimmer, truth: LinearSwimmer, seeds: list[int]) -> list[Experiment]:
    """Nuisance parameters of `truth` off by a draw of their priors, of which `model` may know nothing."""
    sigma = np.array([p.sigma for p in truth.nuisances], dtype=float)
    off = [np.random.default_rng(10_000 + seed).normal(size=len(sigma)) * sigma for seed in seeds]
    return [measured(model, np.asarray(truth.G @ x), seed) for x, seed in zip(off, seeds, strict=True)]


def falling(truth: str, withheld: tuple[str, ...], seeds: list[int]) -> list[Experiment]:
    """Tables of falling balls."""
    return [balls(falls(truth, seed), withheld) for seed in seeds]


def falling_cases() -> list[RateCase]:
    """Truths of falling balls, with quadratic drag in the catalogue and without it."""
    return [
        RateCase(f"{truth}; {words}", partial(falling, truth, withheld), (_CLAIMED, _ADOPTED, _RISES))
        for truth in (*NULLS, *DRAGS, *OUTSIDE)
        for words, withheld in (("all effects", ()), ("no quadratic drag", ("quadratic_drag",)))
    ]


def moved_tables(model: LinearSwimmer, place: int, day: int, seeds: list[int]) -> list[Experiment]:
    """Let a number differ on a day of four, by 8 standard deviations of its score over all runs."""
    tables: list[Experiment] = []
    for seed in seeds:
        crossed = in_days(model, _DAYS, seed)
        column = (
            np.concatenate([model.J, model.G], -1)[..., [place]] * (crossed.runs.session == day)[:, None, None]
        )
        length = np.linalg.norm(Signals(crossed, np.ones(len(model.runs), dtype=bool)).rest(column))
        tables.append(measured(crossed, column[..., 0] * (8.0 / max(float(length), 1e-9)), seed))
    return tables


def days_without(model: LinearSwimmer, seeds: list[int]) -> list[Experiment]:
    """The same days, on which nothing differs."""
    return [measured(in_days(model, _DAYS, seed), np.zeros_like(model.prediction), seed) for seed in seeds]


def cases_in_days(model: LinearSwimmer) -> list[RateCase]:
    """Truths in sessions that have runs of every kind."""
    numbers = (*model.coefficients, *model.nuisances)
    listed = [
        RateCase(
            "four days, nothing differs", partial(days_without, model), (_MOVED, _CLAIMED, _ADOPTED), weight=2.0
        )
    ]
    for name in _MOVING:
        place = [p.name for p in numbers].index(name)
        for day in range(_DAYS):
            planted = f"{numbers[place].title} in session day {day + 1}"
            tables = partial(moved_tables, model, place, day)
            listed.append(
                RateCase(
                    f"{name} differs on a day, 8 σ", tables, (_MOVED_NAMED, _MOVED, _CLAIMED), (planted, 0.0), 0.1
                )
            )
    return listed


def linear_cases() -> list[RateCase]:
    """Truths of the stand-in."""
    model = linearised(design())
    sigmas = {p.name: float(p.sigma or 0.0) for p in model.nuisances}
    exact, place = restated(model, {}), [p.name for p in model.nuisances].index("youngs_modulus")
    alone = restated(model, {**sigmas, "youngs_modulus": 0.03})
    of_table = {k: sigmas[k] for k in ("camera_scale", "heading_zero", "tachometer")}
    bare, both = restated(model, {**of_table, "youngs_modulus": 0.03}), (_CLAIMED, _WRONG, _ADOPTED, _RISES)

    def soft(words: str, share: float, given: LinearSwimmer, *asked: str) -> RateCase:
        tables = partial(linear_tables, given, model.G[..., place] * math.log(share))
        return RateCase(words, tables, asked, ("youngs_modulus", share * model.nuisances[place].start))

    listed = [
        RateCase("numbers drawn from their priors", partial(drawn_tables, model, model), both, weight=5.0),
        RateCase("the same, numbers exact", partial(drawn_tables, exact, model), (_CLAIMED,)),
        soft("E off by 10 %", 0.9, model, _CLAIMED),
        soft("E off by 10 %, numbers exact", 0.9, exact, _CLAIMED),
        soft("E off by 20 %", 0.8, model, *both, _COVERED),
        soft("E off by 20 %, numbers exact", 0.8, exact, _CLAIMED),
        soft("E off by 40 %", 0.6, model, *both),
        soft("E off by 20 %, its σ 3 %", 0.8, alone, *both),
        soft("the same, other numbers of the robot exact", 0.8, bare, *both),
    ]
    signals = Signals(model)
    lengths, survived = np.linalg.norm(signals.effects, axis=0), signals.survived(model.D)
    for level in (4.0, 8.0):
        for j, effect in enumerate(model.effects):
            size = level / max(float(lengths[j]), 1e-300)
            if survived[j] >= model.runs.least_surviving and effect.start + size <= effect.bounds[1]:
                tables, planted = partial(linear_tables, model, model.D[..., j] * size), effect.start + size
                label = f"one effect, λ = {level:g}"
                listed.append(RateCase(label, tables, _OF_AN_EFFECT, (effect.name, planted), weight=0.05))
    for label, signal in outside(model).items():
        for level in (8.0, 16.0):
            tables = partial(linear_tables, model, signal * (level / signals.beyond_catalogue(signal)))
            kind = "mimics" if label.startswith("mimic") else "others"
            words = f"outside, three {kind}, size {level:g}"
            listed.append(RateCase(words, tables, (_CLAIMED, _CLAIMED_PLAINLY, _ADOPTED, _RISES), weight=0.5))
    return listed + cases_in_days(model)


def simulated_cases(tables: int) -> list[RateCase]:
    """Truths of the simulator; each effect has the same number of tables, however few are asked for."""
    linear = linearised(design(LENGTHS_CM))
    signals, model = Signals(linear), SwimmerModel(ROBOT, linear.runs)  # type: ignore[arg-type]

    def sizes(effect: Parameter) -> dict[str, float]:
        size = sized(effect, model, signals)
        return {} if size is None else {effect.name: size}

    testable = [
        e
        for e, s in zip(linear.effects, signals.survived(linear.D), strict=True)
        if s >= linear.runs.least_surviving
    ]
    truths = [found for found in map(sizes, testable) if found]
    asked = (*_OF_AN_EFFECT, _UNEXPLAINED, _COVERED)
    return [
        *(RateCase("one effect, λ = 8", partial(simulated, each), asked, next(iter(each.items())), 1 / len(truths))
          for each in truths),
        RateCase("nothing", partial(simulated, {}), (_CLAIMED, _UNEXPLAINED), weight=_NULLS / tables),
        *(RateCase("thinning", partial(simulated, each), asked, (THINNING, each[THINNING]), 0.5 / tables)
          for each in thinning()),
    ]  # fmt: skip


def report(done: list[Result], cases: list[RateCase]) -> None:
    """Print the table."""
    print(heading("case", "tables", "asked", "share (95 %)", "error / noise: median, largest"))
    for case in {case.label: case for case in cases}.values():
        of = [result for result in done if result.label == case.label]
        errors = [result.error for result in of]
        for question in case.asked if of else ():
            said = [result.answers[question] for result in of if question in result.answers]
            if said:
                print(row(case.label, len(said), question, per_cent(sum(said), len(said)),
                          f"{np.median(errors):.2f}, {max(errors):.2f}"))  # fmt: skip
    seconds = [result.seconds for result in done]
    print(f"\nProcessor time of a table: median {np.median(seconds):.1f} s, largest {max(seconds):.1f} s")


def main(truth: str = "linear", tables: str = "100", first: str = "0", chosen: str = "") -> None:
    simulator, seed = truth == "simulator", int(first)
    cases = simulated_cases(int(tables)) if simulator else falling_cases() if truth == "balls" else linear_cases()
    work = []
    for case in cases:
        count, step = max(round(case.weight * int(tables)), 1), 1 if simulator else 37
        seeds = list(range(seed, seed + step * count, step))
        seed += step * count
        if any(word in case.label for word in chosen.split("|")):
            work += [(case, seeds[i : i + _AT_ONCE]) for i in range(0, count, _AT_ONCE)]
    done = in_parallel(results, work)
    report([result for group in done for result in group], cases)
