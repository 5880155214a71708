"""The part of a calibration's report on laws: where the term acts, on what it depends, and what fits as well."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from calibration.laws.curves import Curve
from calibration.laws.inputs import EXPONENTS
from calibration.laws.law import Law
from calibration.laws.law_fits import Laws
from calibration.laws.law_model import LEVER
from calibration.laws.partial_residuals import Dependence, dependences
from calibration.laws.places import Place
from calibration.laws.readings import INPUTS
from calibration.report.quantities import plain
from calibration.verdict.verdict import Verdict
from sim.arrays import Flags, Floats
from sim.io.page_figures import BLUE, INK, PALE, RED
from sim.io.pages import Page
from sim.model.robot import Robot
from sim.motion.robot_views import arrow, curved_arrow, draw_robot, scene

_WIDTH = 4.4  # inches
_SCALES = {"ω": (30 / math.pi, "motor speed ω [rpm]"), "l": (100.0, "tail length l [cm]"), "N": (1.0, "tails N")}
_LONG = 0.45  # of an arrow, in l


def add_laws(page: Page, result: Verdict) -> None:
    """Add the section on laws, where they were looked for."""
    laws = result.corrections.law
    if not isinstance(laws, Laws):
        return
    page.section("Laws that describe the residual")
    if result.explaining:
        page.text(
            "Something outside the catalogue could imitate what is claimed, so laws were fitted to the calibrated "
            "model without it."
        )
    page.text(laws.sentence, tone="good" if laws.complete else "bad")
    page.text(
        "A law is a place where a term acts, times a power law in the motor speed ω, the tail length l and the "
        "number of tails N. It describes the runs; it is no claim about the cause. Intervals are of 95 %, "
        "at this place. The p-value of the search counts the choice among the places; so does the share of "
        f"bootstrap tables in which a place ranks first.{_simultaneous(laws)}"
    )
    if laws.kept:
        best = laws.kept[0]
        shown = draw_place(best.model.robot, best.place, best.fit.parameters.get(LEVER, 0.0))
        figures = [(shown, f"where it acts: {best.place.words}", "Where it acts (red).")]
        curves = dependences(best, result.conditions.split.fitted)
        if curves:
            caption = (
                "On what it depends. Line and band: the law. Points: the factor that the runs at this input ask "
                "for, with one standard error, everything else as fitted. Dashed: where they contradict a power "
                "law, a smooth curve through points for which everything else was fitted anew."
            )
            figures.append((draw_dependences(curves), "the factor of the load against each input", caption))
        page.figures(figures)
    _add_curved(page, laws, result.conditions.split.fitted)
    if laws.fitted:
        page.table(
            (
                "place",
                *(f"exponent of {symbol}" for symbol in INPUTS),
                "gain in BIC",
                "first in … of bootstrap tables",
                "held-out error",
                "judgement",
            ),
            [_row(law, laws) for law in laws.fitted],
        )


def _add_curved(page: Page, laws: Laws, used: Flags) -> None:
    """Show the law that describes the runs with a curve in place of a power law, if it is not the best law."""
    curved = laws.curved
    if curved is None or (laws.kept and curved.place == laws.kept[0].place):
        return
    page.figures(
        [
            (
                draw_dependences(dependences(curved, used)),
                f"the factor of another law against each input: {curved.place.words}",
                f"With a curve in place of a power law: {curved.place.words}.",
            )
        ]
    )


def _simultaneous(laws: Laws) -> str:
    """Say the intervals of the best law that count the choice among the places; empty if it has no exponents."""
    if not laws.kept or laws.selection is None:
        return ""
    best = laws.kept[0]
    intervals = {
        symbol: laws.simultaneous_interval(best, name)
        for name, symbol in zip(EXPONENTS, INPUTS, strict=True)
        if name in best.fit.names
    }
    said = ", ".join(f"{symbol} {plain(low, 2)} to {plain(high, 2)}" for symbol, (low, high) in intervals.items())
    return f" Intervals of the best law that cover the exponents of all places at once: {said}." if said else ""


def _row(law: Law, laws: Laws) -> tuple[str, ...]:
    described = "describes the runs" if laws.significant else "noise alone can gain as much"
    kept = described if law.p_value >= laws.level / 2 else "leaves more than noise"
    return (
        ", ".join(filter(None, (law.place.words, law.where))),
        *(_exponent(law, name) for name in EXPONENTS),
        f"{law.gain:.0f}",
        f"{100 * laws.selection.first[law.place.name]:.0f} %" if laws.selection else "–",
        f"{100 * law.error:.2f} %",
        law.reason or kept,
    )


def _exponent(law: Law, name: str) -> str:
    if name not in law.fit.names:
        return "–"
    low, high = law.fit.interval(name)
    return f"{plain(law.fit.parameters[name], 2)} ({plain(low, 2)} to {plain(high, 2)})"


def draw_place(robot: Robot, place: Place, lever: float = 0.0) -> Figure:
    """Draw the robot from above with the load of a place: a force or a couple on the axis, or the tails.

    Args:
        lever: of a side force that has one.
    """
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


def draw_dependences(curves: list[Dependence]) -> Figure:
    """Draw the factor of a law against every input, with its band and what the runs ask for."""
    figure = Figure(figsize=(_WIDTH, 1.75 * len(curves) + 0.2))
    panels = figure.subplots(len(curves), 1, squeeze=False)[:, 0]
    for axes, curve in zip(panels, curves, strict=True):
        scale, label = _SCALES[curve.symbol]
        axes.fill_between(scale * curve.inputs, curve.low, curve.high, color=PALE, lw=0)
        axes.plot(scale * curve.inputs, curve.factor, color=BLUE)
        axes.errorbar(scale * curve.groups, curve.by_runs, curve.errors, fmt="o", ms=4, color=RED, lw=1.2)
        if curve.curve is not None:
            _draw_asked(axes, curve.curve, scale)
        axes.set_xlabel(label, fontsize=9)
        axes.set_ylabel("factor", fontsize=9)
        axes.tick_params(labelsize=8)
        if curve.symbol == "N":
            axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    figure.tight_layout(h_pad=0.5)
    return figure


def _draw_asked(axes: Any, asked: Curve, scale: float) -> None:
    """Draw the smooth curve that the runs ask for in place of a power law, with its band and a legend."""
    axes.fill_between(scale * asked.inputs, asked.low, asked.high, color=RED, alpha=0.15, lw=0)
    label = f"the runs' own curve, 95 %; power law: p = {asked.p_value:.2g}"
    axes.plot(scale * asked.inputs, asked.factor, "--", color=RED, lw=1.2, label=label)
    axes.legend(frameon=False, fontsize=7)
