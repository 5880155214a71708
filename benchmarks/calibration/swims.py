"""Calibrations from one swim: claims, intervals, and the error on the path of the plan that is made anew.

Robots with two to five tails, as labs have them, plan a path of 8 to 16 l and swim it open loop
(`tests.oracles.drawn_swims`). Each swims twice: with nothing hidden, and with an effect of the catalogue or
another influence at λ = 8 (`tests.oracles.swim_scores`). What is not plausible at that size is not planted, nor
what takes minutes to replay.

Then the path is planned with the verdict, and with the truth, and both plans are swum without noise and kicks.
Errors are root mean squares of the distance from the path as drawn; a plan states the largest distance from the
path that it follows.

Usage: python -m benchmarks swims [ROBOTS] [FIRST_SEED] [FILE]
       FILE: JSON lines, a swim each; a run goes on where the file ends.

Takes two minutes a robot.
"""

from __future__ import annotations

import time
from contextlib import suppress
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

import softflagella as sf
from benchmarks.common import Records, as_they_end, heading, per_cent, row, two_quantiles
from calibration.swimmer.influences import TRACKED_POINT, influences
from calibration.verdict.verdict import Verdict
from common.errors import InputError
from planner.planning.plan import Plan
from sim.knowledge import COEFFICIENTS, CalibrationKnowledge
from sim.model.robot import Robot
from sim.motion.warm import compile_once
from tests.oracles.drawn_swims import LabSwim, drawn_swim
from tests.oracles.swim_scores import SwimScores
from tests.oracles.swims import CameraNoise, make_track

_NOTHING, _EFFECT = "nothing", "an effect, λ = 8"
_STRENGTH, _NEAR = 8.0, 1.3  # λ; error, over that with the truth known
_SLOW = (
    "free_surface", "head_flow", "rate_dependent_modulus", "tail_contact", "tail_interaction", "tail_spin_drag",
)  # fmt: skip
_EXACT = CameraNoise(white=(0.0, 0.0), slow=(0.0, 0.0))
_ASKED = {
    "claimed": "an effect is claimed",
    "alone": "right, alone",
    "right": "right, or in the set",
    "wrong": "wrong alone",
    "number": "a number is wrong",
    "unexplained": "unexplained",
    "near": f"error at most {_NEAR} times that with the truth known",
    "stated": "the stated error holds",
}


def hidden(swim: LabSwim, seed: int) -> tuple[str, Robot]:
    """Choose an effect that one swim can show; return its name and the robot with it."""
    rng, scores = np.random.default_rng([seed, 1]), SwimScores(swim)
    names = [n for n, i in influences().items() if i.needs is None and n not in (TRACKED_POINT, *_SLOW)]
    for name in rng.permutation(names).tolist():
        with suppress(InputError):  # the simulation fails
            robot = scores.sized(name, int(rng.choice([-1, 1])), _STRENGTH)
            if robot is not None:
                return name, robot
    raise InputError("no effect shows")


def error(truth: Robot, plan: Plan, swim: LabSwim) -> tuple[float, bool]:
    """Compute how far from the path the truth swims a plan, without noise and kicks [m]; is it as stated?"""
    found = sf.check(plan, make_track(truth, plan, seed=0, camera=_EXACT, current=swim.disturbed["current"]))
    return float(found.raw_rms * plan.robot.length_scale), bool(found.largest <= plan.stated_error)


def answers(verdict: Verdict, truth: Robot, term: str) -> dict[str, Any]:
    """Say whether a verdict names what is hidden, and whether intervals hold the true coefficients."""
    sets = [{e.name for e in c.added} for c in verdict.claims]
    every = [*sets, *({e.name for e in c.added} for c in verdict.attribution.rival_effects)]
    intervals = [(getattr(truth, name), *verdict.final_intervals[name]) for name in COEFFICIENTS]
    return {
        "verdict": verdict.verdict,
        "named": sorted(set().union(*every)),
        "claimed": bool(sets),
        "alone": every == [{term}],
        "right": any(term in each for each in every),
        "wrong": len(every) == 1 and term not in every[0],
        "number": verdict.verdict == "number",
        "unexplained": verdict.verdict == "unexplained",
        "covered": [bool(low <= value <= high) for value, low, high in intervals],
    }


