"""Pictures of plans: plan.svg, with the path and the stated error, and by matplotlib jobs and the trade-off.

To import matplotlib takes longer than to plan a path. So plan.svg is drawn on axes of equal scale that write
themselves as SVG. They take those calls of matplotlib's axes that `Plan.plot` makes.

The trade-off is what the dwell decides: a longer one loses less speed at the flips and flips less often, but the
heading swings further. One plan is made for each of several dwells.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from planner.jobs.plan import make_plan
from planner.paths.units import in_lab
from planner.planning.picture import DECLARED, PREDICTED, RAW, REPLAYED, label_points
from planner.planning.plan import Plan
from planner.vehicle.zigzag import QUICK, longest_dwell
from sim.arrays import Floats
from sim.io.errors import InputError
from sim.io.files import whole_file
from sim.io.units import format_time

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_SIZE = 440.0  # of the longer side of the frame, in px
_LEAST = np.array([400.0, 100.0])  # width and height of the frame, in px
_LEFT, _TOP, _RIGHT, _BELOW, _ROW = 60.0, 50.0, 20.0, 60.0, 18.0  # margins, and the height of a row of the legend
_MARGIN = 0.05  # of the drawing around what is drawn
_MOST_TICKS = 6
_TEXT = 'font-family="DejaVu Sans, Verdana, sans-serif" fill="#1a1a1a"'
_LEGEND = 32.0  # points, from the axes to the legend: the numbers and the label of the x axis are between
_COUNT = 10


def plan_svg(result: Plan, identity: str) -> str:
    """Return plan.svg as text; `identity` names the plan."""
    axes: Any = SvgAxes()
    replace(result, job=None).plot(axes)
    rms, stated = (in_lab(error, result.robot) for error in (result.predicted_rms, result.stated_error))
    axes.set_title(f"{schedule_words(result)}\npredicted error {rms} rms, stated error {stated}")
    return str(axes.text(identity))


def schedule_words(result: Plan) -> str:
    """Name the robot, the number of dwells and their duration."""
    return f"{result.robot.name}: {len(result.dwells)} dwells, {format_time(float(result.seconds.sum()))}"


class SvgAxes:
    """Lines, areas and points on axes of equal scale, drawn in the order in which they are added."""

    def __init__(self) -> None:
        self._title = self._x_label = self._y_label = ""
        self._shapes: list[tuple[Floats, str]] = []  # points (n, 2), and the style of their path
        self._legend: list[tuple[str, str]] = []  # style of a line, and words

    def plot(
        self,
        x: ArrayLike,
        y: ArrayLike,
        mark: str = "",
        *,
        color: str,
        lw: float = 1.5,
        ms: float = 6.0,
        label: str = "",
    ) -> None:
        """Add a line, or a dot where `mark` is "o"."""
        ends = "round" if mark else "butt"
        style = f'fill="none" stroke="{color}" stroke-width="{ms if mark else lw}" stroke-linecap="{ends}"'
        self._add(x, y, style, style, label)

    def fill(
        self, x: ArrayLike, y: ArrayLike, *, color: str, alpha: float = 1.0, lw: float = 0.0, label: str = ""
    ) -> None:
        """Add an area."""
        style = f'fill="{color}" fill-opacity="{alpha}" stroke="{color}" stroke-width="{lw}"'
        self._add(x, y, style, f'stroke="{color}" stroke-opacity="{alpha}" stroke-width="8"', label)

    def set_aspect(self, aspect: str) -> None:
        """Accept "equal": these axes have no other."""
        if aspect != "equal":
            raise ValueError(f"these axes have equal scales, not {aspect}")

    def set_xlabel(self, words: str) -> None:
        """Name the horizontal axis."""
        self._x_label = words

    def set_ylabel(self, words: str) -> None:
        """Name the vertical axis."""
        self._y_label = words

    def set_title(self, words: str) -> None:
        """Write lines above the frame."""
        self._title = words

    def text(self, identity: str) -> str:
        """Return the SVG; `identity` is in its metadata."""
        points = np.concatenate([shape for shape, _ in self._shapes])
        low, high = points.min(0), points.max(0)
        span = np.maximum(high - low, 1e-3 * max(float((high - low).max()), 1e-12))
        scale = _SIZE / float(span.max()) / (1 + 2 * _MARGIN)  # px per unit
        width, height = np.maximum(scale * span * (1 + 2 * _MARGIN), _LEAST)
        corner = (low + high) / 2 - np.array([width, height]) / scale / 2

        def pixels(places: Floats) -> Floats:
            x, y = scale * (places - corner).T
            return np.stack([_LEFT + x, _TOP + height - y], 1)

        rows = -(-len(self._legend) // 2)
        total = _LEFT + width + _RIGHT, _TOP + height + _BELOW + _ROW * rows
        middle = _LEFT + width / 2
        parts = [_path(pixels(shape), style) for shape, style in self._shapes]
        parts += _ticks(corner, scale, width, height)
        for i, line in enumerate(reversed(self._title.splitlines())):
            parts.append(_words(middle, _TOP - 10 - 16 * i, line, size=12))
        parts.append(_words(middle, _TOP + height + 38, self._x_label))
        turned = f' transform="rotate(-90 16 {_TOP + height / 2:.2f})"'
        parts.append(_words(16, _TOP + height / 2, self._y_label, more=turned))
        for i, (style, words) in enumerate(self._legend):
            x, y = _LEFT + (i % 2) * width / 2, _TOP + height + _BELOW + _ROW * (i // 2)
            parts.append(_path(np.array([[x, y], [x + 24, y]]), style))
            parts.append(_words(x + 30, y + 4, words, anchor="start"))
        body = "\n".join(parts)
        return f"""<?xml version="1.0" encoding="utf-8"?>
