"""Draw a robot from above and from behind, with its frame and the signs of its motion (docs/reference/signs.md).

Arrows, arcs and angles are those of a simulation with the motor at +1.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.patches import Circle, FancyArrowPatch, Polygon

from common.arrays import Floats
from sim.mechanics import planar
from sim.model.robot import Robot
from sim.motion.shapes import nodes_in_body, steady_states
from sim.motion.steady import steady
from sim.motion.steady_motion import Steady

HEADING = math.radians(20)
INK, PALE, TAIL, HEAD, PATH, TURN = "#222222", "#9aa3ab", "#c8452f", "#2a6fa8", "#2a7f4f", "#8a4fa8"
CIRCLES = ("#2a7fba", "#e08a1e")  # of the directions of the motor
SIZE = 9.5


class RobotScene(NamedTuple):
    """What the picture shows: a robot at the origin of the lab, with its steady motion at motor direction +1.

    Lengths are in l, angles in rad. From behind means looking along e_z: e_x is on the left, e_y is up.
    """

    radius: float  # of the head
    length: float  # of the head
    tails: Floats  # (N, n + 1, 3), in the body frame about the disc's centre
    twist: Floats  # (3,) velocity forward, velocity to the left, yaw rate, of the head's centre
    spins: tuple[float, float]  # ω_t, ω_h about e_z
    slip_angle: float  # θ
    turn_radius: float  # R_yr

    def at(self, time: float) -> Floats:
        """Compute the pose of the head's centre after a time; at time 0 it is at the origin."""
        return planar.compose(np.array([0.0, 0.0, HEADING]), planar.arc(self.twist, time))

    def seen_from_above(self, pose: Floats, points: Floats) -> Floats:
        """Place points (..., 3) of the body frame in the lab, (..., 2)."""
        forward, left = points[..., 2] - self.length / 2, points[..., 0]
        return np.asarray(pose[:2] + planar.turn(np.stack([forward, left], -1), pose[2]))


def scene(robot: Robot) -> RobotScene:
    """Simulate the robot with its motor at +1."""
    motion = steady(robot.groups(), stability=False)
    body, (state,) = steady_states(robot, np.array([math.pi / 4]))
    return RobotScene(
        robot.head_radius / robot.tail_length,
        robot.head_length / robot.tail_length,
        nodes_in_body(body, state),
        np.array([motion.v_z[0], motion.v_x[0], motion.omega_yr[0]]),
        (float(motion.omega_t[0]), float(motion.omega_h[0])),
        float(motion.slip_angle[0]),
        float(motion.turn_radius[0]),
    )


def from_behind(angles: Floats, radius: float) -> Floats:
    """Return the picture's points, rightwards and up, at angles about e_z from e_x towards e_y."""
    return radius * np.stack([-np.cos(angles), np.sin(angles)], -1)


def arrow(axes: Any, start: Any, end: Any, colour: str, width: float = 2.0) -> None:
    """Draw a straight arrow."""
    style: Any = {"arrowstyle": "-|>", "mutation_scale": 13, "shrinkA": 0, "shrinkB": 0}
    axes.add_patch(FancyArrowPatch(tuple(start), tuple(end), color=colour, lw=width, zorder=5, **style))


def curved_arrow(axes: Any, points: Floats, colour: str, width: float = 2.0) -> None:
    """Draw an arrow along points."""
    axes.plot(*points[:-1].T, color=colour, lw=width, zorder=5, solid_capstyle="butt")
    arrow(axes, points[-2], points[-1], colour, width)


def sector(low: float, high: float, radius: float) -> Floats:
    """Return the points of an arc about the origin of the lab."""
    angles = np.linspace(low, high, 60)
    return radius * np.stack([np.cos(angles), np.sin(angles)], -1)


def polar(angle: float, radius: float) -> Floats:
    """Return a point of the lab."""
    return np.array([radius * math.cos(angle), radius * math.sin(angle)])


