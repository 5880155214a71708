"""Faults of a function, its parameters and its units, which are named before anything is fitted."""

from __future__ import annotations

from itertools import combinations, product

import numpy as np

from calibration.linear.gls import repeat_count
from calibration.own_model.function_model import NOT_ABOVE_0, FunctionModel, evaluate
from calibration.statistics.statistical_model import Parameter, start_values
from calibration.table.between_repeats import refuse_equal_repeats
from calibration.table.runs import FEWEST_REPEATS
from calibration.table.unit_slips import refuse_other_units
from common.arrays import Flags, Floats
from common.errors import InputError

_FEWEST = 4  # rows, some of which are held out
_SMALL = 1e-3  # change of a parameter, in its typical size
_ROUGHLY = 0.2  # share by which large changes differ that may be in proportion
_NEXT = 0.01  # change of a number, in its typical size, with which a fit begins


def check_function(model: FunctionModel, *, title: str = "") -> tuple[str, ...]:
    """Check the function with its start values, and with each parameter changed, and say what runs cannot tell.

    Raises:
        InputError: there are fewer values than numbers, a prediction cannot be compared, a parameter changes
            nothing, or an output is far from what was measured.
    """
    runs = model.runs
    if runs.trace is None and runs.sigma is None and repeat_count(runs.repeat_ids) >= FEWEST_REPEATS:
        refuse_equal_repeats(runs, runs.repeat_ids, runs.outputs)
    parameters, start = model.model.parameters, start_values(model)
    as_declared = {p.name: p.start for p in parameters}
    count = len(model.coefficients)
    if len(runs) < _FEWEST or runs.values(np.ones(len(runs), dtype=bool)) <= count:
        least = max(_FEWEST, count + 1)
        raise InputError(
            f"{len(runs)} usable rows for {count} numbers to fit; give {least} rows, better many more"
        )
    sets = [start, *({**start, **model.everywhere(p.name, _changed(p))} for p in parameters)]
    given, *changed = model.returned(sets, title=title)
    _check_values(model, given, changed)
    call = model.calls[0]
    if not np.array_equal(given[call.rows], evaluate(model.model, call.columns, as_declared)):
        raise InputError("the model's function gives other values when it is called again; let it draw no numbers")
    for parameter, prediction in zip(parameters, changed, strict=True):
        fitted = parameter.name not in {effect.name for effect in model.effects}
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
        if second not in model.effects:
            raise InputError(
                f"{number.name} and {second.name} cannot be told apart: they change the outputs in proportion, as "
                "in a product; leave one of them out of numbers=[…], or give it a sigma"
            )
    starts = ", ".join(f"{n.name} = {n.start:g}" for n in model.model.numbers)
    refuse_other_units(runs, given, model.model.outputs, starts)
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
    start, free = start_values(model), [n.parameter for n in model.model.numbers if n.sigma is None]
    points = start, {**start, **{name: value for p in free for name, value in _elsewhere(model, p).items()}}
    return [
        (p, q)
        for p, q in (*combinations(free, 2), *product(free, model.effects))
        if _in_proportion(changes[p.name], changes[q.name], _ROUGHLY)
        and all(_in_proportion(_slope_along(model, at, p), _slope_along(model, at, q)) for at in points)
    ]


def _elsewhere(model: FunctionModel, number: Parameter) -> dict[str, float]:
    """Change a number; what groups have of it by amounts that differ."""
    names, step = list(model.everywhere(number.name, 0.0)), _changed(number) - number.start
    return {name: number.start + step * (place + 1) / len(names) for place, name in enumerate(names)}


def _slope_along(model: FunctionModel, at: dict[str, float], of: Parameter) -> Floats:
    """Return how the prediction changes with a small change of a parameter to either side."""
    names = model.everywhere(of.name, of.start)
    up, down = model.predict(
        [{**at, **{n: of.moved(at[n], by * of.typical) for n in names}} for by in (_SMALL, -_SMALL)]
    )
    return np.asarray(up - down)


def _in_proportion(one: Floats, other: Floats, within: float = 1e-5) -> bool:
    """Say whether two changes of a prediction are in proportion."""
    return bool(abs((one * other).sum()) > (1 - within**2) * np.linalg.norm(one) * np.linalg.norm(other))


def _solved_near(model: FunctionModel, parameter: Parameter, start: dict[str, float]) -> bool:
    """Say whether the function gives finite numbers a little above the start of a parameter, or below it."""
    near = [
        {**start, **model.everywhere(parameter.name, parameter.moved(parameter.start, by * parameter.typical))}
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
