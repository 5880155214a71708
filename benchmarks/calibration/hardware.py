"""Tables of laboratories where hardware is off: what the calibration names.

Forty tables by a solver of its own, whose tails may differ (`tests.oracles.harmonic_balance`), of 108 runs:
two to four tails of 7, 9.5 and 12 cm, two speeds, both directions, trials on three of four days. Noise 2.5 %,
session scatter 0.5 %, coefficients drawn for each table.

"Named": alone, in a set, as what differs in these runs, or as the form that is adopted; where nothing can be
named, nothing is. "Warned": something else is claimed, with a reservation.

Usage: python -m benchmarks hardware [FILE] [CASE] [SEED]     FILE: of records, to continue with

Takes a quarter of an hour to two hours of one core.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from benchmarks.common import Records, heading, in_parallel, per_cent, row
from calibration.verdict.verdict import Verdict
from sim.model.presets import PRESETS
from sim.model.robot import Robot
from softflagella.closed_loop import calibrate
from tests.oracles.harmonic_balance import settle_in_harmonics
from tests.oracles.plain_swimmer import NOMINAL, Hardware

NOISE, SESSION, DAYS = 0.025, 0.005, 4
GIVEN = replace(PRESETS["paper-measured"], C_t=3.0, C_r=2.0, C_yr=3.0)
DESIGN = [(N, cm, rpm) for N in (2, 3, 4) for cm in (7.0, 9.5, 12.0) for rpm in (100.0, 150.0)]
_CURRENT = 0.2  # cm/s
Change = Callable[[Robot], tuple[Robot, Hardware]]


class HardwareCase(NamedTuple):
    """What is off."""

    label: str
    tables: int
    change: Callable[[float], Change]
    sizes: tuple[float, float]  # of the first table and of the last
    named: tuple[str, ...]  # words of what names it, one of them
    days: tuple[int, ...] = (1, 2, 3, 4)  # when it is off


def _tails(**hardware: Callable[[float], Any]) -> Callable[[float], Change]:
    return lambda size: lambda robot: (robot, Hardware(**{name: of(size) for name, of in hardware.items()}))


def _clamps(size: float) -> Change:
    """The same turn for a moment with tails of all lengths; `size` in l/EI for 11 cm."""
    return lambda robot: (robot, Hardware(compliance=size * 0.11 / robot.tail_length))


def _layers(size: float) -> Change:
    return lambda robot: (robot, Hardware(stratification=size * robot.tail_length / robot.head_radius))


def _weight(size: float) -> Change:
    """Immersion up to R sin β, as the paper's model of the side force has it."""

    def change(robot: Robot) -> tuple[Robot, Hardware]:
        level = math.asin(0.7)
        deeper = size * robot.tails * robot.tail_length / 0.22
        arc, side = 1 + deeper / (math.pi / 2 + level), math.cos(level + deeper) / math.cos(level)
        return replace(robot, C_t=robot.C_t * arc, C_r=robot.C_r * arc, C_yr=robot.C_yr * side), NOMINAL

    return change


def _numbers(**factors: float) -> Callable[[float], Change]:
    """Each number times 1 + factor × size."""
    return lambda size: lambda robot: (
        replace(robot, **{name: getattr(robot, name) * (1 + f * size) for name, f in factors.items()}), NOMINAL
    )  # fmt: skip


CASES = (
    HardwareCase("nothing", 6, _numbers(), (0, 0), ()),
    HardwareCase("one tail shorter", 4, _tails(lengths=lambda x: (1 - x,)), (0.15, 0.3), ("one_tail_shorter",)),
    HardwareCase("one tail softer", 3, _tails(stiffness=lambda x: (1 - x,)), (0.3, 0.6), ("one_tail_softer",)),
    HardwareCase(
        "a tail lost on day 3", 3, _tails(lengths=lambda x: (0.0,)), (1, 1), ("since session day3",), (3, 4)
    ),
    HardwareCase("clamps that give", 4, _clamps, (0.1, 0.3), ("root_compliance",)),
    HardwareCase("disc tilted, degrees", 3, _tails(tilt=math.radians), (4, 8), ()),
    HardwareCase("bubbles on day 3", 3, _numbers(C_r=-1), (0.15, 0.25), ("C_r in session day3",), (3,)),
    HardwareCase(
        "another robot from day 3 on", 3, _numbers(youngs_modulus=1, C_yr=-0.6), (0.2, 0.3), ("day3",), (3, 4)
    ),
    HardwareCase("camera turned on day 3", 3, _numbers(), (0, 0), ("course", "current_along"), (3, 4)),
    HardwareCase("viscosity that falls with depth", 4, _layers, (0.05, 0.15), ("stratified_viscosity",)),
    HardwareCase("immersion by the tails' weight", 4, _weight, (0.03, 0.1), ("immersion_by_weight",)),
)


