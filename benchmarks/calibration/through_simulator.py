"""Calibration of tables from the simulator itself, whose truth is stepped in time on a finer mesh.

192 runs of the paper's design with tails of 5 to 11 cm and the noise of `benchmarks.calibration.planted`. The
truth has twice as many edges and half the time step.

    effects     each testable effect at λ = 8, and nothing. λ is what the best coefficients and numbers leave of
                the simulated change
    thinning    a fluid that thins by the local rate of shear: Carreau's exponents n = 0.5 to 0.9, three times

Runs whose truth does not settle in time take the direct solution; they are counted.

Usage: python -m benchmarks through_simulator [TABLES] [FIRST_SEED]      tables on the screen

Takes an hour of one core.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from benchmarks.calibration.operating import judge
from benchmarks.calibration.planted import ROBOT, Case, Design, Signals, design, scatter, stand_in
from benchmarks.markdown import heading, row
from benchmarks.parallel import in_parallel
from benchmarks.proportions import per_cent
from calibration.statistics.residual_tests import TESTABLE
from calibration.statistics.statistical_model import Parameter, prior_rows, start_values, stepped
from calibration.swimmer.swimmer import DIRECT, SwimmerModel
from calibration.verdict.calibrate import calibrate
from sim.arrays import Floats
from sim.motion.batches import stepped_columns

DESIGN = Design(lengths_cm=(5.0, 6.2, 7.4, 8.6, 9.8, 11.0))
LEVEL = 8.0
NULLS = 20
THINNING, TIME = "shear_thinning", "shear_thinning_time"
EXPONENTS = (0.5, 0.6, 0.7, 0.8, 0.9)  # n
TIMES = (-1.0, 0.5, 2.0)  # logarithms, see `sim.effects.shear_thinning_time`
_PASSES = 5


@dataclass(frozen=True)
class Closed:
    """What came out of a table."""

    label: str
    said: str
    judgement: str
    held_out: float  # error on the held-out session over the noise of a run
    calibrated: float  # the same of the model without effects
    seconds: float  # of a processor
    unsettled: int  # conditions whose truth is the direct solution
    size: tuple[float, float] | None  # the effect's interval, over its truth


def truth(sizes: dict[str, float], model: SwimmerModel) -> tuple[Floats, int]:
    """Outputs (n, k) by time stepping on a finer mesh; how many conditions did not settle."""
    unsettled = 0

    def steady(columns: Mapping[str, Floats], **options: Any) -> dict[str, Any]:
        nonlocal unsettled
        answer = stepped_columns(columns, finer=2, **options)
        bad = ~(answer["converged"] & np.isfinite(answer["omega_t_bar"]))
        unsettled = int(bad.sum())
        if bad.any():
            direct = DIRECT.steady({k: v[bad] for k, v in columns.items()}, **options)
            for name, values in answer.items():
                values[bad] = direct[name]
        return answer

    finer = replace(model, solver=DIRECT._replace(steady=steady))
    return np.asarray(finer.predict([{**start_values(model), **sizes}])[0]), unsettled


def sized(effect: Parameter, model: SwimmerModel, signals: Signals) -> float | None:
    """The size at which λ is `LEVEL`; None if it is out of bounds."""
    start = start_values(model)
    size = 0.5 * effect.typical
    for _ in range(_PASSES):
        at = float(np.clip(effect.start + size, *effect.bounds))
        level = strength(model.predict([{**start, effect.name: at}])[0], model, signals)
        if abs(level / LEVEL - 1) < 0.03:
            return at
        size = at - effect.start
        size *= min(max(LEVEL / max(level, 1e-3), 0.1), 10.0)
    return None


def strength(outputs: Floats, model: SwimmerModel, signals: Signals) -> float:
    """λ: what the best coefficients and nuisance parameters leave of outputs (n, k) without noise, in σ."""
    fitted = (*model.coefficients, *model.nuisances)
    names, used = [p.name for p in fitted], signals.used
    parameters, unabsorbed = start_values(model), np.zeros(0)
    for _ in range(_PASSES):
        prediction, J = model.derivatives(parameters, names)
        rows, pull = prior_rows(fitted, parameters)
        columns = np.concatenate([signals.white(J[used]), rows])
        values = np.concatenate([signals.white((outputs - prediction)[used]), pull])
        step = np.linalg.lstsq(columns, values, rcond=None)[0]
        unabsorbed = values - columns @ step
        parameters = stepped(fitted, parameters, step)
    return float(np.linalg.norm(unabsorbed))


def closed(label: str, sizes: dict[str, float], seeds: list[int]) -> list[Closed]:
    """A truth, with several draws of the noise."""
    model = SwimmerModel(ROBOT, design(DESIGN), jobs=1)
    outputs, unsettled = truth(sizes, model)
    tables = []
    for seed in seeds:
        y = outputs + scatter(model.runs, outputs.shape[1], seed)
        began = time.process_time()
        verdict = calibrate(replace(model, runs=replace(model.runs, y=y)), progress=False)
        seconds = time.process_time() - began
        start = start_values(model)
        case = Case(label, {k: v - start[k] for k, v in sizes.items() if k != TIME}, outputs)
        name = next(iter(case.sizes), "")
        size = None
        if name in verdict.final.names:
            low, high = verdict.final.interval(name)
            size = (low / sizes[name], high / sizes[name])
        noise = verdict.noise_ceiling
        errors = verdict.error_after / noise, verdict.error_before / noise
        said = " or ".join("+".join(e.name for e in c.claimed) for c in verdict.explaining)
        said = said or verdict.verdict
        tables.append(Closed(label, said, judge(verdict, case), *errors, seconds, unsettled, size))
    return tables


def planned(tables: int, first: int) -> list[tuple[str, dict[str, float], list[int]]]:
    """Label, sizes and seeds of every truth."""
    linear = stand_in(DESIGN)
    signals = Signals(linear)
    survived = signals.survived(linear.D)
    model = SwimmerModel(ROBOT, linear.runs)  # type: ignore[arg-type]
    testable = [e for e, s in zip(linear.effects, survived, strict=True) if s >= TESTABLE]
    sizes = {e.name: sized(e, model, signals) for e in testable}
    truths = [(name, {name: size}) for name, size in sizes.items() if size is not None]
    repeats = -(-tables // len(truths))
    work = []
    for i, (name, sizes_of_truth) in enumerate(truths):
        work.append((f"{name}, λ = 8", sizes_of_truth, [first + repeats * i + k for k in range(repeats)]))
    seed = first + repeats * len(truths)
    work.append(("null", {}, list(range(seed, seed + NULLS))))
    seed += NULLS
    for n in EXPONENTS:
        for log_time in TIMES:
            sizes_of_truth = {THINNING: 1 - n, TIME: log_time}
            work.append((f"thinning, n = {n:g}, time {log_time:g}", sizes_of_truth, [seed]))
            seed += 1
    return work


def _summary(label: str, results: list[Closed]) -> str:
    right = sum(r.judgement in ("exact", "in the set", "none") for r in results)
    wrong = sum(r.judgement in ("wrong", "number") or r.judgement.startswith("claimed") for r in results)
    ratio, before = (np.median([getattr(r, k) for r in results]) for k in ("held_out", "calibrated"))
    shares = (per_cent(count, len(results)) for count in (right, wrong))
    return row(
        label, len(results), *shares, f"{before:.2f}", f"{ratio:.2f}", f"{max(r.held_out for r in results):.2f}"
    )


def report(results: list[Closed]) -> None:
    """Print the tables."""
    print(heading("truth", "verdicts", "calibrated error / noise", "with effects", "size over truth"))
    for label in dict.fromkeys(r.label for r in results):
        of = [r for r in results if r.label == label]
        said = ", ".join(dict.fromkeys(f"{r.said} ({r.judgement})" for r in of))
        sizes = "; ".join(f"{r.size[0]:.2f} to {r.size[1]:.2f}" for r in of if r.size)
        errors = (f"{np.median([getattr(r, kind) for r in of]):.2f}" for kind in ("calibrated", "held_out"))
        print(row(label, said, *errors, sizes))
    columns = ("truth", "tables", "right (95 %)", "wrong (95 %)", "calibrated", "median error / noise", "largest")
    print(f"\n{heading(*columns)}")
    for label, start in (("one effect, λ = 8", ""), ("nothing", "null"), ("local thinning", "thinning")):
        of = [r for r in results if r.label.startswith(start)]
        if not start:
            of = [r for r in results if r.label.endswith("λ = 8")]
        print(_summary(label, of))
    inside = [r.size[0] <= 1 <= r.size[1] for r in results if r.size and r.judgement == "exact"]
    print(f"\nIntervals of effects that were named alone contain the truth: {per_cent(sum(inside), len(inside))}")
    seconds = [r.seconds for r in results]
    print(f"Processor time of a table: median {np.median(seconds):.0f} s, largest {max(seconds):.0f} s")
    by_truth = {r.label: r.unsettled for r in results if r.unsettled}
    print(f"Conditions that did not settle: {by_truth or 'none'}")


def main(tables: str = "100", first: str = "0") -> None:
    work = planned(int(tables), int(first))
    done = in_parallel(closed, work)
    report([r for group in done for r in group])
