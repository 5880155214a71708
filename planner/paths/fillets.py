"""Corners of a path, and arcs that round them."""

from __future__ import annotations

import math

import numpy as np

from planner.paths.path import Path2D, steps_of
from sim.arrays import Floats

CORNER = math.radians(15.0)  # larger kinks are corners; smaller ones belong to curves


def kinks(path: Path2D) -> Floats:
    """Compute the signed turning angle [rad] at every point; zero at the ends of an open path."""
    edges = np.diff(path.polyline(), axis=0)
    direction = np.arctan2(edges[:, 1], edges[:, 0])
    if path.closed:
        turn = direction - np.roll(direction, 1)
    else:
        turn = np.concatenate([[0.0], np.diff(direction), [0.0]])
    return np.asarray((turn + math.pi) % (2 * math.pi) - math.pi)


def largest_fillet(path: Path2D) -> float:
    """Compute the largest radius that fits all corners; infinite without corners."""
    angle = np.abs(kinks(path))
    reach = np.where(angle > CORNER, np.tan(angle / 2), 0.0)
    edges = np.linalg.norm(np.diff(path.polyline(), axis=0), axis=1)
    both = reach[: len(edges)] + np.roll(reach, -1)[: len(edges)]
    fits = edges[both > 0] / both[both > 0]
    return float(fits.min()) if len(fits) else math.inf


def fillet(path: Path2D, radius: float) -> Path2D:
    """Replace corners by arcs of `radius`, tangent to the edges; at most `largest_fillet`."""
    angle = kinks(path)
    corner = np.abs(angle) > CORNER
    if radius == 0 or not corner.any():
        return path
    points = path.points
    count = len(points)
    reach = np.where(corner, radius * np.tan(np.abs(angle) / 2), 0.0)
    edges = np.diff(path.polyline(), axis=0)
    lengths = np.linalg.norm(edges, axis=1)
    rounded: list[Floats] = []
    for i in range(count):
        if not corner[i]:
            rounded.append(points[i : i + 1])
            continue
        into = edges[i - 1] / lengths[i - 1]
        start = points[i] - reach[i] * into
        inward = math.copysign(1.0, angle[i]) * np.array([-into[1], into[0]])
        centre = start + radius * inward
        steps = np.linspace(0, angle[i], max(8, steps_of(abs(angle[i]), math.radians(2))))
        spoke = start - centre
        c, s = np.cos(steps), np.sin(steps)
        rounded.append(centre + np.stack([c * spoke[0] - s * spoke[1], s * spoke[0] + c * spoke[1]], 1))
    return Path2D(np.concatenate(rounded), path.closed)