<svg xmlns="http://www.w3.org/2000/svg" width="{total[0]:.0f}" height="{total[1]:.0f}">
<metadata><rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#" xmlns:dc="http://purl.org/dc/elements/1.1/">
<rdf:Description><dc:identifier>{escape(identity)}</dc:identifier></rdf:Description></rdf:RDF></metadata>
<rect width="100%" height="100%" fill="#ffffff"/>
{body}
<rect x="{_LEFT}" y="{_TOP}" width="{width:.2f}" height="{height:.2f}" fill="none" stroke="#1a1a1a"/>
</svg>
"""

    def _add(self, x: ArrayLike, y: ArrayLike, style: str, key: str, label: str) -> None:
        self._shapes.append((np.column_stack([np.atleast_1d(x), np.atleast_1d(y)]).astype(float), style))
        if label:
            self._legend.append((key, label))


def _path(points: Floats, style: str) -> str:
    """Return the path through points in px; a single one is a dot."""
    ends = points if len(points) > 1 else np.repeat(points, 2, 0)
    places = " ".join(f"{x:.2f},{y:.2f}" for x, y in ends.tolist())
    return f'<path d="M {places}" {style} stroke-linejoin="round"/>'


def _words(x: float, y: float, words: str, *, size: int = 11, anchor: str = "middle", more: str = "") -> str:
    place = f'x="{x:.2f}" y="{y:.2f}" font-size="{size}" text-anchor="{anchor}"'
    return f"<text {place} {_TEXT}{more}>{escape(words)}</text>"


def _ticks(corner: Floats, scale: float, width: float, height: float) -> list[str]:
    """Return ticks and their numbers below and left of the frame, whose lower left corner is at `corner`."""
    step = _step(max(width, height) / scale)
    digits = max(0, -math.floor(math.log10(step)))
    parts = []
    for k, size in enumerate((width, height)):
        first = math.ceil(corner[k] / step)
        for i in range(first, math.floor((corner[k] + size / scale) / step) + 1):
            place, number = scale * (i * step - corner[k]), f"{i * step:.{digits}f}".replace("-", "−")
            if k == 0:
                x, y, mark, anchor = _LEFT + place, _TOP + height, "v 5", "middle"
                parts.append(_words(x, y + 18, number, anchor=anchor))
            else:
                x, y, mark, anchor = _LEFT, _TOP + height - place, "h -5", "end"
                parts.append(_words(x - 8, y + 4, number, anchor=anchor))
            parts.append(f'<path d="M {x:.2f},{y:.2f} {mark}" stroke="#1a1a1a"/>')
    return parts


def _step(span: float) -> float:
    """Return 1, 2 or 5 times a power of ten: the smallest with at most so many ticks over a span."""
    power = 10.0 ** math.floor(math.log10(span / _MOST_TICKS))
    return next(power * factor for factor in (1, 2, 5, 10) if span / (power * factor) <= _MOST_TICKS)


def write_svg(figure: Figure, path: Path, identity: str) -> None:
    """Write a figure as SVG, completely or not at all; `identity` names the plan."""
    with whole_file(path) as part:
        figure.savefig(part, format="svg", bbox_inches="tight", metadata={"Date": None, "Identifier": identity})


def draw_plan(plan: Plan) -> Figure:
    """Draw a plan with what belongs to its job."""
    from matplotlib.figure import Figure
    from matplotlib.transforms import ScaledTranslation

    figure = Figure(figsize=(6, 6))
    axes = plan.plot(figure.add_subplot())
    axes.set_title(f"{schedule_words(plan)}\n{plan.job.title(plan)}", fontsize=10, parse_math=False)
    # Below the label of the x axis, however flat the axes are.
    below = axes.transAxes + ScaledTranslation(0.0, -_LEGEND / 72, figure.dpi_scale_trans)
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, 0.0), bbox_transform=below, ncol=2, fontsize=8,
                frameon=False)  # fmt: skip
    return figure


def draw_trade_off(chosen: Plan) -> Figure:
    """Draw errors over time and over the number of flips, for dwells from the shortest to the longest.

    Args:
        chosen: the plan that the user gets.
    """
    from matplotlib.figure import Figure

    plans = []
    for dwell in np.geomspace(QUICK, longest_dwell(chosen.tracked.vehicle, QUICK), _COUNT).tolist():
        with suppress(InputError):  # such dwells do not get the robot around the path
            other = replace(chosen.request, dwell=dwell, tolerance=None, loop=False)
            plans.append(make_plan(chosen.drawn, chosen.tracked, other))
    errors = np.array([(plan.stated_error, plan.predicted_max, plan.predicted_rms) for plan in plans]).T
    kinds = (("stated", PREDICTED), ("predicted, max", DECLARED), ("predicted, rms", RAW))
    figure = Figure(figsize=(9, 4), layout="constrained")
    values: dict[str, Callable[[Plan], float]] = {
        "time / min": lambda plan: float(plan.seconds.sum()) / 60,
        "flips": lambda plan: float(len(plan.dwells)),
    }
    panels = figure.subplots(1, 2, sharey=True)
    for axes, (name, value) in zip(panels, values.items(), strict=True):
        x = [value(plan) for plan in plans]
        for (label, colour), y in zip(kinds, errors, strict=True):
            axes.plot(x, y, "o-", color=colour, ms=3, label=label)
        axes.plot(value(chosen), chosen.stated_error, "s", color=REPLAYED, ms=7, label="this plan")
        axes.set_xlabel(name)
    panels[0].set_ylabel("error / l")
    panels[0].set_ylim(bottom=0)
    for axes, value in zip(panels, values.values(), strict=True):
        places = np.array([[value(plan), plan.stated_error] for plan in plans])
        label_points(axes, places, [f"{plan.minimum_dwell:.2g}" for plan in plans], PREDICTED, 7)
    panels[0].legend(fontsize=8, frameon=False)
    figure.suptitle(f"{chosen.robot.name}: error against time and flips; numbers are dwells", fontsize=10)
    return figure
