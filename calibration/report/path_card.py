"""The part of a calibration's report on paths: the wanted path, and where both schedules lead."""

from __future__ import annotations

from collections.abc import Sequence

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from calibration.report.path_error import WORDS, CarriedOut, Model, PathError
from planner.paths.units import length_in_lab
from sim.io.page_figures import GREEN, INK, ORANGE
from sim.io.pages import Page

_WIDTH = 4.4  # inches
_COLOURS: dict[Model, str] = {"as_given": ORANGE, "corrected": GREEN}


def add_paths(page: Page, errors: Sequence[PathError]) -> None:
    """Add the section on the errors on paths, where they were asked for."""
    if not errors:
        return
    page.section("On a path")
    page.text(
        "Each path was planned for the robot as given and for the corrected robot. Both schedules are carried "
        "out, without feedback, by the corrected robot, whose response to flips is simulated. Lengths are "
        "distances from the wanted path. In brackets: 95 % of the robots that the calibration allows."
    )
    rows = [
        (error.wanted.words, WORDS[name], *_row(each, error.tail_length))
        for error in errors
        for name, each in error.carried_out.items()
    ]
    if rows:
        page.table(("path", "planned with", "rms", "largest", "at the end", "95 % stay within"), rows)
    for error in errors:
        for refusal in error.refusals:
            page.text(f"On the path {error.wanted.words}: {refusal}.", tone="bad")
    drawn = [error for error in errors if error.carried_out]
    if drawn:
        page.figure(draw_paths(drawn), "the wanted path, and the tracks of both schedules on the corrected robot")


def _row(each: CarriedOut, tail_length: float) -> tuple[str, ...]:
    rms, largest, end, within = (
        length_in_lab(length / tail_length, tail_length)
        for length in (each.rms, each.largest, each.end, each.within)
    )
    low, high = (f"{length / tail_length:.2g}" for length in each.end_interval)
    return rms, largest, f"{end.removesuffix(')')}; {low} to {high} l)", within


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
    axes.set_title(error.wanted.words, fontsize=9, parse_math=False)
    axes.set_xlabel("x [cm]", fontsize=9)
    axes.set_ylabel("y [cm]", fontsize=9)
    axes.tick_params(labelsize=8)
