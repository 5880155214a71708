"""Candidates: what was found about each effect, and which of them explain the residual."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from calibration.attribution.imitability import DOUBT
from calibration.attribution.transfer_test import SURE
from calibration.statistics.fit import Fit
from calibration.statistics.forward_model import Parameter
from calibration.statistics.residual_tests import Misfit

INDISTINGUISHABLE = 6.63  # χ² with one degree of freedom, 99 %
UNSEEN = 1e9  # smallest detectable size of an effect that changes nothing


@dataclass(frozen=True)
class Candidate:
    """What was found about one effect; what only a refit tells is left at its default if there was none."""

    effect: Parameter
    beside: tuple[Parameter, ...]  # effects that were in the model before
    z: float
    survived: float
    detectable: float  # size that is found half of the time: critical |z| / signal per unit
    detectable_exact: float  # the same if every nuisance parameter were exact
    verdict: str  # why it was kept or not
    refit: Fit | None = None
    refit_misfit: Misfit | None = None
    gain: float = 0.0  # predictive gain summed over left-out sessions, in log likelihood
    gain_error: float = 0.0
    imitable: float = 0.0  # imitability index of the claim (`calibration.attribution.imitability`), if it is kept
    transfer: float = 1.0  # p-value that it carries over to other runs (`transfer_test`), if it is kept

    @property
    def kept(self) -> bool:
        return self.verdict == "kept"

    @property
    def doubted(self) -> bool:
        """Whether the claim may be something outside the catalogue that looks like it.

        An effect that explains the runs only beside a wrong nuisance parameter counts as a pair, and is always
        uncertain.
        """
        return self.imitable > DOUBT or self.transfer < SURE or bool(self.refit and self.refit.wrong_numbers)

    @property
    def claimed(self) -> tuple[Parameter, ...]:
        """All effects of its refit."""
        return (*self.beside, self.effect)

    @property
    def title(self) -> str:
        """Titles of all effects of its refit."""
        return " and ".join(e.title for e in self.claimed)


def unexamined(
    misfit: Misfit, effects: Sequence[Parameter], threshold: float, beside: tuple[Parameter, ...] = ()
) -> list[Candidate]:
    """Describe every effect by its score alone.

    Args:
        threshold: |z| that a claim needs.
    """
    scores = misfit.scores
    candidates = []
    for j, effect in enumerate(effects):
        detectable, exact = (
            threshold / max(float(length[j]), 1e-300) for length in (scores.length, misfit.exact_length)
        )
        candidates.append(
            Candidate(
                effect, beside, float(scores.z[j]), float(scores.survived[j]), detectable, exact, "not needed"
            )
        )
    return candidates


def explaining(candidates: Sequence[Candidate]) -> list[Candidate]:
    """Return the kept effects that the runs cannot tell from the best one, best first."""
    kept = sorted((c for c in candidates if c.kept and c.refit), key=penalised_deviance)
    return [c for c in kept if penalised_deviance(c) - penalised_deviance(kept[0]) < INDISTINGUISHABLE]


def penalised_deviance(candidate: Candidate) -> float:
    """Return the deviance of a refit plus what second numbers cost, because each may gain as much by chance."""
    assert candidate.refit is not None
    seconds = sum(e.second is not None for e in candidate.claimed)
    return candidate.refit.deviance + INDISTINGUISHABLE * seconds
