"""Draw the figures of a calibration's report, each readable on a telephone."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Sequence
from textwrap import fill
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, FuncFormatter, MaxNLocator, NullLocator

from calibration.attribution.hypothesis import Hypothesis
from calibration.attribution.nearest import size_interval
from calibration.attribution.rules import UNSEEN
from calibration.findings.findings import Findings
from calibration.findings.samples import FORM, draw_samples, open_forms
from calibration.laws.group_factors import GroupFactors, group_factors
from calibration.laws.law_model import LEVER, law_model
from calibration.laws.places import Place
from calibration.report.path_error import WORDS, Model, PathError
from calibration.statistics.residual_tests import Misfit
from calibration.statistics.statistical_model import Parameter
from calibration.table.runs import Runs
from calibration.words.quantities import feature_in_words
from common.arrays import Flags, Floats
from common.pages import BLUE, GREEN, INK, ORANGE, PALE, RED, VIOLET
from common.units import split
from sim.model.robot import Robot
from sim.pictures.robot_views import arrow, curved_arrow, draw_robot, scene

_WIDTH = 4.4  # inches
_KINDS = (BLUE, ORANGE, GREEN, VIOLET, RED)
_ON_CELLS = "#101010"  # of numbers on pale cells, whatever the colours of the page
_COLOURS: dict[Model, str] = {"as_given": ORANGE, "corrected": GREEN}
_SCALES = {"ω": (30 / math.pi, "motor speed ω [rpm]"), "l": (100.0, "tail length l [cm]"), "N": (1.0, "tails N")}
_LONG = 0.45  # of an arrow, in l
_LINE = 24  # letters in a line of a label
_OUTPUTS, _LEAST = 2, 1e-300  # outputs of which curves are drawn
_SAMPLES, _CORNER = 1500, 6  # rows, and numbers that are drawn in pairs
_WIDEST = 1e3  # samples, over their middle
_TICKS = (3.0, 10.0, 30.0, 100.0, 300.0)
_LAW = (
    "On what it depends. Line and band: the law. Points: the factor that the runs at this input ask for, "
    "everything else fitted anew, with one standard error."
)

_CURVES = (
    "Held-out traces, each predicted from the beginning that is shaded, to which its own numbers are fitted. "
    "Below: measured minus model, of every trace that was fitted."
)

_TRACK = (
    "The track as it was measured, and as models predict it: freely from the start of each part, with all flips "
    "of the motor. The held-out part is dotted in black; its start is fitted to its first fifth."
)

Drawn = tuple[Figure, str, str]  # with a description and a caption


def draw_all(result: Findings) -> dict[str, list[Drawn]]:
    """Draw the figures of a report, by their names in the template; one that fails is left out with a warning."""
    kind, adopted, law, row = result.runs.drawn[1][0], result.nearest, result.law, result.runs.row
    carried_out = [error for error in result.paths if error.carried_out]
    figures: dict[str, Callable[[], list[Drawn]]] = {
        "summary": lambda: [(draw_summary(result), "residual of each output over the noise, for each model",
                             f"The same on the {row}s that were fitted, for each output.")],
    }  # fmt: skip
    if result.runs.plane is None:
        figures["held_out"] = lambda: [(draw_held_out(result), "held-out runs, before and after", "")]
    if result.runs.trace is not None:
        figures["curves"] = lambda: [(figure, f"{output} of held-out traces against time, and residuals", _CURVES)
                                     for figure, output in draw_curves(result)]  # fmt: skip
    else:
        figures["residuals"] = lambda: [(figure, f"residuals by output and {kind}, {model}", model)
                                        for figure, model in draw_residuals(result)]  # fmt: skip
    if any(runs.plane for _, runs in result.runs.pieces):
        figures["track"] = lambda: [
            (draw_track(result), "the track in the plane, measured and by each model", _TRACK)
        ]
    figures["maps"] = lambda: [(figure, f"map of the residual over the inputs of the {row}s, {model}", model)
                               for figure, model in draw_maps(result)]  # fmt: skip
    if result.attribution.misfit.critical_z > 0:  # else no effect can be told from the numbers
        words = "score of each effect against what a claim needs"
        figures["evidence"] = lambda: [(draw_evidence(result), words, "")]
    title = "samples of the fitted numbers and effects in pairs, by form"
    figures["corner"] = lambda: [(figure, title, "") for figure in [draw_corner(result)] if figure]
    if carried_out:
        of_paths = "the wanted path, and the tracks of both schedules on the corrected robot"
        figures["paths"] = lambda: [(draw_paths(carried_out), of_paths, "")]
    if adopted and adopted.evidence.sizes:
        of_sizes = f"size of {adopted.effect.title} for each specimen"
        figures["sizes"] = lambda: [(draw_sizes(adopted), of_sizes, "")]
    if law and law.kept:
        figures["law"] = lambda: _figures_of_law(law.kept[0], result.split.fitted)
    drawn = {name: _drawn(name, draw) for name, draw in figures.items()}
    return {name: each for name, each in drawn.items() if each}


def _drawn(name: str, draw: Callable[[], list[Drawn]]) -> list[Drawn]:
    """Draw figures as they are written; none, with a warning, if that fails."""
    try:
        figures = draw()
        for figure, _, _ in figures:
            figure.draw_without_rendering()
    except (ValueError, ArithmeticError, RuntimeError) as reason:
        warnings.warn(f"the report is without its figure {name!r}: {reason}", stacklevel=2)
        return []
    return figures


def _figures_of_law(law: Hypothesis, used: Flags) -> list[Drawn]:
    """Draw where a law acts, and on what it depends in the runs `used` (n,)."""
    model = law_model(law)
    place = draw_place(model.robot, model.place, law.fitted.parameters.get(LEVER, 0.0))
    drawn = [(place, f"where it acts: {model.place.words}", "Where it acts (red).")]
    if inputs := group_factors(model, law.fitted, used):
        drawn.append((draw_factors(inputs), "the factor of the load against each input", _LAW))
    return drawn


def compared(result: Findings) -> list[tuple[str, Floats]]:
    """List the models whose residuals are drawn, with their predictions (n, k)."""
    names = result.models
    models = [(names["before"], result.base.prediction)]
    if "after" in names:
        models.append((names["after"], result.final.prediction))
    elif result.described and result.law is not None:
        models.append((names["law"], result.law.prediction))
    return models


def draw_summary(result: Findings) -> Figure:
    """Draw the residual of each output for each model, as rms over the fitted runs, in units of the noise."""
    figure = Figure(figsize=(_WIDTH, 0.9 + 0.42 * len(result.runs.outputs)))
    plot_summary(figure.add_subplot(), result)
    figure.legend(fontsize=8, frameon=False, ncols=3, loc="lower center", bbox_to_anchor=(0.5, 1.0))
    figure.tight_layout()
    return figure


def plot_summary(axes: Axes, result: Findings) -> None:
    """Draw the bars of `draw_summary`, without a legend."""
    data = result.runs
    noise = data.scatter(result.base.noise.run_covariance)
    place = np.arange(len(data.outputs))[::-1]
    models = compared(result)
    height = 0.7 / len(models)
    for i, ((label, prediction), colour) in enumerate(zip(models, (ORANGE, GREEN), strict=False)):
        square = np.where(data.gaps, np.nan, (data.y - prediction) ** 2)[result.split.fitted]
        rms = np.sqrt(np.nanmean(square, 0)) / noise
        axes.barh(
            place + height * ((len(models) - 1) / 2 - i), rms, height=0.9 * height, color=colour, label=label
        )
    axes.axvline(1.0, color=INK, lw=1.4, label=f"noise of a {data.row}")
    axes.set_yticks(place, [data.title_of(o) for o in data.outputs], fontsize=9)
    axes.set_xlabel(f"measured − model, rms, over the noise of a {data.row}", fontsize=9)
    axes.tick_params(axis="x", labelsize=8)


def draw_held_out(result: Findings) -> Figure:
    """Draw measured minus model for the output that gains most, in the held-out runs; of traces in the median one.

    Runs are drawn against the setting that tells most of what the refitted model leaves, of those that differ
    between held-out runs; traces against time.
    """
    data, rows, k = result.runs, result.split.test, _gaining(result)[0]
    (factor, unit), title, styles = data.scale_of(data.outputs[k]), data.title_of(data.outputs[k]), ("s", "o")
    measured = np.where(data.gaps[:, k], np.nan, data.raw(data.y)[:, k])
    residuals = [(name, measured - data.raw(prediction)[:, k]) for name, prediction in compared(result)]
    if data.trace is not None:
        traces = _ranked(result, residuals[-1][1])
        rows, words = traces[len(traces) // 2]
        along, label, styles, title = np.asarray(data.time), _time_label(data), ("-", "-"), f"{title}, {words}"
    else:
        differing = {name: of for name, of in data.settings.items() if np.ptp(of[0][rows]) > 0}
        settings = differing or data.settings
        name = max(settings, key=lambda name: _told(settings[name][0], residuals[0][1], result.split.fitted))
        along, label = settings[name][0], _labelled(name, settings[name][1].strip())
        title = f"{title}, the {rows.sum()} held-out {data.row}s"
    figure = Figure(figsize=(_WIDTH, 3.2), layout="constrained")
    axes = figure.add_subplot()
    if band := _band(result, k):
        axes.axhspan(-factor * band, factor * band, color=PALE, alpha=0.5, lw=0, label="± 2 σ of the noise")
    axes.axhline(0, color=INK, lw=0.6)
    for (model, residual), colour, style in zip(residuals, (ORANGE, GREEN), styles, strict=False):
        marker = {"mfc": "none", "ms": 7} if style == "s" else {"ms": 4}
        axes.plot(along[rows], factor * residual[rows], style, color=colour, label=model, **marker)
    axes.set_xlabel(label, fontsize=9)
    axes.set_ylabel(f"measured − model{f' [{unit}]' if unit else ''}", fontsize=9)
    axes.set_title(fill(title, 2 * _LINE), fontsize=9, loc="left", parse_math=False)
    axes.tick_params(labelsize=8)
    figure.legend(loc="outside upper center", fontsize=8, frameon=False, ncols=2)
    return figure


def _told(setting: Floats, residual: Floats, used: Flags) -> float:
    """Return which share of a residual (n,) in the runs `used` a parabola in a setting removes."""
    rows = used & np.isfinite(residual)
    if len(np.unique(setting[rows])) < 3 or not residual[rows].any():
        return 0.0
    x = (setting - setting[rows].mean()) / np.ptp(setting[rows])
    left = residual[rows] - np.polyval(np.polyfit(x[rows], residual[rows], 2), x[rows])
    return 1 - float(left.var() / residual[rows].var())


def _labelled(words: str, unit: str) -> str:
    """Label an axis."""
    return f"{words} [{unit}]" if unit else words


def _time_label(data: Runs) -> str:
    quantity, unit = split(data.time_name)
    return _labelled(quantity, unit.text if unit else "")


def _band(result: Findings, k: int) -> float:
    """Return two standard deviations of the noise of an output; 0 where it is unknown."""
    return 2 * float(np.sqrt(result.final.noise.run_covariance[k, k])) if result.runs.noise_known else 0.0


def _gaining(result: Findings) -> list[int]:
    """List the outputs, that whose error on the held-out runs falls most first."""
    errors = result.errors.by_output
    gains = [errors["after"][name] / max(errors["before"][name], _LEAST) for name in result.runs.outputs]
    return [int(k) for k in np.argsort(gains, kind="stable")]


def draw_residuals(result: Findings) -> list[tuple[Figure, str]]:
    """Draw measured minus model against a setting, a figure for each model; return each with its model.

    Rows of several kinds have a figure each.
    """
    figures, end = [], 0
    for rows, data in result.runs.pieces:
        used, outputs = result.split.fitted[rows], slice(end, end := end + len(data.outputs))
        residuals = {
            label: data.raw(data.y - prediction[rows, outputs])[used] for label, prediction in compared(result)
        }
        limits = 1.1 * np.max([np.abs(residual).max(0) for residual in residuals.values()], 0)
        limits = np.where(limits > 0, limits, 1.0)  # also where no run departs
        figures += [(_draw_residual(residual, limits, used, data), label) for label, residual in residuals.items()]
    return figures


def draw_curves(result: Findings) -> list[tuple[Figure, str]]:
    """Draw held-out traces with what models predict, and the residuals of the fitted ones, against time.

    Of the traces that of the least error, the median and that of the largest.

    Returns:
        A figure for each output, at most _OUTPUTS of them, those with the largest gain; each with its output.
    """
    data, shown = result.runs, sorted(_gaining(result)[:_OUTPUTS])
    return [(_draw_curves(result, k), data.title_of(data.outputs[k])) for k in shown]


def draw_track(result: Findings) -> Figure:
    """Draw what was measured along a track in the plane, and what each model predicts of it."""
    piece, data = next((rows, runs) for rows, runs in result.runs.pieces if runs.plane)
    assert data.plane is not None
    test, places = result.split.test[piece], [data.outputs.index(name) for name in data.plane]
    factor, unit = data.scale_of(data.plane[0])
    figure = Figure(figsize=(_WIDTH, _WIDTH), layout="constrained")
    axes = figure.add_subplot()
    for rows, style in (
        (~test, {"lw": 2.5, "color": PALE}),
        (test, {"ls": ":", "color": INK}),
    ):
        seen = factor * np.where(rows[:, None], data.raw(data.y)[:, places], np.nan)
        axes.plot(*seen.T, **style, label="measured" + ", held out" * bool(rows[-1]))
    for (name, prediction), colour in zip(compared(result), (ORANGE, GREEN), strict=False):
        of_parts = data.raw(prediction[piece, : len(data.outputs)])[:, places]
        if data.parts is not None:  # a part begins where it was, not where the one before has led
            of_parts = np.insert(of_parts, np.flatnonzero(np.diff(data.parts[0])) + 1, np.nan, axis=0)
        axes.plot(*(factor * of_parts.T), color=colour, lw=0.9, label=name)
    axes.set_aspect("equal")
    axes.set_xlabel(f"{data.plane[0]} [{unit}]", fontsize=9)
    axes.set_ylabel(f"{data.plane[1]} [{unit}]", fontsize=9)
    axes.tick_params(labelsize=8)
    figure.legend(loc="outside upper center", fontsize=8, frameon=False, ncols=2)
    return figure


def _draw_curves(result: Findings, k: int) -> Figure:
    """Draw the curves of an output."""
    data, (factor, unit) = result.runs, result.runs.scale_of(result.runs.outputs[k])
    measured = np.where(data.gaps[:, k], np.nan, data.raw(data.y)[:, k])
    models = [(name, data.raw(prediction)[:, k]) for name, prediction in compared(result)]
    held_out = _ranked(result, measured - models[-1][1])
    heights = [*(1.25 for _ in held_out), *(0.9 for _ in models)]
    assert data.trace is not None
    assert data.time is not None
    figure = Figure(figsize=(_WIDTH, sum(heights) + 1.4), layout="constrained")
    panels = figure.subplots(len(heights), 1, sharex=True, height_ratios=heights, squeeze=False)[:, 0]
    curves, residuals = panels[: len(held_out)], panels[len(held_out) :]
    band = _band(result, k)
    for axes, (rows, words) in zip(curves, held_out, strict=True):
        _draw_trace(axes, data, rows, [("measured", measured), *models], k, band)
        axes.set_title(words, fontsize=8, loc="left", pad=3, parse_math=False)
    for axes, (name, curve), colour in zip(residuals, models, (ORANGE, GREEN), strict=False):
        for trace in np.setdiff1d(data.trace[result.split.fitted], data.trace[result.split.test]):
            rows = data.trace == trace
            axes.plot(data.time[rows], factor * (measured - curve)[rows], color=colour, lw=0.6, alpha=0.7)
        axes.axhline(0, color=INK, lw=0.6)
        axes.set_title(f"measured − {name}", fontsize=8, loc="left", pad=3)
        axes.set_ylabel("%" if unit == "%" else "", fontsize=8)
        axes.sharey(residuals[0])
    for axes in panels:
        axes.tick_params(labelsize=8)
        axes.yaxis.set_major_locator(MaxNLocator(4))
    panels[-1].set_xlabel(_time_label(data), fontsize=9)
    figure.supylabel(_labelled(data.title_of(data.outputs[k]), "" if unit == "%" else unit), fontsize=9)
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", fontsize=8, frameon=False, ncols=2)
    return figure


def _draw_trace(
    axes: Axes, data: Runs, rows: Flags, curves: Sequence[tuple[str, Floats]], k: int, band: float
) -> None:
    """Draw one trace: what was measured, what models predict, and a band about the last one."""
    (factor, unit), time = data.scale_of(data.outputs[k]), np.asarray(data.time)[rows]
    is_ratio = unit == "%"
    (name, measured), *models = ((name, curve[rows]) for name, curve in curves)

    def plain(values: Floats) -> Floats:
        return np.exp(values) if is_ratio else factor * values

    if data.heads is not None and (head := data.heads[rows]).any():
        axes.axvspan(time[0], time[head][-1], color=PALE, alpha=0.5, lw=0, label="its own numbers are fitted here")
    if band:
        last = models[-1][1]
        axes.fill_between(time, plain(last - band), plain(last + band), color=GREEN if len(models) > 1 else ORANGE,
                          alpha=0.2, lw=0, label="± 2 σ of the noise")  # fmt: skip
    axes.plot(time, plain(measured), ".", ms=3, color=INK, label=name)
    for (name, curve), colour in zip(models, (ORANGE, GREEN), strict=False):
        axes.plot(time, plain(curve), color=colour, lw=1.2, label=name)


def _ranked(result: Findings, residual: Floats) -> list[tuple[Flags, str]]:
    """Choose held-out traces by the rms of a residual (n,): their rows (n,), each with its name and rank."""
    data, test, trace = result.runs, result.split.test, np.asarray(result.runs.trace)
    traces = np.unique(trace[test])
    errors = [float(np.sqrt(np.nanmean(residual[test & (trace == each)] ** 2))) for each in traces]
    order = np.argsort(errors)
    places = {int(order[0]): "least error", int(order[len(order) // 2]): "median", int(order[-1]): "largest error"}
    words = places if len(traces) > 1 else {0: ""}
    names = [f"trace {name}" if name.isdigit() else name for name in data.trace_names]
    return [(trace == traces[i], f"{names[traces[i]]}{f', {rank}' if rank else ''}") for i, rank in words.items()]


def _draw_residual(residual: Floats, limits: Floats, used: Flags, data: Runs) -> Figure:
    """Draw a residual (n, k) of the runs in `used`, an output in each panel."""
    figure = Figure(figsize=(_WIDTH, 1.25 * len(data.outputs) + 0.5))
    jitter = np.random.default_rng(0).uniform(-1, 1, len(residual))
    setting, (_, kind, kinds) = data.drawn
    values, unit_of_setting = data.settings[setting]
    kind, values = kind[used], values[used]
    jitter *= 0.1 * max(float(np.ptp(values)) / 6, 0.02 * float(np.abs(values).max()))
    panels = figure.subplots(len(data.outputs), 1, sharex=True, squeeze=False)[:, 0]
    for i, (name, axes) in enumerate(zip(data.outputs, panels, strict=True)):
        scale, unit = data.scale_of(name)
        for place in range(len(kinds)):
            some, colour = kind == place, _KINDS[place % len(_KINDS)]
            axes.plot(values[some] + jitter[some], scale * residual[some, i], ".", ms=4, color=colour)
        axes.axhline(0, color=INK, lw=0.6)
        axes.set_ylim(-scale * limits[i], scale * limits[i])
        axes.set_ylabel(_labelled(data.title_of(name), unit), fontsize=8)
        axes.tick_params(labelsize=8)
    levels = np.unique(values)
    if len(levels) <= 8:
        panels[-1].set_xticks(levels, [f"{value:g}" for value in levels])
    panels[-1].set_xlabel(_labelled(setting, unit_of_setting.strip()), fontsize=9)
    _name_kinds(panels[0], kinds)
    figure.align_ylabels()
    figure.tight_layout(h_pad=0.3)
    return figure


def _name_kinds(axes: Axes, kinds: Sequence[str]) -> None:
    """Add a legend of the kinds of runs above a panel."""
    for place, name in enumerate(kinds):
        axes.plot([], [], ".", ms=7, color=_KINDS[place % len(_KINDS)], label=name)
    axes.legend(fontsize=8, frameon=False, ncols=min(len(kinds), 5), loc="lower center", bbox_to_anchor=(0.5, 1.0))


def draw_maps(result: Findings) -> list[tuple[Figure, str]]:
    """Draw z of every output along every feature of the inputs, a figure for each model; each with its model."""
    names = result.models
    maps = [(names["before"], result.attribution.misfit)]
    if result.claims and result.claims[0].evidence.remainder is not None:
        maps.append((names["after"], result.claims[0].evidence.remainder))
    limit = max(4.0, float(np.abs(result.attribution.misfit.scores.shapes).max(initial=0.0)))
    return [(_draw_map(misfit, result.runs, limit), label) for label, misfit in maps if misfit.scores.shapes.size]


def _draw_map(misfit: Misfit, data: Runs, limit: float) -> Figure:
    z = misfit.scores.shapes.T  # (features, outputs)
    figure = Figure(figsize=(_WIDTH, 0.27 * len(z) + 1.0))
    axes = figure.add_subplot()
    largest = np.arcsinh(limit / 2)
    axes.imshow(np.arcsinh(z / 2), cmap="RdBu_r", vmin=-largest, vmax=largest, aspect="auto")
    for i, j in np.argwhere(np.abs(z) > 3):
        colour = "white" if abs(z[i, j]) > 0.4 * limit else _ON_CELLS
        axes.text(j, i, f"{z[i, j]:+.0f}", ha="center", va="center", fontsize=8, color=colour)
    axes.set_yticks(range(len(z)), [feature_in_words(name) for name in misfit.features], fontsize=8)
    titles = [data.title_of(output).replace(" ", "\n") for output in data.outputs]
    axes.set_xticks(range(len(titles)), titles, fontsize=8)
    axes.tick_params(length=0)
    figure.tight_layout()
    return figure


def draw_sizes(form: Hypothesis) -> Figure:
    """Draw the size of an adopted form for each specimen, with its interval, and the interval of the mean."""
    figure = Figure(figsize=(_WIDTH, 0.9 + 0.3 * len(form.evidence.sizes)))
    axes = figure.add_subplot()
    axes.axvspan(*size_interval(form), color=PALE, label="mean, 95 %")
    ranked = sorted(form.evidence.sizes.items(), key=lambda item: item[1][0])
    for place, (_, (value, low, high)) in enumerate(ranked):
        axes.plot([low, high], [place, place], color=GREEN, lw=1.6)
        axes.plot(value, place, "o", ms=5, color=GREEN)
    axes.set_yticks(range(len(ranked)), [name for name, _ in ranked], fontsize=8)
    if form.logarithmic:
        axes.set_xscale("log")
        axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.set_xlabel(_with_unit(form.effect), fontsize=9)
    axes.tick_params(axis="x", labelsize=8)
    axes.legend(fontsize=8, frameon=False, loc="lower center", bbox_to_anchor=(0.5, 1.0))
    figure.tight_layout()
    return figure


def draw_corner(result: Findings) -> Figure | None:
    """Draw samples of numbers and effects in pairs, and alone on the diagonal; None where fewer than two are free.

    Numbers that were given to a tolerance, or are a group's own, are left out, and of the others all but the first
    _CORNER.
    """
    forms = open_forms(result)
    samples = draw_samples(forms, _SAMPLES, seed=0)
    every = (p for refit in forms.values() for p in refit.fitted)
    fitted = {p.name: p for p in every if p.sigma is None and not p.of_group}
    free = [p for p in fitted.values() if _can_be_drawn(samples[p.name])][:_CORNER]
    if len(free) < 2:
        return None
    figure = Figure(figsize=(_WIDTH, _WIDTH))
    panels = figure.subplots(len(free), len(free), squeeze=False)
    of_form = [
        (values, _KINDS[i % len(_KINDS)]) for i, (_, values) in enumerate(samples.groupby(FORM, sort=False))
    ]
    for (row, column), axes in np.ndenumerate(panels):
        below, beside = free[column], free[row]
        axes.set_visible(column <= row)
        for values, colour in of_form:
            x = below.shown * values[below.name]
            if column == row:
                axes.hist(x, bins=np.histogram_bin_edges(below.shown * samples[below.name], 30), color=colour,
                          histtype="stepfilled", alpha=0.6)  # fmt: skip
            else:
                axes.plot(x, beside.shown * values[beside.name], ".", ms=1.5, color=colour, alpha=0.4)
        axes.tick_params(labelsize=7, labelbottom=row == len(free) - 1, labelleft=column == 0 and row > 0)
        axes.xaxis.set_major_locator(MaxNLocator(2))
        axes.yaxis.set_major_locator(MaxNLocator(2))
        if column == row:
            axes.set_yticks([])
        if row == len(free) - 1:
            axes.set_xlabel(_with_unit(below), fontsize=8)
        if column == 0 and row:
            axes.set_ylabel(_with_unit(beside), fontsize=8)
    if len(of_form) > 1:
        for title, (_, colour) in zip(samples[FORM].unique(), of_form, strict=True):
            panels[0, 0].plot([], [], "o", color=colour, label=title)
        figure.legend(fontsize=8, frameon=False, loc="lower left", bbox_to_anchor=(0.0, 1.0))
    figure.tight_layout(h_pad=0.2, w_pad=0.2)
    return figure


def _can_be_drawn(sampled: pd.Series) -> bool:
    """Say whether samples differ, and within few orders of magnitude."""
    low, middle, high = np.quantile(sampled, (0, 0.5, 1))
    return bool(low < high and high - low < _WIDEST * max(abs(middle), np.ptp(np.quantile(sampled, (0.25, 0.75)))))


def _with_unit(number: Parameter) -> str:
    """Label an axis with a number and its unit, in lines that are short enough for a panel."""
    unit = "" if number.unit == "1" else f" [{number.unit}]"
    return fill(f"{number.title}{unit}", _LINE)


def draw_evidence(result: Findings) -> Figure:
    """Draw the score of every effect that these runs can show, with the critical score; what explains is green."""
    named = {e.name for c in result.claims for e in c.added}
    seen = [c for c in result.attribution.candidates if (c.evidence.detectable or 0.0) < UNSEEN]
    ranked = sorted(seen, key=lambda c: abs(c.score))
    critical = result.attribution.misfit.critical_z
    figure = Figure(figsize=(_WIDTH, 0.7 + 0.36 * len(ranked)))
    axes = figure.add_subplot()
    limit = 1.15 * max([critical, *(abs(c.score) for c in ranked)])
    for place, candidate in enumerate(ranked):
        tested = candidate.fit is not None
        colour = GREEN if candidate.effect.name in named else ORANGE if tested else PALE
        axes.barh(place - 0.2, candidate.score, color=colour, height=0.4)
        beside_frame = axes.get_yaxis_transform()
        axes.text(0.02, place + 0.2, candidate.effect.title, fontsize=8, va="center", transform=beside_frame)
        axes.vlines([-critical, critical], place - 0.45, place, color=INK, lw=0.8, ls="--")
    axes.set_xscale("symlog", linthresh=2 * critical)
    axes.set_xlim(-limit, limit)
    axes.set_ylim(-0.7, len(ranked) - 0.3)
    axes.set_yticks([])
    ticks = [t for t in _TICKS if t < limit]
    axes.xaxis.set_major_locator(FixedLocator([*(-t for t in ticks), 0.0, *ticks]))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.tick_params(axis="x", labelsize=8)
    axes.set_xlabel("score z", fontsize=9)
    figure.tight_layout()
    return figure


def draw_paths(errors: Sequence[PathError]) -> Figure:
    """Draw each wanted path with the tracks of both schedules, a panel for each path, in cm."""
    figure = Figure(figsize=(_WIDTH, 3.6 * len(errors) + 0.4), layout="constrained")
    panels = figure.subplots(len(errors), 1, squeeze=False)[:, 0]
    for axes, error in zip(panels, errors, strict=True):
        _draw_path(axes, error)
    labels = {
        label: handle for axes in panels for handle, label in zip(*axes.get_legend_handles_labels(), strict=True)
    }
    figure.legend(list(labels.values()), list(labels), loc="outside upper center", fontsize=8, frameon=False)
    return figure


def _draw_path(axes: Axes, error: PathError) -> None:
    axes.plot(*(100 * error.polyline.T), color=INK, lw=1.4, ls="--", label="wanted path", zorder=3)
    for name, each in error.carried_out.items():
        track, colour = 100 * each.track, _COLOURS[name]
        axes.plot(*track.T, color=colour, lw=0.9, label=f"planned with {WORDS[name]}")
        axes.plot(*track[-1], "o", color=colour, ms=5)
    axes.set_aspect("equal", "datalim")
    axes.set_title(error.words, fontsize=9, parse_math=False)
    axes.set_xlabel("x [cm]", fontsize=9)
    axes.set_ylabel("y [cm]", fontsize=9)
    axes.tick_params(labelsize=8)


def draw_place(robot: Robot, place: Place, lever: float = 0.0) -> Figure:
    """Draw the robot from above with the load of a place: a force or a couple on the axis, or the tails."""
    shown = scene(robot)
    figure = Figure(figsize=(_WIDTH, 2.2))
    axes = figure.add_subplot()
    pose = np.zeros(3)
    draw_robot(axes, shown, pose, 1.0)
    disc = shown.seen_from_above(pose, np.zeros(3))
    if place.part == "tails" and not place.lever_unit:
        for tail in shown.tails:
            axes.plot(*shown.seen_from_above(pose, tail).T, color=RED, lw=4, alpha=0.8, zorder=4)
    else:
        ahead = lever * (shown.length if place.lever_unit == "L" else 1.0)
        _draw_load(axes, place, disc + np.array([ahead, 0.0]), shown.length)
        axes.plot(*disc, "o", color=INK, ms=4, zorder=6)
    axes.set_aspect("equal")
    axes.axis("off")
    axes.margins(0.12)
    figure.tight_layout(pad=0.1)
    return figure


def _draw_load(axes: Any, place: Place, disc: Floats, head_length: float) -> None:
    """Draw a load of the head at the disc, which is at its rear; e_z is to the right, e_x up."""
    at = disc if place.is_term else disc + np.array([head_length / 2, 0.0])  # coefficients act at the centre
    kind = place.wrench or {"Ct": "Fz", "Cr": "Mz", "Cyr": "Fx"}[place.name]
    angles = np.linspace(-0.4 * math.pi, 1.1 * math.pi, 40)
    if kind == "Fx":
        arrow(axes, at, at + np.array([0.0, _LONG]), RED, 2.6)
    elif kind == "Fz":
        along = -_LONG if place.name == "Ct" else _LONG
        arrow(axes, at, at + np.array([along, 0.0]), RED, 2.6)
    elif kind == "My":
        curved_arrow(axes, at + 0.6 * _LONG * np.stack([np.cos(angles), np.sin(angles)], -1), RED, 2.6)
    else:
        curved_arrow(axes, at + _LONG * np.stack([0.25 * np.cos(angles), 0.7 * np.sin(angles)], -1), RED, 2.6)


def draw_factors(inputs: list[GroupFactors]) -> Figure:
    """Draw the factor of a law against every input, with its band and what the runs ask for."""
    figure = Figure(figsize=(_WIDTH, 1.75 * len(inputs) + 0.2))
    panels = figure.subplots(len(inputs), 1, squeeze=False)[:, 0]
    for axes, groups in zip(panels, inputs, strict=True):
        scale, label = _SCALES[groups.symbol]
        along, factor, low, high = groups.line()
        axes.fill_between(scale * along, low, high, color=PALE, lw=0)
        axes.plot(scale * along, factor, color=BLUE)
        axes.errorbar(scale * groups.inputs, groups.factors, groups.errors, fmt="o", ms=4, color=RED, lw=1.2)
        axes.set_xlabel(label, fontsize=9)
        axes.set_ylabel("factor", fontsize=9)
        axes.tick_params(labelsize=8)
        if groups.symbol == "N":
            axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    figure.tight_layout(h_pad=0.5)
    return figure
