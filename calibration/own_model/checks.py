"""Faults of a function, its parameters and its units, which are named before anything is fitted."""

from __future__ import annotations

from itertools import combinations, product

import numpy as np

from calibration.linear.gls import repeat_count
from calibration.own_model.function_model import NOT_ABOVE_0, FunctionModel, evaluate
from calibration.statistics.statistical_model import Parameter, start_values
from calibration.table.checks import refuse_equal_repeats
from calibration.table.runs import FEWEST_REPEATS
from common.arrays import Flags, Floats
from common.errors import InputError

_FEWEST = 4  # rows, some of which are held out
_FAR = 100.0  # factor between what was measured and the model with its start values
_OTHER_UNITS = (  # factor, units of an output in which it is a mistake, what the table then has
    (100.0, ("1", "%"), "per cent"),
    (180 / np.pi, ("1", "rad", "deg", "°"), "degrees"),
)
_SMALL = 1e-3  # change of a parameter, in its typical size
_ROUGHLY = 0.2  # share by which large changes differ that may be in proportion
_NEXT = 0.01  # change of a number, in its typical size, with which a fit begins
_NEAR = 1.3  # factor between another unit and what is found
_TOGETHER = 0.9  # least correlation, about 0, of what is compared as a difference


def check_function(model: FunctionModel, *, title: str = "") -> tuple[str, ...]:
    """Check the function with its start values, and with each parameter changed, and say what runs cannot tell.

    Raises:
        InputError: there are fewer values than numbers, a prediction cannot be compared, a parameter changes
            nothing, or an output is far from what was measured.
    """
    runs = model.runs
    if runs.sigma is None and repeat_count(runs.apart) >= FEWEST_REPEATS:
        refuse_equal_repeats(runs, runs.apart, runs.outputs)
    parameters, start = model.model.parameters, start_values(model)
    count = len(model.coefficients)
    if len(runs) < _FEWEST or runs.values(np.ones(len(runs), dtype=bool)) <= count:
        least = max(_FEWEST, count + 1)
        raise InputError(
            f"{len(runs)} usable rows for {count} numbers to fit; give {least} rows, better many more"
        )
    sets = [start, *({**start, p.name: _changed(p)} for p in parameters)]
    given, *changed = model.returned(sets, title=title)
    _check_values(model, given, changed)
    if not np.array_equal(given, evaluate(model.model, model.columns, start)):
        raise InputError("the model's function gives other values when it is called again; let it draw no numbers")
    for parameter, prediction in zip(parameters, changed, strict=True):
        fitted = parameter in (*model.coefficients, *model.nuisances)
        if fitted and not np.isfinite(prediction).all() and not _solved_near(model, parameter, start):
            raise InputError(
                f"the model's function gives no finite numbers with {parameter.name} = {_changed(parameter):g}, "
                f"near its start, {parameter.start:g}: give a start, low and high where it can be computed"
            )
        if np.array_equal(prediction, given):
            raise InputError(
                f"{parameter.words} changes nothing in these runs, whether it is {parameter.start:g} or "
                f"{_changed(parameter):g}: use p[{parameter.name!r}] in the function, or leave it out of the model"
            )
    alike = _inseparable(model, {p.name: each - given for p, each in zip(parameters, changed, strict=True)})
    for number, second in alike:
        if second in model.coefficients:
            raise InputError(
                f"{number.name} and {second.name} cannot be told apart: they change the outputs in proportion, as "
                "in a product; leave one of them out of numbers=[…], or give it a sigma"
            )
    for place, (name, output) in enumerate(model.model.outputs.items()):
        measured, predicted = runs.y[:, place], given[:, place]
        ratio = output.kind == "ratio"
        factor = float(np.exp(np.median(measured - predicted))) if ratio else _slope(measured, predicted)
        for other, units, words in _OTHER_UNITS:
            if output.unit in units and 1 / _NEAR < factor / other < _NEAR:
                raise InputError(
                    f"{name} is {factor:.3g} times what the model gives: the table seems to have {words}; convert "
                    "the column or what the function returns, or give other start values"
                )
        if ratio and not 1 / _FAR < factor < _FAR:
            raise InputError(
                f"{name} is {factor:.3g} times what the model gives with its start values "
                f"({', '.join(f'{n.name} = {n.start:g}' for n in model.model.numbers)}): check the units of both, "
                f"and give start values that come within a factor of {_FAR:g}"
            )
    return tuple(f"these runs cannot tell {effect.words} from {number.words}" for number, effect in alike)


