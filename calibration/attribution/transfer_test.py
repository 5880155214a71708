"""Whether a claim carries over: fitted to short tails and few of them, it must predict the other runs.

Something outside the catalogue can look like an effect at some runs. It depends on N and l in another way, so that
the size which fits short tails is wrong for long ones. The model with the claim is fitted again, by one linear
step, to the runs with at most the median tail length and one of the `FEWEST` smallest numbers of tails. Then the
other runs are judged as the held-out ones are. Below `SURE` the verdict says "or something outside the catalogue
that looks like it".
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from calibration.statistics.fit import Fit
from calibration.statistics.forward_model import Runs, stepped
from calibration.statistics.held_out import held_out_p_value, one_step
from calibration.statistics.study import Study
from sim.arrays import Flags

SURE = 0.01
FEWEST = 3  # numbers of tails that are fitted
_INPUTS = ("N", "ln l")
_ENOUGH = 2  # values a parameter


def transfer_p(study: Study, fitted: Fit) -> float:
    """Estimate the probability that noise alone puts the other runs as far from a model with the claim.

    It is 1 where runs are too few or too much alike.
    """
    near = fitted_again(study.runs, study.used)
    others = study.used & ~near
    values = near.sum() * study.runs.y.shape[1]
    if not others.any() or values < _ENOUGH * len(fitted.names):
        return 1.0
    refit = one_step(study.runs, fitted, near)
    moved = replace(
        fitted,
        parameters=stepped(fitted.fitted, fitted.parameters, refit.step),
        prediction=fitted.prediction + fitted.jacobian @ refit.step,
        covariance=fitted.inflation * refit.covariance,
    )
    return held_out_p_value(moved, study.runs, others, seed=study.seed)


def fitted_again(runs: Runs, used: Flags) -> Flags:
    """Choose the runs (n,) with short tails and few of them; all of `used` where that is not an input."""
    near = used.copy()
    for name in _INPUTS:
        if name in runs.input_names:
            values = runs.inputs[:, runs.input_names.index(name)].round(9)
            kinds = np.unique(values[used])
            near &= values <= (kinds[min(FEWEST, len(kinds)) - 1] if name == "N" else np.median(kinds))
    return np.asarray(near)
