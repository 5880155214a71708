"""The choice among the places of laws, counted: p-values without a law, and with one how often the first is right.

Tables of `hidden_laws`, with nothing missing or with a law on the head at λ = 8 or 12. The toy is the robot of the
tests, with straight tails and a balance in closed form, for numbers of tables that the simulator cannot make in an
hour.

- Without a law: p-values of the search (uniform if they are right); how often a law is claimed, with the p-value
  of the search and without it. The general tests of the residual come before the search.
- With a law: how often it is claimed, and in what share of them the place with the largest gain is the true one,
  beside the share of bootstrap tables in which this place ranks first.
- Coverage of intervals of exponents, as given and widened to be simultaneous over all places: of the true ones
  where the true place has the largest gain, and of those that the runs without noise give at the place with the
  largest gain, whichever it is.

FILE keeps the records, and those that it has are not made again.

Usage: python -m benchmarks searched_laws [toy|simulator] [TABLES] [LAWS] [FIRST_SEED] [FILE]

Takes twenty minutes for the toy, and ten seconds a table of the simulator.
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd
import pytest

from benchmarks.calibration.law_truths import Setting, hidden_law
from benchmarks.calibration.planted import ROBOT
from benchmarks.proportions import per_cent
from benchmarks.records import Records
from calibration.laws.inputs import EXPONENTS
from calibration.laws.law import Law
from calibration.laws.places import places
from calibration.laws.search import search
from calibration.laws.selection import Selection, examine_selection
from calibration.report.robot_laws import RobotLaws, find_robot_laws
from calibration.statistics.fit import fit
from calibration.statistics.study import LEVEL
from calibration.swimmer.measured_table import read_measurements
from calibration.swimmer.swimmer import SwimmerModel
from calibration.swimmer.synthetic_table import make_table
from sim.io.errors import InputError
from sim.model.presets import PRESETS
from tests.calibration.toy_tables import install_toy

_SCORES = (8.0, 12.0)
_NO_NOISE = 1e-4  # runs without noise are refused
_LEVELS = (0.01, 0.04, 0.1, 0.5)


def main(
    robot: str = "toy", tables: str = "300", laws: str = "100", first_seed: str = "7000", file: str = ""
) -> None:
    records, start = Records(file), int(first_seed)
    with ExitStack() as stack:
        if robot == "toy":
            install_toy(stack.enter_context(pytest.MonkeyPatch.context()))
        setting = Setting.of()
        for seed in range(start, start + int(tables) + int(laws)):
            if seed not in records:
                records.add(_record(setting, seed, nothing=seed < start + int(tables)))
    made = [one for one in records.all if "p" in one]
    _report_nulls([one for one in made if one["score"] == 0])
    for score in _SCORES:
        _report_laws(score, [one for one in made if one["score"] == score])


def _record(setting: Setting, seed: int, *, nothing: bool) -> dict[str, Any]:
    """Make a table, search it, and note what is asked."""
    truth = hidden_law(setting, seed, nothing=nothing, scores=_SCORES)
    try:
        table = make_table(replace(ROBOT, effects=truth.effects), seed=seed, title="")
        given = PRESETS["paper-measured"]
        described = find_robot_laws(table, given, seed=seed, progress=False)
        selection = _selection(described, seed)
    except InputError as reason:
        print(f"{seed}: {truth.effects}: not made: {reason}", flush=True)
        return {"seed": seed}
    record: dict[str, Any] = {
        "seed": seed,
        "score": abs(truth.score),
        "general": described.p_value,
        "p": selection.p_value,
        "simultaneous_z": selection.widest,
        "claimed": bool(described.laws and described.laws.complete),
    }
    laws = described.laws
    record["claimed_without_p"] = bool(laws and laws.kept and laws.kept[0].p_value >= laws.level / 2)
    if laws and laws.kept:
        best = laws.kept[0]
        record["right"] = not nothing and best.place.name == truth.place.name
        record["in_set"] = truth.place.name in [law.place.name for law in laws.kept]
        record["ranked_right"] = laws.ranked[0].place.name == truth.place.name
        record["first"] = selection.first[laws.ranked[0].place.name]
        record["near"] = selection.near.get(truth.place.name, 0.0)
        if not nothing:
            powers = (truth.powers.speed, truth.powers.length, truth.powers.tails)
            exact = make_table(
                replace(ROBOT, effects=truth.effects), seed=seed, noise=_NO_NOISE, session_noise=0.0, title=""
            )
            record["true"] = _pulls(best, dict(zip(EXPONENTS, powers, strict=True)), selection)
            record["without_noise"] = _pulls(best, _without_noise(described, best, exact), selection)
    return record


def _selection(described: RobotLaws, seed: int) -> Selection:
    """Return what the choice of the place costs, also where no law was looked for."""
    if described.laws and described.laws.selection:
        return described.laws.selection
    model = described.study.model
    assert isinstance(model, SwimmerModel)
    return examine_selection(search(model, described.base, described.study.split.fitted, places()), seed=seed)


def _without_noise(described: RobotLaws, law: Law, exact: pd.DataFrame) -> dict[str, float]:
    """Fit a law to the runs without noise; repeats keep their scatter about their mean, which gives S."""
    runs = law.model.runs
    y = read_measurements(exact).y
    for condition in np.unique(runs.condition):
        members = runs.condition == condition
        y[members] += runs.y[members] - runs.y[members].mean(0)
    model = replace(law.model, runs=replace(runs, y=y))
    return fit(model, law.fit.parameters, law.fit.names, described.study.split.fitted, title="").parameters


def _pulls(law: Law, true: Mapping[str, float], selection: Selection) -> list[tuple[float, float, float]]:
    """List |estimate − true| of every exponent with half of its interval, as given and simultaneous."""
    pulls = []
    for place, name in enumerate(law.fit.names):
        if name in EXPONENTS:
            plain = law.fit.half_width(place)
            simultaneous = selection.widest * float(np.sqrt(law.fit.covariance[place, place] / law.fit.inflation))
            pulls.append((abs(law.fit.parameters[name] - true[name]), plain, max(plain, simultaneous)))
    return pulls


def _report_nulls(nulls: list[dict[str, Any]]) -> None:
    if not nulls:
        return
    count = len(nulls)
    p = np.array([one["p"] for one in nulls])
    print(f"without a law, {count} tables")
    for level in _LEVELS:
        print(f"  p-value of the search below {level:g} in {per_cent(int((p < level).sum()), count)}")
    found = sum(one["general"] < LEVEL for one in nulls)
    print(f"  more than noise by the general tests in {per_cent(found, count)}")
    print(f"  a law is claimed in {per_cent(sum(one['claimed'] for one in nulls), count)}, "
          f"without the p-value in {per_cent(sum(one['claimed_without_p'] for one in nulls), count)}")  # fmt: skip


def _report_laws(score: float, tables: list[dict[str, Any]]) -> None:
    if not tables:
        return
    count = len(tables)
    claimed = [one for one in tables if one["claimed"]]
    print(f"λ = {score:g}, {count} tables: claimed in {per_cent(len(claimed), count)}, without the p-value in "
          f"{per_cent(sum(one['claimed_without_p'] for one in tables), count)}")  # fmt: skip
    if not claimed:
        return
    right, in_set = (per_cent(sum(one[key] for one in claimed), len(claimed)) for key in ("right", "in_set"))
    print(f"  largest gain at the true place: {right}, true place among those named: {in_set}")
    ranked_right = sum(one["ranked_right"] for one in claimed)
    first = 100 * np.mean([one["first"] for one in claimed])
    print(f"  first in the linear model is the true place: {per_cent(ranked_right, len(claimed))}; "
          f"it is first in {first:.0f} % of bootstrap tables on average")  # fmt: skip
    for words, chosen in (
        ("true exponents, largest gain at the true place", [one["true"] for one in claimed if one["right"]]),
        ("exponents without noise at the chosen place", [one["without_noise"] for one in claimed]),
    ):
        pulls = np.array([pull for each in chosen for pull in each]).reshape(-1, 3)
        if len(pulls):
            shares = [per_cent(int((pulls[:, 0] <= half).sum()), len(pulls)) for half in pulls.T[1:]]
            print(f"  {words}: covered in {shares[0]}, by simultaneous intervals in {shares[1]}; these are "
                  f"{np.median(pulls[:, 2] / pulls[:, 1]):.1f} times as wide")  # fmt: skip