def _changed(parameter: Parameter) -> float:
    """Return a number changed by a tenth of its size, or an effect of typical size, within its bounds."""
    step = 0.1 if parameter.logarithmic else parameter.typical
    up, down = (float(parameter.moved(parameter.start, by)) for by in (step, -step))
    return up if up != parameter.start else down


def _inseparable(model: FunctionModel, changes: dict[str, Floats]) -> list[tuple[Parameter, Parameter]]:
    """List free numbers, and effects, that change the outputs in proportion to another number, as in a product.

    They do so at the start and elsewhere; `changes` are those of larger steps, which tell what need not be tried.
    """
    start, free = start_values(model), model.coefficients
    elsewhere = {**start, **{p.name: _changed(p) for p in free}}
    pairs = [*combinations(free, 2), *product(free, model.effects)]
    return [
        (p, q)
        for p, q in pairs
        if _in_proportion(changes[p.name], changes[q.name], _ROUGHLY)
        and all(
            _in_proportion(_slope_along(model, at, p), _slope_along(model, at, q)) for at in (start, elsewhere)
        )
    ]


def _slope_along(model: FunctionModel, at: dict[str, float], of: Parameter) -> Floats:
    """Return how the prediction changes with a small change of a parameter to either side."""
    up, down = model.predict([{**at, of.name: of.moved(at[of.name], by * of.typical)} for by in (_SMALL, -_SMALL)])
    return np.asarray(up - down)


def _in_proportion(one: Floats, other: Floats, within: float = 1e-5) -> bool:
    """Say whether two changes of a prediction are in proportion."""
    slopes = np.stack([one.ravel(), other.ravel()], 1)
    lengths = np.sqrt((slopes**2).sum(0))
    known = bool(np.isfinite(slopes).all() and lengths.all())
    return known and bool(np.linalg.svd(slopes / lengths, compute_uv=False)[1] < within)


def _solved_near(model: FunctionModel, parameter: Parameter, start: dict[str, float]) -> bool:
    """Say whether the function gives finite numbers a little above the start of a parameter, or below it."""
    near = [
        {**start, parameter.name: parameter.moved(parameter.start, by * parameter.typical)}
        for by in (-_NEXT, _NEXT)
    ]
    return bool(np.isfinite(model.predict(near)).all((1, 2)).any())


def _check_values(model: FunctionModel, given: Floats, changed: list[Floats]) -> None:
    """Refuse a value with which none can be compared, and name the effect that makes it."""
    for row, place in np.argwhere(_unusable(given))[:1].tolist():
        low = bool(given[row, place] == NOT_ABOVE_0)
        value = "not above 0" if low else "no finite number"
        what = f"{model.runs.outputs[place]} is {value} in {model.runs.row_name(row)}"
        names = {effect.name for effect in model.effects}
        for parameter, prediction in zip(model.model.parameters, changed, strict=True):
            if parameter.name in names and not _unusable(prediction)[row, place]:
                raise InputError(
                    f"{parameter.words} does not vanish at its null, {parameter.start:g}: there {what}; "
                    "make the function the model without the effect there"
                )
        positive = ", above 0 as ratios are compared, or declare kind='difference'" * low
        raise InputError(f"the model's {what}; return finite numbers{positive}")


def _unusable(prediction: Floats) -> Flags:
    return ~np.isfinite(prediction) | (prediction == NOT_ABOVE_0)


def _slope(measured: Floats, predicted: Floats) -> float:
    """Return how much measured values rise with predicted ones; 1 where they do not go together."""
    square = float(predicted @ predicted)
    alike = abs(float(measured @ predicted)) > _TOGETHER * np.sqrt(square * float(measured @ measured))
    return float(measured @ predicted) / square if square and alike else 1.0
