"""What moved: a coefficient, nuisance parameter or effect that differs in a session, since one, or on a specimen.

Bubbles, another batch of fluid, a camera that was bumped: the model is right, and one of its numbers is not the
same in all runs. So before an effect is looked for, each number may differ in each group of runs. Groups are

    every session,   the sessions from each one on, in the order of the runs,   every specimen,

as far as their runs have partners: every pair of N and l of a group (`Runs.partners`) must be outside it, too.
Else a shift is no different from an effect of N or l. A number that differs by x in the group G has the derivative
∂f/∂x = ∂f/∂p in the runs of G, and 0 in the others. So every pair of number and group has a score
(`calibration.statistics.residual_tests`), and costs no simulation. The largest is fitted, with those
near it, if it is beyond what a bootstrap of all scores gives at a quarter of the level, and judged by
`calibration.attribution.rules`. Of pairs that cannot be told apart the one comes first that is off by the fewest
of its tolerances, a coefficient before a number; the others are named with it. With it in the fit, a second one
is looked for.

The zero of the course shows only with a current, and a score is its derivative at the same zero in all runs. So a
number with a grid is fitted in each group where another number has a large score, from all values of the grid.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import cast

import numpy as np

from calibration.attribution.hypothesis import Evidence, Hypothesis, Origin
from calibration.attribution.rules import CERTAIN, INDISTINGUISHABLE, RULES, Trial, judge, shift_of
from calibration.statistics.budget import skipped
from calibration.statistics.fit import Fit, UnsolvedError, birge, fit
from calibration.statistics.residual_tests import Directions, examine_residual
from calibration.statistics.shifted import Shift, Shifted
from calibration.statistics.statistical_model import Experiment, Parameter
from calibration.statistics.study import Study
from calibration.table.runs import Runs
from common.arrays import Flags, Integers

_MOST = 2  # numbers that move
_NEAR, _FITTED = 0.9, 5  # share of the largest score; pairs that are fitted
_SHARE_OF_LEVEL = 0.25
_DRAWS = 400  # of the bootstrap
_FEWEST = 6  # runs in a group, and outside it


def groups_that_may_differ(runs: Runs) -> list[tuple[str, Flags]]:
    """List groups of runs with partners outside them, with words for each."""
    names, session = runs.session_names, runs.session
    kind = "swim" if runs.row == "pose" else "session"
    candidates: list[tuple[str, Flags]] = []
    if runs.specimen is not None:
        candidates += [(f"on specimen {name}", runs.specimen == i) for i, name in enumerate(runs.specimen_names)]
    present = np.unique(session).tolist()  # a part of the runs may have none of a session
    if runs.traces_are_sessions:  # a trace may have numbers of its own
        present = []
    candidates += [(f"in {kind} {names[i]}", session == i) for i in present]
    by_time = sorted(present, key=lambda i: int(runs.rows[session == i].min()))
    candidates += [
        (f"since {kind} {names[by_time[k]]}", np.isin(session, by_time[k:])) for k in range(2, len(present) - 1)
    ]
    distinct: list[tuple[str, Flags]] = []
    settings = np.unique(runs.partners.round(9), axis=0, return_inverse=True)[1].reshape(-1)
    for words, rows in candidates:
        same = any(np.array_equal(rows, other) or np.array_equal(rows, ~other) for _, other in distinct)
        if not same and min(rows.sum(), (~rows).sum()) >= _FEWEST and _has_partners(settings, rows):
            distinct.append((words, rows))
    return distinct


def _has_partners(settings: Integers, rows: Flags) -> bool:
    """Tell whether the settings that runs must share, numbered (n,), are outside a group, too."""
    return set(settings[rows].tolist()) <= set(settings[~rows].tolist())


def find_moves(study: Study, base: Fit) -> tuple[Study, Fit, tuple[Hypothesis, ...]]:
    """Find the numbers that differ in some runs, the clearest first, and fit them, from a fit `base` without.

    Returns:
        The study, with a model `Shifted` if something differs; the fit; and what differs.
    """
    used, plain = study.split.fitted, cast(Experiment, study.model)
    groups = [
        (words, rows)
        for words, rows in groups_that_may_differ(plain.runs)
        if min((rows & used).sum(), (~rows & used).sum()) >= _FEWEST
    ]
    shared = [p for p in (*plain.coefficients, *plain.nuisances) if not p.of_group]
    numbers = (*shared, *(e for e in plain.effects if e.name in base.names))
    moves: tuple[Hypothesis, ...] = ()
    while groups and numbers and len(moves) < _MOST and not skipped("numbers that differ in some runs"):
        scores = _clearest(study, base, groups, numbers)
        known = tuple(map(shift_of, moves))
        fitted = [move for shift, z in scores for move in _fitted(plain, known, shift, z, base, used)]
        judged = [judge(move, Trial(study, base), RULES) for move in fitted]
        kept = [move for move in judged if move.kept]
        if not kept:
            break
        least = min(move.fitted.deviance for move in kept)
        alike = [move for move in kept if move.fitted.deviance - least < INDISTINGUISHABLE]
        move, *others = sorted(alike, key=lambda each: (_tolerances(each), each.fitted.deviance))
        instead = dict.fromkeys(each.effect.title for each in others if each.effect.name != move.effect.name)
        study, base = replace(study, model=move.model), move.fitted
        moves = (*moves, move.seen(instead=tuple(instead)))
    return study, base, moves


def _fitted(
    plain: Experiment, known: tuple[Shift, ...], shift: Shift, z: float, base: Fit, used: Flags
) -> list[Hypothesis]:
    """Fit a number that differs in some runs, beside those that are known to, from all values of its grid."""
    change, moves = shift.change, []
    if change.name in base.names:  # with a grid it has the score of another number
        return []
    model, names = Shifted(plain, (*known, shift)), (*base.names, change.name)
    for start in shift.parameter.grid or (0.0,):
        if skipped(change.title):
            continue
        try:
            refit = fit(model, {**base.parameters, change.name: start}, names, used, title="")
        except UnsolvedError:  # with an effect at work
            continue
        evidence = Evidence(score=z, birge=birge(plain.runs, refit, used))
        moves.append(Hypothesis(Origin.MOVE, (change,), refit, evidence))
    return moves


def _tolerances(move: Hypothesis) -> float:
    """Return how many of its tolerances a number is off; none for a coefficient, and for a zero of any size."""
    number = shift_of(move).parameter
    return abs(move.size) / (math.inf if number.plausible else number.sigma or math.inf)


def _clearest(
    study: Study, base: Fit, groups: Sequence[tuple[str, Flags]], numbers: Sequence[Parameter]
) -> list[tuple[Shift, float]]:
    """Find the numbers and the groups with the largest scores, if these are real, the largest first."""
    pairs = [(number, words, rows) for words, rows in groups for number in numbers if number.name in base.names]
    columns = [base.jacobian[..., base.names.index(n.name)] * rows[:, None] for n, _, rows in pairs]
    tested = replace(study, seed=study.seed + 6, level=study.level * _SHARE_OF_LEVEL)
    misfit = examine_residual(tested, base, Directions.plain(np.stack(columns, -1)), draws=_DRAWS)
    z = np.where(misfit.scores.survived >= study.model.runs.least_surviving, misfit.scores.z, 0.0)
    largest = float(np.abs(z).max())
    if largest < max(misfit.critical_z, CERTAIN):
        return []
    near = [j for j in np.argsort(-np.abs(z)).tolist() if abs(z[j]) > _NEAR * largest][:_FITTED]
    where = {pairs[j][1]: float(z[j]) for j in reversed(near)}
    with_grid = [j for j, (n, words, _) in enumerate(pairs) if n.grid and n.sigma and words in where]
    scores = {j: float(z[j]) for j in near} | {j: where[pairs[j][1]] for j in with_grid}
    return [(Shift(pairs[j][0], pairs[j][2], pairs[j][1]), score) for j, score in scores.items()]
