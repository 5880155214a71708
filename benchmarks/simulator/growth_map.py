"""Growth of small perturbations over motor speed and natural curvature and twist of the tails, and its border.

1. The paper's robots over a grid of ω̄, natural curvature and natural twist.
2. A robot that yaws fast (row 3620 of `robustness`): the orbit with tails alike is followed from a slow motor at
   each curvature and twist, up to the speed where small perturbations begin to grow. On both sides of each border,
   5 % away, the orbit is perturbed and stepped in time beside itself; the distance must shrink below and grow
   above.

Usage: python -m benchmarks growth_map [CURVATURES]

Takes 5 minutes.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from matplotlib.figure import Figure

from benchmarks.pictures import save_picture
from benchmarks.simulator.branches import robot_of
from benchmarks.simulator.robustness import robots
from sim.arrays import Floats
from sim.model.groups import Groups
from sim.model.presets import PRESETS
from sim.model.robot import Robot
from sim.motion.batches import one_thread
from sim.motion.continuation import Point, first_point, follow, locate
from sim.motion.exponents import leading_exponent
from sim.motion.orbits import Perturbed, solve_orbits
from sim.motion.revolution import STEPS, Revolutions
from sim.motion.slow_sweep import perturbed
from sim.motion.swept_input import SweptInput
from sim.motion.tails_alike import EDGES, TailsAlike
from sim.motion.turn_shapes import state_from_orbit
from sim.solve.assembly import numbers
from sim.solve.refinement import SOLVED

_SPEEDS = np.geomspace(2.0, 300.0, 16)
_CURVATURES = np.linspace(-1.0, 1.0, 9)
_TWISTS = (0.0, 3.0, 6.0)
_ROW = 3620
_FAST_RANGE = (30.0, 115.0)  # ω̄ of the robot that yaws fast
_FAST_TWISTS = (0.0, 3.0)
_AWAY = 0.05  # relative distance of the points that are stepped in time from the border
_SIZE = 1e-4  # of their perturbation, in l
_FIRST_TURN, _LAST_TURN = 4, 12


class Border(NamedTuple):
    """Where growth begins along the orbit with tails alike."""

    curvature: float
    twist: float
    omega_bar: float  # NaN: nowhere in the range
    kind: str
    below: float  # natural logarithm of the change of the distance in time steps, per turn; NaN: not stepped
    above: float

    @property
    def confirmed(self) -> int:
        """Count the points at which time steps agree."""
        return int(self.below < 0) + int(self.above > 0)


def growth_grid(robot: Robot, twist: float) -> Floats:
    """Compute the growth at all curvatures and speeds, (C, S); NaN where there is no orbit."""
    rows = []
    for curvature in _CURVATURES:
        columns = {name: np.full(len(_SPEEDS), value) for name, value in robot.group_values().items()}
        columns |= {
            "omega_bar": _SPEEDS,
            "natural_curvature": np.full(len(_SPEEDS), curvature),
            "natural_twist": np.full(len(_SPEEDS), twist),
        }
        groups = Groups.from_columns(columns)
        orbits = solve_orbits(numbers(groups), groups.N, perturbed=Perturbed.ALL)
        rows.append(np.where(orbits.ended == SOLVED, orbits.growth, np.nan))
    return np.array(rows)


def border_of(robot: Robot, curvature: float, twist: float) -> Border:
    """Follow the orbit with tails alike from a slow motor to where its perturbations begin to grow."""
    effects = {"natural_curvature": curvature, "natural_twist": twist}
    swept = SweptInput(replace(robot, effects=effects), "omega_bar", *_FAST_RANGE)
    family = TailsAlike(swept.body_at, robot.tails)
    start = family.start(0.0)
    here = None if start is None else first_point(family, start, 1.0)
    if here is None:
        return Border(curvature, twist, np.nan, "no orbit", np.nan, np.nan)

    def grows(point: Point) -> float:
        x, u = family.unpack(point.y)
        return leading_exponent(swept.body_at(point.s), robot.tails, x, u).growth

    before, trail = grows(here), [here]
    for point in follow(family, here, 150):
        now = grows(point)
        if before < 0 < now:
            crossing = locate(family, here, point, grows)
            if crossing is not None:
                x, u = family.unpack(crossing.y)
                kind = leading_exponent(swept.body_at(crossing.s), robot.tails, x, u).kind
                border = swept.value(crossing.s)
                sides = [_stepped(swept, family, [*trail, point], border * (1 + way)) for way in (-_AWAY, _AWAY)]
                return Border(curvature, twist, border, kind, *sides)
        here, before = point, now
        trail.append(point)
    return Border(curvature, twist, np.nan, "none", np.nan, np.nan)


def _stepped(swept: SweptInput, family: TailsAlike, trail: list[Point], omega_bar: float) -> float:
    """Step the orbit at ω̄, found from the nearest point of the trail, and a perturbed one; growth per turn."""
    s = (omega_bar - swept.low) / (swept.high - swept.low)
    nearest = min(trail, key=lambda point: abs(point.s - s))
    point = first_point(family, np.append(nearest.y[:-1], s), 1.0)
    if point is None:
        return np.nan
    x, u = family.unpack(point.y)
    means, body = family.means(point.y), swept.body_at(s)
    time = 2 * np.pi / abs(means[0])
    turns = Revolutions(swept.body_at, family.tails, EDGES, int(STEPS * abs(body.omega / means[0])))
    state = state_from_orbit(body, x, u)
    moved = perturbed(state, _SIZE, 0)
    distances = []
    for _ in range(_LAST_TURN):
        first, second = turns.turn(state, s, time), turns.turn(moved, s, time)
        if first is None or second is None:
            return np.nan
        state, moved = first.state, second.state
        distances.append(np.abs(state.x - moved.x).max())
    return float(np.log(distances[-1] / distances[_FIRST_TURN - 1]) / (_LAST_TURN - _FIRST_TURN))


def main(curvatures: str = "5") -> None:
    with one_thread(), np.errstate(all="ignore"):
        print("\nthe paper's robots: largest growth in a motor revolution, ω̄ = 2 to 300, curvature −1 to 1")
        for name, robot in PRESETS.items():
            for twist in _TWISTS:
                grid = growth_grid(robot, twist)
                if name == "paper-measured" and twist == 0:
                    shown = grid
                print(
                    f"  {name:15} twist {twist:g}: {np.isfinite(grid).sum()} of {grid.size} with an orbit, "
                    f"{(grid > 0).sum()} unstable, largest {np.nanmax(grid):.3f}",
                    flush=True,
                )
        fast = robot_of(robots(4096), _ROW)
        print(f"\n{fast.name}: where growth begins, and time steps {100 * _AWAY:.0f} % below and above (per turn)")
        borders = []
        for twist in _FAST_TWISTS:
            for curvature in np.linspace(-0.25, 0.25, int(curvatures)):
                border = border_of(fast, float(curvature), twist)
                borders.append(border)
                print(
                    f"  curvature {curvature:+.2f}, twist {twist:g}: ω̄ = {border.omega_bar:.1f} ({border.kind}), "
                    f"time steps {border.below:+.2f} and {border.above:+.2f}",
                    flush=True,
                )
    stepped = sum(np.isfinite([b.below, b.above]).sum() for b in borders)
    print(f"  time steps agree at {sum(b.confirmed for b in borders)} of {stepped} points")
    save_picture(draw(shown, borders), "docs/growth-map.png")


def draw(grid: Floats, borders: list[Border]) -> Figure:
    """Draw the growth of the paper's measured robot, and the borders of the robot that yaws fast."""
    figure = Figure(figsize=(9.0, 3.8), layout="constrained")
    left, right = figure.subplots(1, 2)
    levels = [-20, -10, -5, -2, -1, -0.5, -0.2, -0.1, 0]
    filled = left.contourf(_SPEEDS, _CURVATURES, grid, levels=levels, cmap="viridis", extend="both")
    left.set_xscale("log")
    left.set_title("paper-measured, no twist: growth", fontsize=9)
    figure.colorbar(filled, ax=left)
    for twist, mark in zip(_FAST_TWISTS, ("o-", "s--"), strict=True):
        some = [b for b in borders if b.twist == twist and np.isfinite(b.omega_bar)]
        right.plot(
            [b.omega_bar for b in some], [b.curvature for b in some], mark, label=f"twist {twist:g}: border"
        )
        for border in some:
            for value, side in ((border.below, -_AWAY), (border.above, _AWAY)):
                if np.isfinite(value):
                    right.plot(
                        border.omega_bar * (1 + side),
                        border.curvature,
                        "k_" if value < 0 else "k+",
                        ms=7,
                        alpha=0.7,
                    )
    right.set_title(f"row {_ROW}: unstable right of the border", fontsize=9)
    right.legend(fontsize=8, frameon=False)
    for axes in (left, right):
        axes.set_xlabel("ω̄")
        axes.set_ylabel("natural curvature [1/l]")
    return figure


if __name__ == "__main__":
    main()
