"""The declared path: the drawn path made feasible for the robot.

A path that the pivot can follow with some margin is declared as it is. Otherwise the nearest feasible path is
declared (`planner.paths.nearest_feasible`), by root mean square or by the largest distance; or corners are rounded
by arcs (`planner.paths.fillets`); or the path is rejected. The distance between the declared and the drawn path is
reported in both directions: a missed corner is a point of the drawn path that is far from the declared one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import get_args

import numpy as np

from planner.paths.distance import two_sided
from planner.paths.path import Path2D
from planner.paths.tractrix import Reference, reference
from planner.paths.units import extent, in_lab, place_in_lab
from planner.planning.arrival import Swing
from planner.planning.feasible import TIGHTEST, Feasibility, feasible, place_of_largest, spacing
from planner.planning.kept_clear import Detour
from planner.planning.progress import Progress
from planner.planning.remedy import remedy
from planner.planning.request import Corner
from sim.io.errors import InputError

WARN = 0.1  # share of the extent; a declared path that is further off gets a warning
FAR = 0.3  # l; so does one that is further off than this


@dataclass(frozen=True)
class Declared:
    """The declared path with its tractrix, and its distances from the path as drawn [l]."""

    reference: Reference  # the path and the pivot that follows it
    curvature: float  # largest of the pivot's reference
    off_drawn: float = 0.0  # largest distance of a declared point from the drawn path
    missed: float = 0.0  # largest distance of a drawn point from the declared path
    warnings: tuple[str, ...] = ()  # in words
    swing: Swing | None = None  # that takes time
    detours: tuple[Detour, ...] = ()  # around obstacles, in the order of the path

    def moved(self, reference: Reference, drawn: Path2D, curvature: float | None = None) -> Declared:
        """Declare another reference in place of this one, with `curvature` or its own one."""
        off_drawn, missed = two_sided(reference.p, drawn.polyline())
        curvature = float(np.abs(reference.curvature).max()) if curvature is None else curvature
        return replace(self, reference=reference, curvature=curvature, off_drawn=off_drawn, missed=missed)

    def same(self, other: Declared) -> bool:
        """Tell whether the pivot has the same way."""
        return self is other or np.array_equal(self.reference.q, other.reference.q)


def declare(raw: Path2D, feasibility: Feasibility, progress: Progress | None = None) -> Declared:
    """Choose the path that the robot will follow.

    Raises:
        InputError: the path is too tight (the message names the place, the radii and a change that helps), or
            corner or time weight are not allowed.
    """
    if feasibility.corner not in get_args(Corner):
        raise InputError(f"corner {feasibility.corner!r}; allowed are {', '.join(get_args(Corner))}")
    if not (math.isfinite(feasibility.time_weight) and feasibility.time_weight >= 0):
        raise InputError(f"time weight {feasibility.time_weight:g}; give a number of l², 0 or more")
    if feasibility.time_weight and feasibility.corner not in ("nearest", "minimax"):
        raise InputError(f"a time weight needs corner = nearest or minimax, not {feasibility.corner}")
    accepted = feasible(raw, feasibility, progress)
    if accepted is None:
        raise InputError(_too_tight(raw, feasibility, progress))
    followed, off_drawn, missed = accepted
    warnings, robot = [], feasibility.robot
    distance = max(off_drawn, missed)
    if distance > WARN * max(extent(raw)):
        warnings.append(
            f"the shape is lost in part: the declared path is up to {in_lab(distance, robot)} from the drawn one, "
            f"which is {in_lab(max(extent(raw)), robot)} across; draw it larger"
        )
    elif distance > FAR:
        warnings.append(
            f"the declared path leaves the drawn one by up to {in_lab(distance, robot)}, where the robot cannot "
            "turn so tightly; draw wider turns"
        )
    return Declared(followed, float(np.abs(followed.curvature).max()), off_drawn, missed, tuple(warnings))


def _too_tight(raw: Path2D, feasibility: Feasibility, progress: Progress | None) -> str:
    """Say where a path is too tight, and what to change."""
    robot, vehicle = feasibility.robot, feasibility.vehicle
    drawn = reference(raw, feasibility.rod, spacing(raw), feasibility.drift)
    curvature = np.abs(drawn.curvature)
    worst = place_of_largest(curvature)
    x, y = drawn.p[worst]
    return (
        f"path too tight at {place_in_lab(x, y, robot)}: the pivot would turn with radius "
        f"{in_lab(1 / float(curvature[worst]), robot)}, the robot can with "
        f"{in_lab(vehicle.pivot_radius / TIGHTEST, robot)}; its circle has radius "
        f"{in_lab(vehicle.turn_radius, robot)}, and the nearest path that it can follow has lost the shape; "
        f"{remedy(raw, feasibility, progress)}"
    )
