"""Derivatives of a forward model: differences of a cheap one that agrees with it to first order.

A model states its linear model (`ForwardModel.linearised`) and no derivative. So what acts on its parameters or on
its outputs, such as a shift or a camera's scale, is written once, as it is predicted.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from calibration.statistics.statistical_model import ForwardModel, Parameter, Parameters, Predict, parameter
from common.arrays import Floats

_CLOSE = 1e-5  # step of a linear model, in ln C or in units of a typical size
_LOG_STEP, _STEP = 0.01, 0.02  # steps of a model itself


def derivatives(
    model: ForwardModel,
    at: Parameters,
    names: Sequence[str | Parameter],
    *,
    title: str = "",
    quick: bool = False,
) -> tuple[Floats, Floats]:
    """Compute the prediction (n, k) of a model and its derivatives (n, k, p), on the scales of the parameters.

    Args:
        names: of the parameters; or parameters, which may be others than those of the model.
        quick: the result may be NaN where it would take long.
    """
    along = _parameters(model, names)
    at = {**{p.name: p.start for p in along}, **at}
    predictions = model.linearised(at, along, title=title, quick=quick)([at, *either_side(at, along)])
    slopes = (predictions[1::2] - predictions[2::2]) / np.reshape([2 * _close(p) for p in along], (-1, 1, 1))
    return predictions[0], np.moveaxis(slopes, 0, -1)


def either_side(at: Parameters, along: Sequence[Parameter]) -> list[Parameters]:
    """List two points close to `at` for each parameter, one on either side."""
    return [{**at, p.name: p.changed(at[p.name], sign * _close(p))} for p in along for sign in (1, -1)]


def _close(of: Parameter) -> float:
    return _CLOSE if of.logarithmic else _CLOSE * abs(of.typical)


def by_differences(
    model: ForwardModel, at: Parameters, names: Sequence[str | Parameter], *, title: str = ""
) -> tuple[Floats, Floats]:
    """Compute `derivatives` by finite differences of the model itself, in one prediction."""
    sets, widths, along = [dict(at)], [], _parameters(model, names)
    for changed in along:
        name, width = changed.name, _LOG_STEP if changed.logarithmic else _STEP * abs(changed.typical)
        if np.any(changed.moved(at[name], 2 * width) == changed.bounds[1]):  # downwards near the bound
            width = -width
        sets.append({**at, name: changed.moved(at[name], width)})
        widths.append(width)
    predictions = model.predict(sets, title=title)
    solved = np.asarray(np.isfinite(predictions).all((1, 2)))
    for place in np.flatnonzero(~solved[1:] & solved[0]).tolist():  # on the other side it may be
        changed, width = along[place], -widths[place]
        back = {**at, changed.name: changed.moved(at[changed.name], width)}
        if np.any(back[changed.name] != at[changed.name]):
            widths[place], predictions[place + 1] = width, model.predict([back])[0]
    slopes = (predictions[1:] - predictions[0]) / np.array(widths)[:, None, None]
    return predictions[0], np.moveaxis(slopes, 0, -1)


def central(model: ForwardModel, at: Parameters, along: Sequence[Parameter], *, title: str = "") -> Predict:
    """Make the linear model of a smooth model, by central differences: where misfits are many times the noise."""
    sets, widths = [at], []
    for p in along:
        step = _LOG_STEP if p.logarithmic else _STEP * abs(p.typical)
        ends = [p.moved(at[p.name], way * step) for way in (1, -1)]
        sets += [{**at, p.name: end} for end in ends]
        widths.append(float(p.change(ends[1], ends[0])))
    predictions = model.predict(sets, title=title)
    slopes = (predictions[1::2] - predictions[2::2]) / np.reshape(widths, (-1, 1, 1))
    return linear(at, along, predictions[0], np.moveaxis(slopes, 0, -1))


def secants(model: ForwardModel, at: Parameters, along: Sequence[Parameter], *, title: str = "") -> Predict:
    """Make the linear model of any model by its finite differences."""
    return linear(at, along, *by_differences(model, at, along, title=title))


def linear(at: Parameters, along: Sequence[Parameter], seen: Floats, slopes: Floats) -> Predict:
    """Make a linear model of the prediction (n, k) at a point and its derivatives (n, k, p) there."""

    def predict(sets: Sequence[Parameters]) -> Floats:
        predictions = np.tile(seen, (len(sets), 1, 1))
        for j, p in enumerate(along):
            change = p.change(at[p.name], stacked(sets, p.name))
            moved = change.any(1)
            predictions[moved] += change[moved][..., None] * slopes[..., j]
        return predictions

    return predict


def stacked(sets: Sequence[Parameters], name: str, default: float = 0.0) -> Floats:
    """Return a parameter in P sets, (P, 1), or (P, n) where it differs between the runs."""
    values = [parameters.get(name, default) for parameters in sets]
    if all(isinstance(value, float) for value in values):  # the rest takes ten times as long
        return np.array(values)[:, None]
    return np.stack(np.broadcast_arrays(*map(np.atleast_1d, values)))


def _parameters(model: ForwardModel, names: Sequence[str | Parameter]) -> list[Parameter]:
    return [name if isinstance(name, Parameter) else parameter(model, name) for name in names]
