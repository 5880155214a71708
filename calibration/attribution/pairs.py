"""Pairs of effects: if no single effect is kept, a second one is looked for beside each of the best few."""

from __future__ import annotations

import math
from collections.abc import Sequence

from calibration.attribution.candidate import Candidate, penalised_deviance
from calibration.attribution.single_effects import examine
from calibration.statistics.fit import Fit
from calibration.statistics.residual_tests import examine_residual
from calibration.statistics.score_directions import directions
from calibration.statistics.study import Study

FIRST = 3  # number of single effects to which a second one is added


def pairs(study: Study, candidates: Sequence[Candidate]) -> list[Candidate]:
    """Add second effects to the best fits with a single one, and return the pairs that are kept."""
    refitted = sorted((c for c in candidates if c.refit), key=penalised_deviance)
    again = study.reseeded(2)
    second: list[Candidate] = []
    for first in refitted[:FIRST]:
        assert first.refit is not None
        others = [e for e in study.model.effects if e.name != first.effect.name]
        along = directions(study.model, first.refit.parameters, others, title=study.title("second effects"))
        misfit = examine_residual(again, first.refit, along)
        second += examine(again, first.refit, misfit, along, beside=(first.effect,))
    single = min((ebic(study, c.refit, 1) for c in refitted if c.refit), default=math.inf)
    kept: dict[frozenset[str], Candidate] = {}
    for pair in second:
        if pair.kept and pair.refit is not None and ebic(study, pair.refit, 2) < single:
            kept.setdefault(frozenset(e.name for e in pair.claimed), pair)
    return list(kept.values())


def ebic(study: Study, refit: Fit, count: int) -> float:
    """Add to the deviance of a fit with `count` effects what they cost: k ln n + 2 ln (number of such sets).

    Source: Chen and Chen (2008), γ = 1.
    """
    values = int(study.used.sum()) * refit.prediction.shape[1]
    sets = math.comb(len(study.model.effects), count)
    return refit.deviance + len(refit.names) * math.log(values) + 2 * math.log(sets)
