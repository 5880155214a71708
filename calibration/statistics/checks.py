"""Faults of a model and of its runs, which are named before anything is fitted."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable

import numpy as np

from calibration.statistics.statistical_model import ForwardModel, start_values
from calibration.table.runs import Runs
from common.arrays import Floats
from common.errors import InputError

_ALIKE = 0.2  # share of the scatter that is left where a logarithm was forgotten


def names_once(names: Iterable[str]) -> None:
    """Refuse a name that two parameters have."""
    for name, count in Counter(names).items():
        if count > 1:
            raise InputError(f"two numbers or effects of the model have the name {name!r}; rename or drop one")


def predict_as_given(model: ForwardModel, *, title: str = "") -> Floats:
    """Predict the runs (n, k) with every parameter as given, and check both.

    Raises:
        InputError: a name is there twice, sessions are not numbered from 0, or what was measured or predicted is
            not finite, has another shape, or is a logarithm where the other is none.
    """
    runs = model.runs
    names_once(p.name for p in (*model.coefficients, *model.nuisances, *model.effects))
    count = len(runs.session_names)
    if not np.isin(runs.session, np.arange(count)).all():
        wrong = runs.session[~np.isin(runs.session, np.arange(count))][0]
        raise InputError(f"a run is in session {wrong}; number the {count} sessions from 0 to {count - 1}")
    _refuse_not_finite("measured", runs, runs.y)
    prediction = np.asarray(model.predict([start_values(model)], title=title))
    if prediction.shape != (1, *runs.y.shape):
        raise InputError(
            f"the model's prediction of one parameter set has the shape {prediction.shape}; return "
            f"{(1, *runs.y.shape)}: sets, runs, outputs"
        )
    _refuse_not_finite("predicted by the model as given", runs, prediction[0])
    for place, output in enumerate(runs.outputs):
        _refuse_logarithm(output, runs.y[:, place], prediction[0, :, place])
    return np.asarray(prediction[0])


def _refuse_not_finite(what: str, runs: Runs, values: Floats) -> None:
    for row, place in np.argwhere(~np.isfinite(values))[:1].tolist():
        name, value = runs.outputs[place], values[row, place]
        raise InputError(
            f"{name} as {what} is {value} in {runs.row_name(row)}; every value must be a finite number"
        )


def _refuse_logarithm(output: str, measured: Floats, predicted: Floats) -> None:
    """Refuse an output of which one is the logarithm and the other is not: only then do the two go together."""
    both = ((measured, predicted, "the measured values"), (predicted, measured, "the predictions"))
    for logarithm, other, words in both:
        if (other > 0).all():
            left = (logarithm - np.log(other)).std()
            if left < _ALIKE * min(logarithm.std(), (measured - predicted).std()):
                raise InputError(f"{output}: {words} seem to be logarithms, and the others not; take that of both")
