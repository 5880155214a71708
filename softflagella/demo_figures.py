"""Draw the figures of the demo's page: in the units of a lab, each readable on a telephone."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from common.arrays import Floats
from common.pages import BLUE, GREEN, INK, ORANGE, RED, SOFT, VIOLET
from dataset.figures import plain_logarithms
from planner.planning.picture import draw_tracks
from sim.model.response import DWELLS
from sim.model.robot import Robot
from sim.motion.robot_views import draw_from_above, draw_from_behind, plot_circles, scene
from sim.motion.steady_motion import RPM, Steady, lab_columns
from tracking.tracks import TrackingError, draw_overlay

_WIDTH = 4.4  # inches: two of them stand beside each other
_NARROW = 3.0  # three
_TAILS = {1: SOFT, 2: BLUE, 3: ORANGE, 4: GREEN, 5: VIOLET}
_LEFT, _RIGHT = BLUE, ORANGE  # of the directions of the motor, and of the turns that they make
_MAGNIFIED = 40.0  # s of the schedule that are magnified
_QUANTITIES = {  # column of a motion in lab units -> what it is called, and its unit
    "omega_yr_rad_s": ("yaw rate", "rad/s"),
    "R_yr_cm": ("turn radius", "cm"),
    "theta_deg": ("slip angle", "°"),
}


def draw_robot(robot: Robot) -> list[tuple[Figure, str, str]]:
    """Draw the robot from above and from behind, to scale, with its frame and the motor at +1."""
    shown = scene(robot)
    above = Figure(figsize=(4.9, 3.6))
    axes = above.add_subplot()
    draw_from_above(axes, shown)
    axes.set_ylim(-1.15, 1.6)
    bar = 0.05 / robot.tail_length
    axes.plot([0.75, 0.75 + bar], [-1.05, -1.05], color=INK, lw=2.5, solid_capstyle="butt")
    axes.text(0.75 + bar / 2, -1.0, "5 cm", ha="center", va="bottom", fontsize=9.5)
    behind = Figure(figsize=(3.4, 2.9))
    draw_from_behind(behind.add_subplot(), shown)
    for figure in (above, behind):
        figure.axes[0].set_title("")
        figure.axes[0].set_aspect("equal")
        figure.axes[0].axis("off")
        figure.tight_layout(pad=0.1)
    from_above = "the robot from above, to scale, with its axes, heading and path"
    return [
        (above, from_above, "From above, to scale. Motor at +1."),
        (behind, "the robot from behind, with the senses of its spins", "From behind. Motor at +1."),
    ]


def draw_circles(robot: Robot, motions: Sequence[Steady]) -> Figure:
    """Draw the circles of the head's centre for both directions of the motor, from the same start."""
    figure = Figure(figsize=(_WIDTH, 3.9))
    axes = figure.add_subplot()
    plot_circles(axes, robot, motions)
    _label(axes, "x [cm]", "y [cm]")
    _legend_above(axes)
    return _finished(figure)


def draw_path(plan: Mapping[str, Any], error: TrackingError, label: str = "replayed") -> Figure:
    """Draw the path as given, the declared path with its stated error, and a track, in cm."""
    length = plan["robot"]["tail_length_m"]
    figure = Figure(figsize=(_NARROW, 3.4))
    axes = figure.add_subplot()
    draw_tracks(axes, np.array(plan["raw_path"]), np.array(plan["reference"]), error.stated, length)
    axes.plot(*(100 * length * error.track.T), color=RED, lw=0.8, label=label)
    axes.plot(*(100 * length * error.track[0]), "o", color=RED, ms=4)
    _label(axes, "x [cm]", "y [cm]")
    _legend_above(axes, columns=2)
    return _finished(figure)


