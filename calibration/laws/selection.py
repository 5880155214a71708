"""What choosing among the places costs: how surprising the best law is, and how sure the choice of its place is.

**p-value of the search.** Tables are drawn from the fit without laws: noise of the runs and of the sessions, and
nuisance parameters from their priors, as in `calibration.statistics.residual_tests`. The whole search runs on
each. With the largest gain in BIC of the runs, and those of B drawn tables,

    p = (1 + number of tables that gain as much)/(1 + B).

**EBIC** counts the models among which one with q columns was chosen, with γ = 1:

    EBIC = BIC + 2 γ ln(number of models with q columns).

**Selection frequency.** Tables are drawn in the same way from laws: from the best linear model of every place, in
proportion to its probability e^(−BIC/2) among them. The search runs on each. The share of tables in which a place
ranks first, or within `INDISTINGUISHABLE` of the first, says how far other runs of the same design would choose
it. Whole sessions are not resampled: there are three to six, which differ in their tails.

**Intervals after selection.** K is the 95 % quantile over the tables without a law of the largest |z| of all
weights of all models. Estimates ± K standard errors cover all weights of all models at once, and so those of any
model that was chosen by its fit (Berk et al. 2013), to first order in the law.

Source: Westfall and Young (1993) for the largest of many statistics; Chen and Chen (2008) for EBIC; Kass and
Raftery (1995) for BIC as a probability; Efron (2014) for the bootstrap of a choice.
"""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass
from typing import Any

import numpy as np

from calibration.attribution.refits import INDISTINGUISHABLE
from calibration.laws.search import Search
from sim.arrays import Floats, Integers

_NULL_DRAWS = 999  # tables without a law
_LAW_DRAWS = 400  # tables with one
_COVERED = 0.95
_GAMMA = 1.0  # of EBIC


@dataclass(frozen=True)
class Selection:
    """What the choice among the places costs."""

    p_value: float  # of the largest gain in BIC
    first: dict[str, float]  # place -> share of tables with a law in which it ranks first
    near: dict[str, float]  # place -> share in which it is within INDISTINGUISHABLE of the first
    widest: float  # K: standard errors that cover all weights of all models in 95 %
    models: dict[int, int]  # number of columns -> number of models

    def ebic_gain(self, gain: float, columns: int) -> float:
        """Compute the gain in EBIC of a law with so many columns, by its gain in BIC."""
        return gain - 2 * _GAMMA * math.log(self.models[min(columns, max(self.models))])

    def to_dict(self) -> dict[str, Any]:
        """Return the record for laws.json."""
        return {
            "search_p_value": self.p_value,
            "tables_without_law": _NULL_DRAWS,
            "tables_with_law": _LAW_DRAWS,
            "simultaneous_z": self.widest,
        }


def examine_selection(search: Search, *, seed: int) -> Selection:
    """Draw tables without and with laws, and run the whole search on each; `seed` of the draws."""
    draws = _Draws(search, np.random.default_rng(seed))
    null = search.models.fit(draws.noise(np.full(_NULL_DRAWS, search.fits.base_share[0])))
    as_large = int(np.count_nonzero(null.gain.max(1) >= search.fits.gain.max()))
    largest = np.abs(null.weights / null.errors).max((1, 2))
    gains = search.models.fit(draws.with_laws(_LAW_DRAWS)).gain
    of_places = np.take_along_axis(gains, search.best(gains), 1)  # (tables, names)
    behind = of_places.max(1)[:, None] - of_places
    return Selection(
        p_value=(1 + as_large) / (1 + _NULL_DRAWS),
        first=_shares(search, behind == 0),
        near=_shares(search, behind < INDISTINGUISHABLE),
        widest=float(np.quantile(largest, _COVERED)),
        models=dict(Counter(len(chosen) for _, chosen in search.models.models)),
    )


def _shares(search: Search, chosen: Floats) -> dict[str, float]:
    """Compute the share of tables (tables, names) in which each place is chosen."""
    return dict(zip(search.names, chosen.mean(0).tolist(), strict=True))


class _Draws:
    """Residuals of drawn tables, from the parameters as given."""

    def __init__(self, search: Search, rng: np.random.Generator):
        self._search, self._rng = search, rng
        self._run = search.models.without.noise(search.residual)

    def noise(self, share: Floats) -> Floats:
        """Draw tables without a law, (B, n, k), with ρ of each (B,)."""
        return self._search.models.without.draw(self._rng, self._run, share)

    def with_laws(self, count: int) -> Floats:
        """Draw tables with the best law of a place, which is drawn by its probability, (B, n, k)."""
        search = self._search
        best: Integers = search.best(search.fits.gain)[0]
        gain = search.fits.gain[0, best]
        probability = np.exp((gain - gain.max()) / 2)
        model = self._rng.choice(best, count, p=probability / probability.sum())
        place = np.array([search.models.models[m][0] for m in model])
        law = np.einsum("nkbv,bv->bnk", search.models.columns[:, :, place], search.fits.weights[0, model])
        return np.asarray(law + self.noise(search.fits.share[0, model]))