def draw_robot(axes: Any, shown: RobotScene, pose: Floats, alpha: float) -> None:
    """Draw head and tails from above."""
    z, x = np.array([0, 1, 1, 0]) * shown.length, np.array([-1, -1, 1, 1]) * shown.radius
    corners = shown.seen_from_above(pose, np.stack([x, 0 * x, z], -1))
    axes.add_patch(Polygon(corners, facecolor="#dfe9f1", edgecolor=HEAD, lw=1.5, alpha=alpha, zorder=3))
    for tail in shown.tails:
        axes.plot(*shown.seen_from_above(pose, tail).T, color=TAIL, lw=2.2, alpha=alpha, zorder=2)


def draw_from_above(axes: Any, shown: RobotScene) -> None:
    """Draw the robot in the frame of the lab, with heading, path and slip angle."""
    turning = math.copysign(1.0, shown.twist[2])
    way = math.atan2(shown.twist[1], shown.twist[0])  # direction of the path relative to the heading
    period = 2 * math.pi / abs(shown.twist[2])
    later = shown.at(0.22 * period)
    draw_robot(axes, shown, shown.at(0.0), 1.0)
    draw_robot(axes, shown, later, 0.35)
    track = np.array([shown.at(t)[:2] for t in np.linspace(-0.11, 0.58, 200) * period])
    axes.plot(*track.T, color=PATH, lw=1.2, ls=(0, (4, 3)), zorder=1)
    curved_arrow(axes, track[-8:], PATH, 1.2)
    axis = np.array([polar(HEADING, -1.55), polar(HEADING, 0.95)])
    axes.plot(*axis.T, color=INK, lw=0.9, ls=(0, (8, 3, 1, 3)), zorder=4)
    arrow(axes, polar(HEADING, 0.85), polar(HEADING, 1.0), INK, 1.0)
    arrow(axes, (0, 0), polar(HEADING + way, 0.8), PATH)
    axes.plot([0, 0.95], [0, 0], color=PALE, lw=1.0, zorder=4)
    curved_arrow(axes, sector(0, HEADING, 0.78), INK, 1.1)
    curved_arrow(axes, sector(HEADING, HEADING + way, 0.45), TURN, 1.3)
    axes.plot(0, 0, "o", color=INK, ms=5, zorder=6)
    centre = polar(HEADING + way + turning * math.pi / 2, shown.turn_radius)
    axes.plot(*centre, "+", color=PATH, ms=8)
    axes.plot(*np.stack([centre, track[-60]]).T, color=PATH, lw=0.7)
    side = "left" if turning > 0 else "right"
    text = {"fontsize": SIZE, "zorder": 7}
    axes.text(*polar(HEADING / 2, 0.83), "heading ψ", color=INK, va="center", **text)
    axes.text(*polar(HEADING + 0.08, 1.07), "axis, from the\ntails to the head", color=INK, va="center", **text)
    axes.text(*polar(HEADING + 0.84 * way, 0.59), "slip angle θ", color=TURN, **text)
    axes.text(*polar(HEADING + way, 0.86), "velocity v\n(along the path)", color=PATH, ha="center", **text)
    axes.text(0.12, -0.3, "(x, y): the head's centre", color=INK, va="top", **text)
    axes.plot([0.11, 0.02], [-0.31, -0.05], color=INK, lw=0.7, zorder=6)
    middle = (centre + track[-60]) / 2
    axes.text(middle[0] + 0.04, middle[1] + 0.05, "$R_{yr}$", color=PATH, **text)
    axes.text(*(centre - [0.03, 0.03]), f"motor at +1:\nit turns {side}", color=PATH, ha="right", va="top", **text)
    tip = shown.seen_from_above(shown.at(0.0), shown.tails[0, -1])
    axes.text(*(tip - [0.02, 0.14]), "tails", color=TAIL, ha="center", va="top", **text)
    corner = np.array([-1.75, -1.05])
    for end, name, align in (((0.45, 0.0), "x", "left"), ((0.0, 0.45), "y", "center")):
        arrow(axes, corner, corner + end, INK, 1.3)
        axes.text(*corner + np.array(end) * 1.12, name, ha=align, va="center", **text)
    axes.set_title("from above: the frame of the lab", fontsize=SIZE + 1.5)
    axes.set_xlim(-1.9, 2.05)
    axes.set_ylim(-1.2, 1.45)


