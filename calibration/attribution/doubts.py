"""Test a claim: whether something outside the catalogue may look like it, and whether it carries over."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from calibration.attribution.candidate import Candidate
from calibration.attribution.imitability import absorbable_shares, imitability
from calibration.attribution.transfer_test import transfer_p
from calibration.statistics.fit import Fit
from calibration.statistics.study import Study


def with_doubts(study: Study, claims: Sequence[Candidate], base: Fit) -> list[Candidate]:
    """Add to each claim its imitability index and its transfer test.

    The strength of a claim is what it takes from the deviance of `base`.
    """
    doubted = []
    for claim in claims:
        assert claim.refit is not None
        strength = math.sqrt(max(base.deviance - claim.refit.deviance, 0.0))
        seconds = (e.second.name for e in claim.claimed if e.second)
        names = (*(e.name for e in claim.claimed), *seconds)
        shares = absorbable_shares(study, claim.refit, names)
        transfer = transfer_p(study.reseeded(4), claim.refit)
        doubted.append(replace(claim, imitable=imitability(shares, strength), transfer=transfer))
    return doubted
