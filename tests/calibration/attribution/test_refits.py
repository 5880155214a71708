"""The refits of effects, and what pairs of them cost."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from calibration.attribution.refits import ebic
from calibration.attribution.wrong_numbers import pulls
from calibration.statistics.fit import fit
from calibration.statistics.statistical_model import start_values
from calibration.statistics.study import Study
from calibration.swimmer.nuisance_numbers import CAMERA
from tests.calibration.toy_tables import toy_swimmer, toy_table


def test_pairs_pay_for_their_number() -> None:
    """Two effects cost one parameter more, and the logarithm of how many pairs there are."""
    model = toy_swimmer(toy_table(4))
    used = np.ones(len(model.runs), bool)
    names = tuple(p.name for p in model.coefficients)
    fitted = fit(model, start_values(model), names, used, title="")
    count = len(model.effects)
    study = Study.fitted_to(model, used)
    cost = ebic(study, fitted, 2) - ebic(study, fitted, 1)
    assert cost == pytest.approx(2 * math.log((count - 1) / 2))
    pull = pulls(fit(model, start_values(model), (*names, CAMERA), used, title=""), model.nuisances)[0]
    freed = replace(fitted, wrong_numbers=((pull,),))
    assert ebic(study, freed, 2) - ebic(study, fitted, 2) == pytest.approx(math.log(study.values))
