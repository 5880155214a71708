"""Effects of the catalogue whose names are withheld: which law describes each of them?

Tables of 128 runs by `softflagella calibration simulate` (truth on a finer mesh, 2.5 % noise), one for each effect
that they can test. Its size has a score of 16, or is the largest that the effect or the simulator allows. The
search knows places and power laws alone. An influence on what is seen is added to the outputs of a table with
nothing missing. FILE keeps the records, and those that it has are not made again.

Usage: python -m benchmarks renamed_effects [EFFECTS] [FIRST] [FILE]

Takes half an hour.
"""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np
import pandas as pd

from benchmarks.calibration.law_truths import NULL, Setting, record_of, with_noise
from benchmarks.calibration.planted import ROBOT
from benchmarks.markdown import heading, row
from benchmarks.records import Records
from calibration.report.robot_laws import find_robot_laws
from calibration.statistics.statistical_model import Parameter
from calibration.swimmer.measured_table import OUTPUTS
from calibration.swimmer.synthetic_table import make_table
from sim.effects import catalogue
from sim.io.errors import InputError
from sim.model.presets import PRESETS

_SCORE = 16.0
_SEED = 3000
_SMALLER = 0.5  # factor on a size with which the motion is not steady
_ATTEMPTS = 4


def main(effects: str = "100", first: str = "0", file: str = "") -> None:
    records = Records(file, key="effect")
    setting = Setting.of()
    for number, effect in list(enumerate(setting.model.effects))[int(first) : int(first) + int(effects)]:
        if effect.name in records:
            continue
        began = time.process_time()
        seed = _SEED + number
        try:
            table, size, score = _planted(setting, effect, seed)
        except InputError as reason:
            print(f"not made: {reason}", flush=True)
            continue
        described = find_robot_laws(table, PRESETS["paper-measured"], seed=seed, progress=False)
        seconds = time.process_time() - began
        records.add({"effect": effect.name, "seed": seed, "size": size, "score": score, "seconds": seconds,
                     **record_of(described)})  # fmt: skip
        print(f"{effect.name} = {size:.3g} (λ = {score:.1f}): {described.sentence} {seconds:.0f} s", flush=True)
    print("\n" + heading("effect", "λ", "law", "not told apart from", "error before", "error after"))
    for one in records.all:
        words = one["words"]
        if not words:
            words = "none" if one["p_value"] < setting.study.level else "the residual is within the noise"
        elif not one["complete"]:
            words = f"not described; the nearest is {words}"
        print(row(one["effect"], f"{one['score']:.0f}", words, ", ".join(one["kept"][1:]) or "-",
                  f"{one['before']:.2f}", f"{one['after']:.2f}" if one["kept"] else "-"))  # fmt: skip
    count = len(records.all)
    complete = sum(one["complete"] for one in records.all)
    alone = sum(one["complete"] and len(one["kept"]) == 1 for one in records.all)
    print(f"\n{complete} of {count} are described by a law, {alone} of them by one alone")


def _planted(setting: Setting, effect: Parameter, seed: int) -> tuple[pd.DataFrame, float, float]:
    """Make a table with an effect; return its size and its score, too."""
    second = {effect.second.name: effect.second.grid[len(effect.second.grid) // 2]} if effect.second else {}
    slope = setting.model.derivatives({**setting.base.parameters, **second}, [effect.name])[1][..., 0]
    unit = setting.score(slope)
    low, high = effect.bounds
    size = _SCORE / unit
    if size > high - effect.start and effect.start - low > high - effect.start:
        size = -size
    size = float(np.clip(size, low - effect.start, high - effect.start))
    for _ in range(_ATTEMPTS):
        try:
            sizes = {effect.name: effect.start + size, **second}
            if effect.name in catalogue():
                table = make_table(replace(ROBOT, effects=sizes), seed=seed, title="")
            else:
                table = _observed(setting, sizes, seed)
            return table, sizes[effect.name], abs(size) * unit
        except InputError:
            size *= _SMALLER
    raise InputError(f"{effect.name}: no size was found with which the motions are steady")


def _observed(setting: Setting, sizes: dict[str, float], seed: int) -> pd.DataFrame:
    """Make a table with an influence on what is seen: the model's change of the outputs, added to exact ones."""
    exact, model = make_table(ROBOT, seed=NULL, noise=0.0, session_noise=0.0, title=""), setting.model
    with_it, without = model.predict([{**setting.base.parameters, **sizes}, setting.base.parameters])
    for name, change in zip(model.runs.outputs, (with_it - without).T, strict=True):
        column, factor, _ = OUTPUTS[name]
        exact[column] = exact[column] + change / factor if name == "theta" else exact[column] * np.exp(change)
    return with_noise(exact, seed)
