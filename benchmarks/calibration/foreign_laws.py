"""Laws that the search for laws does not contain: is a wrong place named, and is the description good?

Tables of 192 runs at four motor speeds (truth on a finer mesh and step, 2.5 % noise). One seed after the other has

    two places   two terms on the head, each with a power law of its own, each of score λ
    resonance    a term on the head times γ²/((ω − ω0)² + γ²), ω0 from 90 to 140 rpm, γ from 5 to 15 rpm
    threshold    a term on the head times (ω/ω0 − 1) above ω0, from 85 to 130 rpm, and nothing below
    drift        a term on the head that grows fourfold in four steps in the course of each session
    tail load    a steady force per length on the tails along the axis, times a power law

with λ = 16 or 32 (`benchmarks.calibration.law_truths`). A place is wrong if it is true for nothing of the truth;
for a resonance the place of its term is right, for a load on the tails along the axis every force along the axis.
A wrong place is named confidently if no other is named beside it.
FILE keeps the records, and those that it has are not made again.

Usage: python -m benchmarks foreign_laws [TABLES] [FIRST_SEED] [FILE]

Takes a minute a table.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from benchmarks.calibration.law_truths import NULL, Setting, head_places, record_of, with_noise
from benchmarks.calibration.planted import ROBOT
from benchmarks.markdown import heading, row
from benchmarks.proportions import per_cent
from benchmarks.records import Records
from calibration.laws.places import Place
from calibration.report.robot_laws import find_robot_laws
from calibration.swimmer.swimmer import SwimmerModel
from calibration.swimmer.synthetic_table import make_table
from sim.arrays import Floats
from sim.effects import catalogue
from sim.io.errors import InputError
from sim.model.effect import Effect
from sim.model.power_law import Powers
from sim.model.presets import PRESETS

if TYPE_CHECKING:
    from sim.model.body import Body
    from sim.model.groups import Groups

DESIGN: dict[str, Any] = {"lengths_cm": (5.0, 7.5, 10.0), "motor_rpm": (80.0, 100.0, 125.0, 150.0)}
KINDS = ("two places", "resonance", "threshold", "drift", "tail load")
_SCORES = (16.0, 32.0)
_GOOD = 1.3  # error over noise
_STEPS = 4  # of a drift


def main(tables: str = "20", first_seed: str = "5000", file: str = "") -> None:
    setting = Setting.of(**DESIGN)
    records = Records(file)
    for seed in range(int(first_seed), int(first_seed) + int(tables)):
        if seed in records:
            continue
        began = time.process_time()
        try:
            kind, score, true, table = foreign(setting, seed)
        except InputError as reason:
            print(f"{seed}: not made: {reason}", flush=True)
            continue
        described = find_robot_laws(table, PRESETS["paper-measured"], seed=seed, progress=False)
        record = {"seed": seed, "kind": kind, "score": score, "true": true, **record_of(described)}
        records.add(record)
        print(f"{seed} {kind}, λ = {score:g}, {' + '.join(true)} -> {_said(record)}; {record['before']:.2f} -> "
              f"{record['after']:.2f}, {time.process_time() - began:.0f} s", flush=True)  # fmt: skip
    columns = ("truth", "tables", "described", "with a true place among those named", "a wrong place alone",
               "several, all wrong", "error before", "error after, median (largest)")  # fmt: skip
    print("\n" + heading(*columns))
    for kind in (*KINDS, "all"):
        print(_row(kind, [one for one in records.all if kind in (one["kind"], "all")]))
    described_records = [one for one in records.all if one["complete"]]
    wrong = [one for one in described_records if not set(one["kept"]) & set(one["true"])]
    alone = sum(len(one["kept"]) == 1 for one in wrong)
    good = sum(one["after"] <= _GOOD for one in described_records)
    count = len(records.all)
    print(f"\na wrong place is named alone: {per_cent(alone, count)}; all that are named are wrong: "
          f"{per_cent(len(wrong), count)}")  # fmt: skip
    print(f"error on the held-out runs at most {_GOOD:g} times the noise, or not described: "
          f"{per_cent(count - len(described_records) + good, count)}")  # fmt: skip


def _row(kind: str, ones: list[dict[str, Any]]) -> str:
    described = [one for one in ones if one["complete"]]
    right = [one for one in described if set(one["kept"]) & set(one["true"])]
    alone = [one for one in described if one not in right and len(one["kept"]) == 1]
    after = [one["after"] for one in described]
    return row(kind, len(ones), len(described), len(right), len(alone), len(described) - len(right) - len(alone),
               f"{np.median([one['before'] for one in ones]):.2f}" if ones else "-",
               f"{np.median(after):.2f} ({np.max(after):.2f})" if after else "-")  # fmt: skip


def _said(record: Mapping[str, Any]) -> str:
    if not record["kept"]:
        return "no law"
    names = ", ".join(record["kept"])
    return names if record["complete"] else f"not the whole residual, the nearest {names}"


def foreign(setting: Setting, seed: int) -> tuple[str, float, list[str], pd.DataFrame]:
    """Make a table; return the kind of its truth, its score and the places that are true, too."""
    rng, design = np.random.default_rng(seed), setting.design
    kind = KINDS[seed % len(KINDS)]
    score = float(_SCORES[seed // len(KINDS) % len(_SCORES)])
    terms = [place for place in head_places() if place.is_term]
    chosen = [terms[i] for i in rng.choice(len(terms), 2, replace=False)]
    sign = rng.choice([-1.0, 1.0], 2)
    powers = [Powers(*rng.uniform(-1, 1, 3)) for _ in chosen]
    if kind == "two places":
        sizes = {}
        for place, law, way in zip(chosen, powers, sign, strict=True):
            signal = setting.slope(place) * np.exp(setting.logarithm(law))[:, None]
            sizes[place.effect(law).name] = way * score / setting.score(signal)
        return kind, score, [place.name for place in chosen], make_table(
            replace(ROBOT, effects=sizes), seed=seed, title="", **design
        )  # fmt: skip
    if kind == "tail load":
        with _known(TailLoad.of(powers[0])) as effect:
            model = SwimmerModel(ROBOT, setting.model.runs)
            slope = model.derivatives({**setting.base.parameters, effect.name: 0.0}, [effect.name])[1][..., 0]
            robot = replace(ROBOT, effects={effect.name: sign[0] * score / setting.score(slope)})
            along = [place.name for place in terms if place.wrench == "Fz"]
            return kind, score, along, make_table(robot, seed=seed, title="", **design)
    factor = _factor(kind, setting, rng)
    size = sign[0] * score / setting.score(setting.slope(chosen[0]) * factor[:, None])
    return kind, score, [chosen[0].name], with_noise(_exact(setting, chosen[0], size * factor), seed)


def _factor(kind: str, setting: Setting, rng: np.random.Generator) -> Floats:
    """Compute the factor of every run (n,), which is no power law."""
    speed = setting.table["omega_rpm"].abs().to_numpy()
    if kind == "resonance":
        middle, width = rng.uniform(90, 140), rng.uniform(5, 15)
        return np.asarray(width**2 / ((speed - middle) ** 2 + width**2))
    if kind == "threshold":
        return np.maximum(speed / rng.uniform(85, 130) - 1, 0.0)
    place = setting.table.groupby("session").cumcount().to_numpy()
    count = setting.table.groupby("session")["run"].transform("count").to_numpy()
    return np.asarray(1.0 + _STEPS * place // count) / _STEPS


def _exact(setting: Setting, place: Place, sizes: Floats) -> pd.DataFrame:
    """Make a table without noise, in which a term on the head has a size of its own in every run (n,)."""
    name = place.effect(Powers()).name
    exact, design = setting.table.copy(), setting.design
    for size in np.unique(sizes):
        robot = replace(ROBOT, effects={name: float(size)})
        table = make_table(robot, seed=NULL, noise=0.0, session_noise=0.0, title="", **design)
        exact[sizes == size] = table[sizes == size]
    return exact


@dataclass(frozen=True)
class TailLoad(Effect):
    """b = ε (EI/l³) m e_z, a force per length on the tails along the axis."""

    powers: Powers = field(default_factory=Powers)

    @classmethod
    def of(cls, powers: Powers) -> TailLoad:
        """Make it with a power law m."""
        return cls(
            name="tail_load_along_the_axis", title="load on the tails along the axis",
            equation="b = ε (EI/l³) m e_z", source="none: a truth for a benchmark", unit="EI/l³", null=0.0,
            bounds=(-100.0, 100.0), typical=0.1,
            symmetry="even", dissipative=False, powers=powers,
        )  # fmt: skip

    def adds(self, size: Floats, groups: Groups, body: Body) -> Body:
        load = size * np.exp(self.powers.logarithm(groups))
        return body.plus(tail_load=np.stack([0.0 * load, 0.0 * load, load]))


@contextmanager
def _known(effect: Effect) -> Iterator[Effect]:
    """Let the simulator know an effect for a while; the search for laws must not."""
    catalogue()[effect.name] = effect
    try:
        yield effect
    finally:
        del catalogue()[effect.name]
