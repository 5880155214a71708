"""Obstacles as residuals of least squares: how far the discs of the body are inside a margin."""

from __future__ import annotations

import numpy as np

from planner.paths.obstacles import Footprint, FreeSpace
from sim.arrays import Floats

_DIFFERENCE = 1e-4  # l, for derivatives of distances


class Hindered:
    """Residuals of poses where the body comes nearer than a margin to what it must keep clear of.

    Args:
        body: with the pivot as origin.
        space: walls and regions.
        margin: around the body.
        headings: at the first and at the last pose, which stay.
    """

    def __init__(self, body: Footprint, space: FreeSpace, margin: float, headings: Floats):
        self._body, self._space, self._headings = body, space, headings
        self._least = margin + body.radius

    def __call__(self, poses: Floats) -> tuple[Floats, Floats]:
        """Compute residuals (m, discs + 1) and derivatives (m, discs + 1, 3)."""
        centres = self._body.centres(poses)
        count, discs = centres.shape[:2]
        residual, slopes = np.zeros((count, discs + 1)), np.zeros((count, discs + 1, 3))
        room = self._space.distance(centres.reshape(-1, 2)).reshape(count, discs)
        rows, columns = np.nonzero(room < self._least)
        points = centres[rows, columns]
        gradient = np.stack(
            [
                (self._space.distance(points + step) - self._space.distance(points - step)) / (2 * _DIFFERENCE)
                for step in _DIFFERENCE * np.eye(2)
            ],
            1,
        )
        sideways = np.stack([-np.sin(poses[rows, 2]), np.cos(poses[rows, 2])], 1)
        residual[rows, columns] = self._least - room[rows, columns]
        slopes[rows, columns, :2] = -gradient
        slopes[rows, columns, 2] = -(gradient * sideways).sum(1) * self._body.places[columns]
        for end, heading in zip((0, -1), self._headings.tolist(), strict=True):
            residual[end, discs], slopes[end, discs, 2] = poses[end, 2] - heading, 1.0
        return residual, slopes