def make_table(case: HardwareCase, place: int, seed: int) -> pd.DataFrame:
    """Make a table; `place`: of the table in its case."""
    rng = np.random.default_rng(seed)
    size = float(np.linspace(*case.sizes, case.tables)[place])
    drawn = zip(("C_t", "C_r", "C_yr"), (2.6, 2.0, 3.2), np.exp(rng.normal(scale=0.15, size=3)), strict=True)
    truth = replace(GIVEN, **{name: value * factor for name, value, factor in drawn})
    shifts = rng.normal(scale=SESSION, size=(DAYS + 1, 6))
    turned = case.label.startswith("camera")
    rows = []
    for N, cm, rpm in DESIGN:
        days = [rng.permutation(DAYS)[:3] + 1 for _ in (1, -1)]
        robot = replace(truth, tails=N, tail_length=cm / 100, motor_speed=rpm * math.pi / 30)
        seen = {
            off: _seen(*(case.change(size)(robot) if off else (robot, NOMINAL))) for off in _states(case, days)
        }
        for sign, trials in zip((1, -1), days, strict=True):
            for day in trials:
                values = seen[day in case.days] * np.exp(NOISE * rng.normal(size=6) + shifts[day])
                course = rng.uniform(0, 360)
                rows.append(
                    {"N": N, "l_cm": cm, "omega_rpm": sign * rpm, "session": f"day{day}", "day": day}
                    | {"omega_h_rpm": -sign * values[0], "omega_t_rpm": sign * values[1]}
                    | {"omega_yr_rad_s": sign * values[2], "R_yr_cm": values[3]}
                    | {"theta_deg": seen[day in case.days][4] + math.degrees(NOISE) * rng.normal()}
                )
                if turned:
                    rows[-1]["v_cm_s"] = values[5] + _CURRENT * math.cos(math.radians(course))
                    rows[-1]["R_yr_cm"] *= rows[-1]["v_cm_s"] / values[5]  # the radius of the path that is seen
                    rows[-1]["course_deg"] = (course + 90 * (day in case.days)) % 360
    table = pd.DataFrame(rows).sample(frac=1, random_state=seed).sort_values("day", kind="stable")
    return table.assign(elapsed_min=4.0 * np.arange(len(table)) + 1000 * table["day"]).drop(columns="day")


def _states(case: HardwareCase, days: list[Any]) -> set[bool]:
    return {day in case.days for trials in days for day in trials.tolist()}


def _seen(robot: Robot, hardware: Hardware) -> np.ndarray:
    """Spins [rpm], yaw rate [rad/s], R_yr [cm], θ [°], v [cm/s], extrapolated from 8 and 16 edges."""
    coarse, fine = (settle_in_harmonics(robot.groups(), hardware, edges=edges) for edges in (8, 16))
    spin, yaw, sway, surge = (4 * fine - coarse) / 3 / robot.time_scale
    speed = math.hypot(sway, surge) * robot.tail_length * 100
    rpm = 30 / math.pi
    return np.array(
        [
            (robot.motor_speed - spin) * rpm,
            spin * rpm,
            yaw,
            speed / yaw,
            math.degrees(math.atan2(sway, surge)),
            speed,
        ]
    )


def answer(verdict: Verdict, case: HardwareCase) -> str:
    """Say whether a verdict names what is off."""
    claims = (*verdict.claims, *verdict.attribution.rival_effects)
    names = [e.name for c in claims for e in c.added] + [move["words"] for move in verdict.facts["moves"]]
    claimed = bool(names) or bool(verdict.wrong_numbers)
    names += [verdict.nearest.effect.name] if verdict.nearest else []  # a description, and no claim
    if any(word in name for word in case.named for name in names) or not (case.named or claimed):
        return "named"
    if not claimed:
        return "silent"
    in_form = set(verdict.in_form_only)  # "something in form like"
    sure = [c for c in verdict.claims if not (c.doubts or in_form & {e.name for e in c.added})]
    return "wrong" if len(sure) == len(verdict.claims) == 1 or not claims else "warned"


def calibrated(case: HardwareCase, place: int, seed: int) -> dict[str, Any]:
    """Calibrate one table."""
    table = make_table(case, place, seed)
    began = time.process_time()
    verdict = calibrate(table, GIVEN, progress=False, jobs=1)
    return {
        "seed": seed, "case": case.label, "answer": answer(verdict, case), "kind": verdict.verdict,
        "seconds": time.process_time() - began, "sentence": verdict.sentence,
        "errors": [verdict.error_before, verdict.error_after],
    }  # fmt: skip


def main(file: str = "", only: str = "", seed: str = "43000") -> None:
    """Print what is named in each case."""
    records = Records(file)
    for number, case in enumerate(CASES):
        if only in case.label:
            seeds = [(case, place, int(seed) + 100 * number + place) for place in range(case.tables)]
            for record in in_parallel(calibrated, [s for s in seeds if s[2] not in records]):
                records.add(record)
    print(heading("what is off", "tables", "named", "silent", "warned", "wrong", "longest"))
    for label in (*(case.label for case in CASES), "all"):
        of = [r for r in records.all if label in ("all", r["case"])]
        if of:
            counts = [sum(r["answer"] == a for r in of) for a in ("named", "silent", "warned", "wrong")]
            named = per_cent(counts[0], len(of)) if label == "all" else counts[0]
            print(row(label, len(of), named, *counts[1:], f"{max(r['seconds'] for r in of):.0f} s"))