def draw_plans(plans: Mapping[str, tuple[dict[str, Any], TrackingError]]) -> Figure:
    """Draw all plans with their replays side by side, in tail lengths."""
    figure = Figure(figsize=(13, 4.6))
    for panel, (name, (plan, error)) in enumerate(plans.items()):
        axes = figure.add_subplot(1, len(plans), panel + 1)
        draw_overlay(axes, plan, error, f"{name}, N = {int(plan['robot']['groups']['N'])}")
    figure.axes[0].legend(fontsize=7, frameon=False, loc="center")
    figure.tight_layout()
    return figure


def draw_schedule(plan: dict[str, Any], track: pd.DataFrame) -> Figure:
    """Draw the direction of the motor over the whole schedule, a magnified interval, and the heading there.

    Args:
        track: of the replay, time_s and heading_rad.
    """
    dwells = np.array(plan["dwell_s"])
    starts = np.concatenate([[0.0], np.cumsum(dwells)])
    directions = plan["first_direction"] * (-1.0) ** np.arange(len(dwells))
    low = max(float(starts[int(np.argmax(dwells[2:-2])) + 2]) - 0.75 * _MAGNIFIED, 0.0)  # about the longest dwell
    figure = Figure(figsize=(_WIDTH, 4.2))
    grid = figure.add_gridspec(3, 1, height_ratios=(1, 1, 1.7))
    whole, interval, answer = (figure.add_subplot(grid[i]) for i in range(3))
    for axes, scale in ((whole, 60.0), (interval, 1.0)):
        for direction, colour in ((1.0, _LEFT), (-1.0, _RIGHT)):
            spans = [
                (start / scale, dwell / scale)
                for start, dwell, way in zip(starts, dwells, directions, strict=False)
                if way == direction and (axes is whole or low - dwell < start < low + _MAGNIFIED)
            ]
            axes.broken_barh(spans, (min(direction, 0.0), 1.0), facecolors=colour, lw=0)
        axes.axhline(0, color=INK, lw=0.6)
        axes.set_yticks([-0.5, 0.5], ["−1, right", "+1, left"])
        axes.set_ylim(-1, 1)
    whole.axvspan(low / 60, (low + _MAGNIFIED) / 60, color=INK, alpha=0.35, lw=0)
    whole.set_xlim(0, starts[-1] / 60)
    _label(whole, "time [min]", "motor")
    interval.set_xlim(low, low + _MAGNIFIED)
    _label(interval, "", "motor")
    time, heading = track["time_s"].to_numpy(float), np.degrees(track["heading_rad"].to_numpy(float))
    shown = (time >= low) & (time <= low + _MAGNIFIED)
    answer.plot(time[shown], heading[shown], color=INK, lw=1.2)
    answer.set_xlim(low, low + _MAGNIFIED)
    _label(answer, "time [s]", "heading [°]")
    figure.align_ylabels()
    return _finished(figure)


def in_lab_units(rows: pd.DataFrame, motion: pd.DataFrame | dict[str, Floats], robot: Robot) -> pd.DataFrame:
    """Write the motion of dimensionless rows in lab units, as if they had the head, fluid and modulus of `robot`.

    Args:
        rows: the robots, with l_over_R, l_over_r0, omega_bar and N.
        motion: theirs, simulated or predicted.

    Returns:
        N, l_cm, omega_rpm, and the columns of `sim.motion.steady_motion`.
    """
    length = rows["l_over_R"].to_numpy(float) * robot.head_radius
    scale = 4 * robot.viscosity / (math.pi * robot.youngs_modulus)
    time = scale * rows["l_over_r0"].to_numpy(float) ** 4  # μ0 l⁴/EI with EI = E π r0⁴/4
    motion = {name: np.asarray(motion[name], dtype=float) for name in motion if name in _NEEDED}
    lab = pd.DataFrame(lab_columns(motion, 100 * length, time))
    lab["N"], lab["l_cm"] = rows["N"].to_numpy(int), 100 * length
    lab["omega_rpm"] = rows["omega_bar"].to_numpy(float) / time / RPM
    return lab


_NEEDED = {"omega_h_bar", "omega_t_bar", "omega_yr_bar", "R_yr_over_l", "theta_deg", "v_x", "v_z"}