def draw_from_behind(axes: Any, shown: RobotScene) -> None:
    """Draw head and disc, looking from the tails to the head, with the senses of their spins."""
    R = 1.0
    axes.add_patch(Circle((0, 0), R, facecolor="#dfe9f1", edgecolor=HEAD, lw=1.5))
    axes.plot([-2.2, 2.2], [0.72, 0.72], color=PALE, lw=1.0)
    axes.text(2.2, 0.78, "surface", color=PALE, fontsize=SIZE, ha="right", va="bottom")
    for root in shown.tails[:, 0]:
        angle = np.array(math.atan2(root[1], root[0]))
        axes.add_patch(Circle(tuple(from_behind(angle, 0.72)), 0.11, color=TAIL, zorder=4))
    for spin, radius, colour, start in ((shown.spins[0], 0.42, TAIL, 0.15), (shown.spins[1], 1.22, HEAD, -0.35)):
        angles = start * math.pi + math.copysign(1.0, spin) * np.linspace(0, 1.25 * math.pi, 80)
        if spin < 0:
            angles += 1.95 * math.pi
        curved_arrow(axes, from_behind(angles, radius), colour)
    push = math.copysign(1.0, -shown.spins[1])  # the side force is opposed to the head's spin: along e_x
    arrow(axes, from_behind(np.array(0.0), 1.45 * push), from_behind(np.array(0.0), 2.2 * push), PATH)
    text = {"fontsize": SIZE, "ha": "center"}
    axes.text(0, -0.12, "+1", color=TAIL, va="center", **text)
    for name, spin, height, colour in zip(
        ("tails", "head"), shown.spins, (-1.5, -1.85), (TAIL, HEAD), strict=True
    ):
        sense = "clockwise" if spin > 0 else "counter-clockwise"
        axes.text(0, height, f"{name}: {sense}", color=colour, **text)
    axes.text(-1.85, -0.42, "side\nforce", color=PATH, va="center", **text)
    axes.set_title("from behind: the motor at +1", fontsize=SIZE + 1.5)
    axes.set_xlim(-2.4, 2.4)
    axes.set_ylim(-2.1, 1.7)


def plot_circles(axes: Any, robot: Robot, motions: Sequence[Steady]) -> None:
    """Draw the circles of the head's centre for motor directions +1 and -1, from the same start, on axes in cm."""
    cm = 100 * robot.tail_length
    for motion, label, colour in zip(motions, ("motor at +1", "motor at −1"), CIRCLES, strict=True):
        turn, sway, surge = float(motion.omega_yr[0]), float(motion.v_x[0]), float(motion.v_z[0])
        heading = np.linspace(0, 2 * np.pi, 200) * np.sign(turn)
        x = cm * (surge * np.sin(heading) - sway * (1 - np.cos(heading))) / turn
        y = cm * (surge * (1 - np.cos(heading)) + sway * np.sin(heading)) / turn
        axes.plot(x, y, color=colour, label=label)
        axes.annotate(
            "", (x[30], y[30]), (x[27], y[27]), arrowprops={"arrowstyle": "-|>", "color": colour, "lw": 1.2}
        )
    axes.plot(0, 0, "o", color=INK, ms=5)
    axes.annotate("", (0.45 * cm, 0), (0, 0), arrowprops={"arrowstyle": "-|>", "color": INK})
    axes.text(0.48 * cm, 0, "heading\nat the start", fontsize=8, va="center")
    axes.set_aspect("equal")
    axes.set_xlim(right=max(1.4 * cm, axes.get_xlim()[1]))
    axes.set_xlabel("x [cm]")
    axes.set_ylabel("y [cm]")
