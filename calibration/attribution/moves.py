"""What moved: a coefficient, nuisance parameter or effect that differs in a session, since one, or on a specimen.

Bubbles, another batch of fluid, a camera that was bumped: the model is right, and one of its numbers is not the
same in all runs. So before an effect is looked for, each number may differ in each group of runs. Groups are

    every session,   the sessions from each one on, in the order of the runs,   every specimen,

as far as their runs have partners: every pair of N and l of a group (`Runs.partners`) must be outside it, too.
Else a shift is no different from an effect of N or l. A number that differs by x in the group G has the derivative
∂f/∂x = ∂f/∂p in the runs of G, and 0 in the others. So every pair of number and group has a score
(`calibration.statistics.residual_tests`), and costs no simulation. The largest is taken to be real if it is beyond
what a bootstrap of all scores gives at a quarter of the level, beyond `CERTAIN` standard deviations of what the
fit with it leaves (its Birge factor counts), and credible: at most `CREDIBLE` tolerances of the number, or any
angle for the zero of the course. Its fit must gain more than one parameter can by chance. Of pairs that cannot be
told apart the one comes first that is off by the fewest of its tolerances, a coefficient before a number; the
others are named with it. With it in the fit, a second one is looked for.

The zero of the course shows only with a current, and a score is its derivative at the same zero in all runs. So a
number with a grid is fitted in each group where another number has a large score, from all values of the grid.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple, cast

import numpy as np

from calibration.attribution.refits import INDISTINGUISHABLE
from calibration.statistics.budget import skipped
from calibration.statistics.fit import Fit, UnsolvedError, birge, fit, two_digits
from calibration.statistics.residual_tests import TESTABLE, Directions, examine_residual
from calibration.statistics.shifted import Shift, Shifted
from calibration.statistics.statistical_model import Experiment, Parameter, Runs
from calibration.statistics.study import Study
from common.arrays import Flags, Integers

CERTAIN = 5.0  # standard deviations
CREDIBLE = 10.0  # tolerances of a number: a camera may be bumped, but no head is a third shorter on a day
_MOST = 2  # numbers that move
_NEAR, _FITTED = 0.9, 5  # share of the largest score; pairs that are fitted
_SHARE_OF_LEVEL = 0.25
_DRAWS = 400  # of the bootstrap
_FEWEST = 6  # runs in a group, and outside it


@dataclass(frozen=True)
class LocalShift:
    """A number of the model that differs in some runs."""

    shift: Shift
    z: float  # its score
    instead: tuple[str, ...] = ()  # others that cannot be told from it, in words

    @property
    def name(self) -> str:
        """The name of the change, as a parameter."""
        return self.shift.parameter.name

    def words(self, fitted: Fit) -> str:
        """Say by how much it differs, with its 95 % interval, from a fit that has it."""
        number = self.shift.of
        sizes = np.array([fitted.parameters[self.name], *fitted.interval(self.name)])
        sizes, unit = (100 * np.expm1(sizes), "%") if number.logarithmic else (sizes * number.shown, number.unit)
        value, low, high = map(two_digits, (abs(float(sizes[0])), *sorted(np.abs(sizes[1:]).tolist())))
        others = f", or {' or '.join(self.instead)} differs" if self.instead else ""
        return (
            f"{self.shift.parameter.title} is {value} {unit} ({low} to {high}) "
            f"{'above' if sizes[0] > 0 else 'below'} that of the other runs ({abs(self.z):.1f} σ){others}"
        )

    def record(self, fitted: Fit) -> dict[str, Any]:
        """Return the record for verdict.json."""
        return {
            "number": self.shift.of.name,
            "where": self.shift.where,
            "change": fitted.parameters[self.name],
            "interval": list(fitted.interval(self.name)),
            "scale": "logarithm" if self.shift.of.logarithmic else "as it is",
            "score": self.z,
            "instead": list(self.instead),
        }


class StatedMove(NamedTuple):
    """A number that differs in some runs, as a verdict states it."""

    words: str
    record: dict[str, Any]


def groups_that_may_differ(runs: Runs) -> list[tuple[str, Flags]]:
    """List groups of runs with partners outside them, with words for each."""
    names, session = runs.session_names, runs.session
    found: list[tuple[str, Flags]] = []
    if runs.specimen is not None:
        found += [(f"on specimen {name}", runs.specimen == i) for i, name in enumerate(runs.specimen_names)]
    present = np.unique(session).tolist()  # a part of the runs may have none of a session
    found += [(f"in session {names[i]}", session == i) for i in present]
    by_time = sorted(present, key=lambda i: int(runs.rows[session == i].min()))
    found += [
        (f"since session {names[by_time[k]]}", np.isin(session, by_time[k:])) for k in range(2, len(present) - 1)
    ]
    distinct: list[tuple[str, Flags]] = []
    settings = np.unique(runs.partners.round(9), axis=0, return_inverse=True)[1].reshape(-1)
    for words, rows in found:
        same = any(np.array_equal(rows, other) or np.array_equal(rows, ~other) for _, other in distinct)
        if not same and min(rows.sum(), (~rows).sum()) >= _FEWEST and _has_partners(settings, rows):
            distinct.append((words, rows))
    return distinct


def _has_partners(settings: Integers, rows: Flags) -> bool:
    """Tell whether the settings that runs must share, numbered (n,), are outside a group, too."""
    return set(settings[rows].tolist()) <= set(settings[~rows].tolist())


def find_moves(study: Study, base: Fit) -> tuple[Study, Fit, tuple[LocalShift, ...]]:
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
    numbers = (*plain.coefficients, *plain.nuisances, *(e for e in plain.effects if e.name in base.names))
    moves: tuple[LocalShift, ...] = ()
    while groups and len(moves) < _MOST and not skipped("numbers that differ in some runs"):
        fits: list[tuple[LocalShift, Study, Fit]] = []
        for move in _clearest(study, base, groups, numbers):
            if move.name in base.names:  # with a grid it has the score of another number
                continue
            shifts = (*(m.shift for m in moves), move.shift)
            moved, names = replace(study, model=Shifted(plain, shifts)), (*base.names, move.name)
            for change in move.shift.of.grid or (0.0,):
                if skipped(move.shift.parameter.title):
                    continue
                try:
                    start = {**base.parameters, move.name: change}
                    fits.append((move, moved, fit(moved.model, start, names, used, title="")))
                except UnsolvedError:  # with an effect at work
                    continue
        fits = [each for each in fits if _is_real(plain.runs, used, each[0], base, each[2])]
        if not fits:
            break
        least = min(fitted.deviance for _, _, fitted in fits)
        alike = [each for each in fits if each[2].deviance - least < INDISTINGUISHABLE]
        alike.sort(key=lambda each: (_tolerances(each[0], each[2]), each[2].deviance))
        (move, study, base), *others = alike
        instead = dict.fromkeys(m.shift.parameter.title for m, _, _ in others if m.name != move.name)
        moves = (*moves, replace(move, instead=tuple(instead)))
    return study, base, moves


def _is_real(runs: Runs, used: Flags, move: LocalShift, base: Fit, fitted: Fit) -> bool:
    """Tell whether a number that differs is beyond what the fit with it leaves, gains by itself, and is credible.

    One with a grid has the score of another number, so its own gain counts.
    """
    certain = abs(move.z) >= CERTAIN * math.sqrt(birge(runs, fitted, used))
    gains = base.deviance - fitted.deviance >= INDISTINGUISHABLE
    return fitted.converged and certain and gains and _credible(move, fitted)


def _credible(move: LocalShift, fitted: Fit) -> bool:
    """Tell whether a number may differ by so much; half a turn may be a little more by its error."""
    number, change = move.shift.of, fitted.parameters[move.name]
    if number.sigma is None:
        return True
    if number.plausible:
        low, high = fitted.interval(move.name)
        return low <= number.plausible[1] and high >= number.plausible[0]
    return abs(change) <= CREDIBLE * number.sigma


def _tolerances(move: LocalShift, fitted: Fit) -> float:
    """Return how many of its tolerances a number is off; none for a coefficient, and for a zero of any size."""
    number = move.shift.of
    return abs(fitted.parameters[move.name]) / (math.inf if number.plausible else number.sigma or math.inf)


def _clearest(
    study: Study, base: Fit, groups: Sequence[tuple[str, Flags]], numbers: Sequence[Parameter]
) -> list[LocalShift]:
    """Find the numbers and the groups with the largest scores, if these are real, the largest first."""
    pairs = [(number, words, rows) for words, rows in groups for number in numbers if number.name in base.names]
    columns = [base.jacobian[..., base.names.index(n.name)] * rows[:, None] for n, _, rows in pairs]
    tested = replace(study, seed=study.seed + 6, level=study.level * _SHARE_OF_LEVEL)
    misfit = examine_residual(tested, base, Directions.plain(np.stack(columns, -1)), draws=_DRAWS)
    z = np.where(misfit.scores.survived >= TESTABLE, misfit.scores.z, 0.0)
    largest = float(np.abs(z).max())
    if largest < max(misfit.critical_z, CERTAIN):
        return []
    near = [j for j in np.argsort(-np.abs(z)).tolist() if abs(z[j]) > _NEAR * largest][:_FITTED]
    where = {pairs[j][1]: float(z[j]) for j in reversed(near)}
    with_grid = [
        (place, words) for place, (n, words, _) in enumerate(pairs) if n.grid and n.sigma and words in where
    ]
    found = {j: float(z[j]) for j in near} | {j: where[words] for j, words in with_grid}
    return [LocalShift(Shift(pairs[j][0], pairs[j][2], pairs[j][1]), score) for j, score in found.items()]