def said(case: str, seed: int) -> dict[str, Any]:
    """Draw a swim, and say what its verdict is worth."""
    threadpool_limits(1)
    swim, began = drawn_swim(seed), time.process_time()
    record: dict[str, Any] = {"swim": f"{case} {seed}", "case": case, "term": ""}
    try:
        term, truth = hidden(swim, seed) if case == _EFFECT else ("", swim.truth)
        track = make_track(truth, swim.plan, seed=seed, **swim.disturbed)
        record |= {"term": term, "size": truth.effects.get(term), "tails": truth.tails,
                   "dwells": len(swim.plan.dwells), "as_given": error(truth, swim.plan, swim)[0]}  # fmt: skip
        began = time.process_time()
        verdict: Any = sf.calibrate(track, swim.given, plan=swim.plan, seed=seed, jobs=1, progress=False)
        record |= {"seconds": time.process_time() - began} | answers(verdict, swim.truth, term)
        known = CalibrationKnowledge(current=swim.disturbed["current"])
        again, stated = error(truth, sf.plan(swim.path, verdict, unit="m"), swim)
        best, _ = error(truth, sf.plan(swim.path, truth, unit="m", knowledge=known), swim)
    except Exception as failure:
        return (
            {"seconds": time.process_time() - began} | record | {"failed": f"{type(failure).__name__}: {failure}"}
        )
    return record | {"again": again, "best": best, "near": again <= _NEAR * best, "stated": stated}


def line(label: str, part: list[dict[str, Any]]) -> str:
    """Format the figures of some swims."""
    of = {key: [each for each in part if key in each] for key in (*_ASKED, "covered")}
    shares = [per_cent(sum(each[key] for each in of[key]), len(of[key])) if of[key] else "" for key in _ASKED]
    held = [hit for each in of["covered"] for hit in each["covered"]]
    ratio = two_quantiles([each["again"] / each["best"] for each in of["near"]]) if of["near"] else ""
    errors = [f"{1e3 * np.median([each[key] for each in of['near']]):.1f}" for key in ("as_given", "again", "best")
              if of["near"]]  # fmt: skip
    failed = sum("failed" in each for each in part)
    covered = per_cent(sum(held), len(held)) if held else ""
    return row(label, len(part), failed, *shares, covered, ratio, ", ".join(errors))


def report(records: list[dict[str, Any]]) -> None:
    """Print the table: a row for each case, and for each effect."""
    print(heading("case", "swims", "failed", *_ASKED.values(), "intervals of C hold",
                  "error over that with the truth known: median / 95 %",
                  "error as given, again, with the truth known: medians [mm]"))  # fmt: skip
    for case in (_NOTHING, _EFFECT):
        whole = [each for each in records if each["case"] == case]
        print(line(case, whole))
        for term in sorted({each["term"] for each in whole} - {""}):
            print(line(f"… {term}", [each for each in whole if each["term"] == term]))
    seconds = [each["seconds"] for each in records]
    print(f"\nProcessor time of a calibration: median {np.median(seconds):.0f} s, largest {max(seconds):.0f} s")
    for each in records:
        if "failed" in each:
            print(f"{each['swim']}: {each['failed']}")


def main(robots: str = "20", first: str = "0", file: str = "") -> None:
    compile_once()
    records = Records(file, key="swim")
    seeds = range(int(first), int(first) + int(robots))
    work = [(case, seed) for seed in seeds for case in (_NOTHING, _EFFECT) if f"{case} {seed}" not in records]
    for record in as_they_end(said, work):
        records.add(record)
    report(records.all)