def draw_sweep(lab: pd.DataFrame) -> list[tuple[Figure, str, str]]:
    """Draw what the robots of a sweep do: yaw rate over the motor's speed, turn radius over the tails' length."""
    panels = (
        ("omega_rpm", "motor speed [rpm]", "omega_yr_rad_s", True),
        ("l_cm", "tail length [cm]", "R_yr_cm", False),
    )
    figures = []
    for name, label, output, logarithmic in panels:
        words, unit = _QUANTITIES[output]
        figure = Figure(figsize=(_WIDTH, 3.1))
        axes = figure.add_subplot()
        for tails, part in lab.groupby("N"):
            colour = _TAILS.get(int(str(tails)), RED)
            axes.plot(part[name], part[output].abs(), ".", ms=5, color=colour, label=f"N = {tails}")
        if logarithmic:
            _logarithmic(axes)
        _label(axes, label, f"{words} [{unit}]")
        _legend_above(axes, columns=4)
        figures.append((_finished(figure), f"{words} against {label}", f"{words} against {label.split(' [')[0]}"))
    return figures


def draw_net_speed(robot: Robot, net_speed: Floats) -> Figure:
    """Draw how fast a robot gets ahead when its motor flips at equal times.

    Args:
        net_speed: (D,) for the dwells `sim.model.response.DWELLS`, dimensionless.
    """
    figure = Figure(figsize=(_WIDTH, 2.9))
    axes = figure.add_subplot()
    speed = 6000 * robot.tail_length / robot.time_scale * net_speed
    axes.plot(robot.time_scale * DWELLS, speed, color=BLUE, lw=1.4)
    axes.set_xscale("log")
    plain_logarithms(axes.xaxis)
    axes.set_ylim(bottom=0)
    _label(axes, "time between flips [s]", "net speed [cm/min]")
    return _finished(figure)


def draw_parity(simulated: pd.DataFrame, predicted: pd.DataFrame) -> list[tuple[Figure, str, str]]:
    """Draw predictions of the look-up table against the simulator, a figure for each quantity, with its error."""
    figures = []
    for name, (words, unit) in _QUANTITIES.items():
        truth, answer = (np.abs(table[name].to_numpy(float)) for table in (simulated, predicted))
        figure = Figure(figsize=(_NARROW, 2.7))
        axes = figure.add_subplot()
        axes.plot(truth, answer, ".", ms=4, color=BLUE)
        ends = [np.nanmin(truth), np.nanmax(truth)]
        axes.plot(ends, ends, color=INK, lw=0.7)
        if name == "omega_yr_rad_s":
            _logarithmic(axes, (1.0,))
        off = np.abs(answer - truth)
        error = f"{np.nanmedian(off):.1g}°" if name == "theta_deg" else f"{100 * np.nanmedian(off / truth):.1g} %"
        _label(axes, f"simulated {words} [{unit}]", f"look-up table [{unit}]")
        figures.append(
            (_finished(figure), f"{words}, look-up table against simulator", f"{words}: median error {error}")
        )
    return figures


def _logarithmic(axes: Axes, multiples: Sequence[float] = (1.0, 2.0, 5.0)) -> None:
    axes.set_xscale("log")
    axes.set_yscale("log")
    plain_logarithms(axes.xaxis, multiples)
    plain_logarithms(axes.yaxis, multiples)


def _label(axes: Axes, x: str, y: str) -> None:
    axes.set_xlabel(x, fontsize=9)
    axes.set_ylabel(y, fontsize=9)
    axes.tick_params(labelsize=8)


def _legend_above(axes: Axes, *, columns: int = 3) -> None:
    axes.legend(
        fontsize=8, frameon=False, ncols=columns, loc="lower center", bbox_to_anchor=(0.5, 1.0),
        handlelength=1.2, columnspacing=1.0,
    )  # fmt: skip


def _finished(figure: Figure) -> Figure:
    figure.tight_layout(pad=0.3)
    return figure
