"""Growth of small perturbations over motor speed and natural curvature and twist of the tails, and its borders.

1. The paper's robots over a grid of ω̄, natural curvature and natural twist; with contact, the measured robot.
2. A robot that yaws fast (row 3620 of `robustness`): where stability is lost and regained along the orbit with
   tails alike that comes from a slow motor, and time steps on both sides of each border.
3. Two robots of the sweep whose tails push against each other (`tail_contact` = 1): maps over ω̄ and natural
   curvature, their borders, and time steps with contact on both sides.

How borders and time steps are made: `benchmarks.simulator.growth_borders`.

Usage: python -m benchmarks growth_map

Takes 12 minutes.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter

from benchmarks.pictures import save_picture
from benchmarks.simulator.branches import robot_of
from benchmarks.simulator.growth_borders import (
    Border,
    border_in_contact,
    borders_of_branch,
    orbit_in_contact,
)
from benchmarks.simulator.robustness import robots
from benchmarks.simulator.speed import sweep
from sim.arrays import Floats
from sim.model.groups import Groups
from sim.model.presets import PRESETS
from sim.model.robot import Robot
from sim.motion.batches import one_thread
from sim.motion.orbits import Perturbed, solve_orbits
from sim.solve.assembly import numbers
from sim.solve.refinement import SOLVED

_SPEEDS = np.geomspace(2.0, 300.0, 16)
_CURVATURES = np.linspace(-1.0, 1.0, 9)
_TWISTS = (0.0, 3.0, 6.0)
_ROW = 3620
_FAST_RANGE = (30.0, 115.0)  # ω̄ of the robot that yaws fast
_FAST = {0.0: (-0.2, -0.1, 0.0, 0.1), 3.0: (-0.1, 0.05)}  # curvatures by twist
_AWAY, _AWAY_IN_CONTACT = 0.05, 0.1  # relative distance of both sides from a border
_PRESSED_ROWS = (0, 127)  # of the first 128 rows of the sweep: those that contact makes unstable
_PRESSED_SPEEDS = np.geomspace(20.0, 120.0, 8)
_PRESSED_CURVATURES = np.linspace(-0.4, 0.4, 7)


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


def grid_in_contact(robot: Robot) -> Floats:
    """Compute the growth with contact at _PRESSED_CURVATURES and _PRESSED_SPEEDS, (C, S); NaN where unknown."""
    return np.array(
        [
            [orbit_in_contact(robot, float(speed), float(curvature)).leading.growth for speed in _PRESSED_SPEEDS]
            for curvature in _PRESSED_CURVATURES
        ]
    )


def print_grid(title: str, grid: Floats) -> None:
    """Print how many robots of a grid are unstable."""
    print(
        f"  {title}: {np.isfinite(grid).sum()} of {grid.size} with an orbit, {(grid > 0).sum()} unstable, "
        f"largest growth {np.nanmax(grid):.3f}",
        flush=True,
    )


def print_borders(borders: list[Border]) -> None:
    """Print borders with both sides."""
    for border in borders:
        print(f"  {border}", flush=True)


def print_count(borders: list[Border]) -> None:
    """Count the points at which time steps agree."""
    sides = [side for border in borders for side in border.sides]
    print(f"  time steps agree at {sum(side.agrees for side in sides)} of {len(sides)} points", flush=True)


def main() -> None:
    with one_thread(), np.errstate(all="ignore"):
        print("\nthe paper's robots: growth in a motor revolution, ω̄ = 2 to 300, curvature −1 to 1")
        for name, robot in PRESETS.items():
            for twist in _TWISTS:
                grid = growth_grid(robot, twist)
                if name == "paper-measured" and twist == 0:
                    shown = grid
                print_grid(f"{name}, twist {twist:g}", grid)
        print("\nwith contact, ω̄ = 20 to 120, curvature −0.4 to 0.4")
        print_grid("paper-measured", grid_in_contact(PRESETS["paper-measured"]))

        fast = robot_of(robots(4096), _ROW)
        print(f"\n{fast.name}: borders along the orbit from a slow motor, and growth on both sides")
        borders: list[Border] = []
        for twist, curvatures in _FAST.items():
            for curvature in curvatures:
                effects = {"natural_curvature": curvature, "natural_twist": twist}
                some = borders_of_branch(replace(fast, effects=effects), _FAST_RANGE, _AWAY)
                print_borders(some)
                borders += some
        print_count(borders)

        figure = Figure(figsize=(9.0, 7.4), layout="constrained")
        axes = figure.subplots(2, 2).ravel()
        draw_grid(axes[0], _SPEEDS, _CURVATURES, shown)
        axes[0].set_title("paper-measured: growth", fontsize=9)
        draw_borders(axes[1], borders)
        for place, row in zip(axes[2:], _PRESSED_ROWS, strict=True):
            pressed = robot_of(sweep(128), row)
            grid = grid_in_contact(pressed)
            print()
            print_grid(f"row {row} of the sweep, with contact", grid)
            found: list[Border] = []
            for curvature, growths in zip(_PRESSED_CURVATURES[::3], grid[::3], strict=True):
                some = border_in_contact(pressed, float(curvature), _PRESSED_SPEEDS, growths, _AWAY_IN_CONTACT)
                print_borders(some)
                found += some
            print_count(found)
            draw_grid(place, _PRESSED_SPEEDS, _PRESSED_CURVATURES, grid)
            mark_sides(place, found)
            place.set_title(f"row {row} of the sweep, N = {pressed.tails}, with contact: growth", fontsize=9)
    save_picture(figure, "docs/growth-map.png")


def draw_grid(axes: Axes, speeds: Floats, curvatures: Floats, grid: Floats) -> None:
    """Draw the growth over speed and curvature, with a line where it is zero."""
    levels = [-20, -10, -5, -2, -1, -0.5, -0.2, -0.1, 0, 0.1, 0.2, 0.5, 1, 2]
    low = max(int(np.searchsorted(levels, np.nanmin(grid))) - 1, 0)
    high = max(int(np.searchsorted(levels, np.nanmax(grid))) + 1, levels.index(0) + 1)
    filled = axes.contourf(speeds, curvatures, grid, levels=levels[low:high], cmap="viridis", extend="both")
    if (grid > 0).any():
        axes.contour(speeds, curvatures, grid, levels=[0.0], colors="w", linewidths=1.5)
    axes.set_xscale("log")
    axes.xaxis.set_minor_formatter(NullFormatter())
    marks = [mark for mark in (2, 5, 10, 20, 50, 100, 200) if speeds[0] <= mark <= speeds[-1]]
    axes.set_xticks(marks, [str(mark) for mark in marks])
    _label(axes)
    axes.figure.colorbar(filled, ax=axes)


def draw_borders(axes: Axes, borders: list[Border]) -> None:
    """Draw where stability is lost and regained, and what time steps do on both sides."""
    for lost, colour in ((True, "#c44e4e"), (False, "#2a7fba")):
        for twist, mark, line in zip(_FAST, "os", ("-", "--"), strict=True):
            some = [b for b in borders if b.lost == lost and b.twist == twist]
            axes.plot(
                [b.omega_bar for b in some], [b.curvature for b in some], mark + line, color=colour,
                mfc="none" if twist else colour, label=f"{'lost' if lost else 'regained'}, twist {twist:g}",
            )  # fmt: skip
    mark_sides(axes, borders)
    axes.set_title(f"row {_ROW} of robustness, N = 7: borders of stability", fontsize=9)
    axes.legend(fontsize=8, frameon=False, loc="lower right")
    _label(axes)


def mark_sides(axes: Axes, borders: list[Border]) -> None:
    """Mark the points from which time steps were made: + where perturbations grow, − where they decay."""
    for border in borders:
        for side in border.sides:
            if np.isfinite(side.stepped):
                mark = "k+" if side.stepped > 0 else "k_"
                axes.plot(side.omega_bar, border.curvature, mark, ms=7, alpha=0.7, clip_on=False)


def _label(axes: Axes) -> None:
    axes.set_xlabel("ω̄")
    axes.set_ylabel("natural curvature [1/l]")


if __name__ == "__main__":
    main()
