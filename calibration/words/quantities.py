"""Numbers of a calibration as people read them: outputs, nuisance parameters and sizes, in the lab's units.

Outputs that are compared as ratios are logarithms inside a calibration: their residuals are relative. The record
(`calibration.findings.record`) has titles of outputs, and factors and units of their residuals. That of a nuisance
parameter or of an effect has the `unit` in which it is shown, and the factor to it, `shown`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from calibration.attribution.rules import UNSEEN
from calibration.statistics.fit import two_digits

Record = Mapping[str, Any]  # a part of verdict.json, or all of it

_FEATURES = {  # what words of a feature's name read as
    "omega": "ω", "direction": "motor's direction", "elapsed_h": "time", "temperature_K": "temperature",
    "tank_diameter": "diameter of the tank", "course_x": "x of the course", "course_y": "y of the course",
}  # fmt: skip
_FAULTS = {"drift": "it drifts", "clock": "its clock is wrong", "step": "something was moved"}  # of traces
_RESOLVED = 2.01  # over the number of draws and one more: the bootstrap resolves no smaller p
_SEVERAL = "several units"  # in the place of a unit, where outputs have several
SHOWN = 3  # outputs in several units, where there is little room
_NEARLY_ALL = 0.995
_MANY_TIMES = math.log(100)


def output_label(record: Record, output: str) -> str:
    """Return the words for an output; its name where there are none."""
    return str(record.get("output_titles", {}).get(output, output))


def output_error(record: Record, error: float, output: str) -> str:
    """Write an error of an output in the unit in which it is shown; default: in per cent."""
    scale, unit = record.get("output_scales", {}).get(output, (100.0, "%"))
    number = f"{scale * error:.1f}" if unit in ("%", "°") else plain(scale * error)
    return f"{number}{_after_number(unit)}".rstrip()


def error_in_words(record: Record, error: float, of: str = "") -> str:
    """Write an error over all outputs in the unit that they share; in per cent where all are relative or angles.

    Over outputs in several units it has none; then those of each output `of` a model, or of "noise", are written.
    """
    scale, unit = _shared_scale(record)
    if unit == _SEVERAL:
        each = {**record["errors_by_output"], "noise": record["scatter_of_a_run"]}.get(of) or {}
        words = [f"{output_label(record, name)} {output_error(record, one, name)}" for name, one in each.items()]
        names = ", ".join(output_label(record, name) for name in record["outputs"])
        return " and ".join(words) or f"{plain(error)} over {names}, in the units of the fit"
    return percent(error) if unit == "%" else f"{plain(scale * error)}{_after_number(unit)}".rstrip()


def held_out_errors(record: Record) -> tuple[list[str], dict[str, list[str]]]:
    """Tabulate the errors on the held-out runs, of the model before and after, and by noise alone.

    Returns:
        Outputs, and model -> an error of each. Outputs that share a unit are taken together; of outputs in
        several units those `SHOWN` are shown that gain most.
    """
    named, final = record["models"], "law" if record["described"] else "after"
    shown_models = ("before", final) if final in named else ("uncalibrated", "before")
    models = {named[model]: model for model in shown_models}
    noise = {noise_of_a_row(record): "noise"} if record["noise_known"] else {}
    names = record["outputs"]
    if _shared_scale(record)[1] != _SEVERAL:
        errors = {words: [error_in_words(record, record[f"error_{model}"])] for words, model in models.items()}
        errors |= {words: [error_in_words(record, record["noise_ceiling"])] for words in noise}
        return [output_label(record, names[0]) if len(names) == 1 else "all outputs"], errors
    each = {**record["errors_by_output"], "noise": record["scatter_of_a_run"]}
    first, second = (each[model] for model in models.values())
    shown = sorted(sorted(names, key=lambda name: second[name] / (first[name] or 1.0))[:SHOWN], key=names.index)
    return [output_label(record, name) for name in shown], {
        words: [output_error(record, each[model][name], name) for name in shown]
        for words, model in (models | noise).items()
    }


def noise_of_a_row(record: Record) -> str:
    """Say what noise a row has; random steps at the flips of a swim are part of it, and add up along the way."""
    return "noise and random steps" if record["row"] == "pose" else f"noise of a {record['row']}"


def _shared_scale(record: Record) -> tuple[float, str]:
    """Return the factor and the unit of an error over all outputs."""
    scales = {(scale, unit) for scale, unit in record.get("output_scales", {}).values()} or {(100.0, "%")}
    if len(scales) == 1:
        return scales.pop()
    return (100.0, "%") if {unit for _, unit in scales} <= {"%", "°"} else (1.0, _SEVERAL)


def feature_in_words(name: str) -> str:
    """Write the name of a feature of the inputs."""
    for word, read in _FEATURES.items():
        name = name.replace(word, read)
    return name


def along_in_words(record: Record, largest: str) -> str:
    """Write along which output and feature a residual is largest."""
    output, _, feature = largest.partition(" along ")
    return f"{output_label(record, output)} along {feature_in_words(feature)}" if feature else largest


def offset(record: Record, size: float, output: str, *, signed: bool = True) -> str:
    """Write by how much an output is off, on the scale on which it is fitted: "-12 %", "+3.1°"."""
    scale, unit = record.get("output_scales", {}).get(output, (100.0, "%"))
    number = plain(scale * (math.expm1(size) if unit == "%" else size), 2)
    return f"{'+' if size > 0 else ''}{number}{_after_number(unit)}".lstrip("" if signed else "+-")


def difference_in_words(record: Record, difference: Record) -> str:
    """Say a difference, as in "the yaw rate of operator B is 12 % below that of operator A (6.8 σ)"."""
    output, size, where, against = (difference[key] for key in ("output", "size", "where", "against"))
    by, side = offset(record, size, output, signed=False), "below" if size < 0 else "above"
    if difference["kind"]:
        words = _trace_in_words(record, difference)
    elif not difference["numbers"]:
        words = f"{output} is {by} {side} 1 {where}"
    elif against:
        words = f"the {output_label(record, output)} of {where} is {by} {side} that of {against}"
    else:
        changes = "changes by ±" if where.startswith("over ") else "falls by" if size < 0 else "rises by"
        words = f"the {output_label(record, output)} {changes} {by} {where}"
    return f"{words} ({difference['z']:.1f} σ)"


def _trace_in_words(record: Record, difference: Record) -> str:
    """Say by what a trace is not like its repeats, as in "the clock of trace cup B runs 3 % fast"."""
    size, name, where, kind = (difference[key] for key in ("size", "column", "where", "kind"))
    output, other = difference["output"], difference["against"]
    by = offset(record, size, output, signed=kind == "step")
    repeats, of = f"its repeat {other}" if other else "its repeats", "do" if not other else "does"
    among = f" in {output_label(record, output)}" if len(record["output_titles"]) > 1 else ""
    words = {
        "drift": f"trace {name} drifts away from {repeats}{among} by {by} {where}",
        "clock": f"the clock of trace {name} runs {plain(100 * abs(size), 2)} % {'fast' if size > 0 else 'slow'}"
        f"{f' against {repeats}' if other else ''}",
        "step": f"trace {name} steps{among} by {by} {where}, and {repeats} {of} not",
        "saturation": f"trace {name} stays at one value{among} {where}, while {repeats} "
        f"{'change' if not other else 'changes'} by {by}",
    }
    instead = "".join(f", or {_FAULTS[each]}" for each in difference["instead"])
    return f"{words[kind]}{instead}"


def move_in_words(move: Record, title: str, shown: float, unit: str, row: str) -> str:
    """Say by how much a number differs in some runs, with its 95 % interval; `title` says where, too.

    Args:
        row: what a row is called (`Runs.row`).
        shown: factor to the `unit` in which the number is shown.
    """
    sizes = np.array([move["change"], *move["interval"]])
    sizes, unit = (100 * np.expm1(sizes), "%") if move["scale"] == "logarithm" else (sizes * shown, unit)
    value, low, high = map(two_digits, (abs(float(sizes[0])), *sorted(np.abs(sizes[1:]).tolist())))
    others = f", or {' or '.join(move['instead'])} differs" if move["instead"] else ""
    side, sigmas = "above" if sizes[0] > 0 else "below", abs(move["score"])
    return f"{title} is {value} {unit} ({low} to {high}) {side} that of the other {row}s ({sigmas:.1f} σ){others}"


def plain(value: float, digits: int = 3) -> str:
    """Write a number with so many significant digits and without an exponent."""
    if value == 0 or not math.isfinite(value):
        return f"{value:g}"
    return np.format_float_positional(float(f"{value:.{digits - 1}e}"), trim="-")


def with_error(value: float, error: float, unit: str, *, signed: bool = False) -> str:
    """Write a value with its error, both to the second digit of the error: "1.34 ± 0.09 MPa"."""
    decimals = min(max(1 - math.floor(math.log10(error)), 0), 6) if error > 0 else 3
    number = f"{value:{'+' if signed else ''}.{decimals}f}"
    if float(number) == 0:
        number = f"{0:.{decimals}f}"
    return f"{number} ± {error:.{decimals}f}{_after_number(unit)}"


def percent(value: float, decimals: int = 2) -> str:
    """Write a share in per cent."""
    return f"{100 * value:.{decimals}f} %"


def interval_in_words(record: Record, interval: Sequence[float]) -> str:
    """Write the 95 % interval of an error over all outputs, or of a gain, as `error_in_words` does."""
    scale, unit = _shared_scale(record)
    if unit == _SEVERAL:
        return f"95 % interval {'with' if interval[0] <= 0 else 'without'} zero"
    low, high = (f"{scale * end:.2f}" if unit == "%" else plain(scale * end) for end in interval)
    return f"95 % interval {low} to {high}{_after_number(unit)}".rstrip()


def gain_in_words(record: Record, before: float, after: float, interval: Sequence[float] | None) -> str:
    """Say whether the error on the held-out runs falls with what is claimed; an interval with zero is no gain."""
    without, with_it = error_in_words(record, before, "before"), error_in_words(record, after, "after")
    rows = f"{record['row']}s"
    if after >= before:
        return f"the error on the held-out {rows} does not fall with it ({without} without, {with_it} with it)"
    falls = f"the error on the held-out {rows} falls from {without} to {with_it}"
    if interval is None:
        return falls
    words = interval_in_words(record, interval)
    if interval[0] <= 0:
        return (
            f"there is no gain that these {rows} can show "
            f"(error on the held-out ones {without} without, {with_it} with it; gain, {words})"
        )
    by = "" if _shared_scale(record)[1] == _SEVERAL else f"by {error_in_words(record, before - after)}, "
    return f"{falls} ({by}{words})"


def removed(share: float) -> str:
    """Write which share of a residual is removed."""
    return "nearly all" if share > _NEARLY_ALL else percent(share, 0)


def digits(value: float, count: int = 3) -> str:
    """Write a number with so many significant digits, large ones with an exponent."""
    return f"{value:.{count}g}"


def p_in_words(p_value: float, draws: int) -> str:
    """Write a p-value of a bootstrap."""
    return f"p {'≤' if p_value <= _RESOLVED / (draws + 1) else '='} {p_value:.2g}"


def given(record: Record, number: Record) -> str:
    """Write the value of a nuisance parameter that was given; that of an offset or a scale is in the table."""
    if number["given"] in (0.0, 1.0) and (number["unit"] == "1" or number["scale"] != "logarithm"):
        return "as in the table" if record["row"] in ("run", "reading") else "as given"
    return f"{plain(number['given'] * number['shown'], 4)} {number['unit']}"


def tolerance(number: Record) -> str:
    """Write the standard deviation that was stated for a nuisance parameter."""
    if number["scale"] == "logarithm":
        return f"± {plain(100 * number['sigma'], 2)} %"
    return f"± {plain(number['shown'] * number['sigma'], 2)}{_after_number(number['unit'])}"


def _after_number(unit: str) -> str:
    """Write a unit as it stands behind a number."""
    return unit if unit == "°" else f" {unit}"


def fitted_value(number: Record, by: str = "") -> str:
    """Write what a nuisance parameter is with its prior, or `by` the runs alone."""
    change, error, unit = number[f"change{by}"], number[f"change{by}_error"], number["unit"]
    if number["scale"] != "logarithm":
        return with_error(change * number["shown"], error * number["shown"], unit, signed=True)
    if unit == "1":
        return with_error(100 * math.expm1(change), 100 * error * math.exp(change), "%", signed=True)
    value = number["given"] * math.exp(change) * number["shown"]
    return with_error(value, error * value, unit)


def size(value: float, of: Record, count: int = 3) -> str:
    """Write the size of an effect in its unit, with so many significant digits."""
    number, unit = plain(value * of["shown"], count), of["unit"]
    if unit == "1" or unit.startswith("1:"):
        return number
    if unit.startswith("1/"):
        return f"{number} per {unit[2:]}"
    if unit.startswith("ln "):
        return f"{number} ({unit})"
    is_product = unit[0].isdigit() or "μ0" in unit or unit == "d/D" or unit.startswith("time scale")
    return f"{number} × {unit}" if is_product else f"{number} {unit}"


def sized(value: float, interval: Sequence[float], of: Record, count: int = 3) -> str:
    """Write the size of an effect with its interval."""
    low, high = (plain(end * of["shown"], count) for end in interval)
    return f"{size(value, of, count)} ({low} to {high})"


def of_theory(value: float, interval: Sequence[float], of: Record, exactly: bool = False) -> str:
    """Write the size of an effect with its interval, over the size that theory gives where that is 1."""
    if exactly:
        return "at the size of theory"
    words = sized(value, interval, of)
    return words.replace(" (", " times the size of theory (", 1) if of.get("theory") == 1 == of["shown"] else words


def detectable(value: float, of: Record) -> str:
    """Write a smallest detectable size; a dash where no size shows in these runs."""
    if value >= UNSEEN:
        return "–"
    if value > max(abs(bound - of["given"]) for bound in of["bounds"]):
        return "beyond its range"
    return size(value, of, 2)


def direction_in_words(direction: Mapping[str, float], error: float) -> str:
    """Say how coefficients change together along a direction in their logarithms, by one standard deviation."""
    changes = {name: part * error for name, part in direction.items() if abs(part) > 0.1}
    words = [f"{name} {_changed_by(change)}" for name, change in changes.items()]
    return " and ".join([", ".join(words[:-1]), words[-1]]) if len(words) > 1 else words[0]


def _changed_by(change: float) -> str:
    """Say a change of a logarithm."""
    if abs(change) > _MANY_TIMES:
        return f"more than {math.exp(_MANY_TIMES):.0f} times {'larger' if change > 0 else 'smaller'}"
    return f"{plain(100 * abs(math.expm1(change)), 2)} % {'larger' if change > 0 else 'smaller'}"


def ranges_in_words(settings: Mapping[str, tuple[float, float, str]]) -> str:
    """Say between which values each setting of runs lies: name -> its ends and its unit."""
    return ", ".join(
        f"{name} = {plain(low)}{unit}" if low == high else f"{name} from {plain(low)} to {plain(high)}{unit}"
        for name, (low, high, unit) in settings.items()
    )
