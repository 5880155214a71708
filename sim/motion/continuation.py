"""Pseudo-arclength continuation of solutions along an input.

The solutions of F(z, s) = 0 form a curve y = (z, s) with unit tangent τ. From a point on it, the next one at the
distance d solves

    F(y) = 0,   τ·(y − y₀) = d

by Newton's method from y₀ + d τ. The bordered matrix is regular at folds, where s turns back, so that the curve is
followed around them. The distance grows where few corrections are needed, and is halved where they do not converge
or the tangent turns too far.

z is scaled by whoever states the equations, so that |dy| measures all unknowns alike; s is 0 at one end of the
input's range and 1 at the other. Left out: switching to curves that cross at a branch point.
Source: Keller (1977), *Numerical solution of bifurcation and nonlinear eigenvalue problems*; Allgower and Georg,
*Introduction to Numerical Continuation Methods* (2003), ch. 3 and 6.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple, Protocol

import numpy as np

from sim.arrays import Floats

FIRST_DISTANCE, SHORTEST, LONGEST = 0.02, 1e-5, 0.06  # distances from point to point
_TURNED = 0.9  # least cosine between the tangents of neighbours
_EASY = 3  # corrections up to which the next distance is longer
_MOST_CORRECTIONS = 8
_FAR = 0.3  # a larger correction is not trusted
_CLOSE_TO_ROOT = 1e-6  # share of a step to which a zero is located


class Equations(Protocol):
    """Equations F(z, s) = 0 with unknowns y = (z, s), (K + 1,)."""

    tolerance: float  # on the last correction

    def correction(self, y: Floats, row: Floats, defect: float) -> Floats:
        """Solve F'(y) dy = −F(y), row·dy = −defect; NaN where there is no solution."""

    def tangent(self, y: Floats, row: Floats) -> Floats:
        """Solve F'(y) dy = 0, row·dy = 1, not normalised."""

    def moved(self, y: Floats, dy: Floats) -> Floats:
        """Return y changed by dy."""

    def is_valid(self, y: Floats) -> bool:
        """Tell whether a solution means anything."""


class Point(NamedTuple):
    """A solution, and the unit tangent of the curve there, (K + 1,) each."""

    y: Floats
    tangent: Floats

    @property
    def s(self) -> float:
        """Place in the range of the input, 0 to 1."""
        return float(self.y[-1])

    @property
    def turns(self) -> float:
        """How fast the input changes along the curve; 0 at a fold."""
        return float(self.tangent[-1])


def first_point(equations: Equations, y: Floats, direction: float) -> Point | None:
    """Solve at the input of y (K + 1,), and find the tangent along which the input changes in `direction`."""
    row = np.zeros(len(y))
    row[-1] = 1.0
    corrected = _corrected(equations, y, y, row, 0.0)
    return None if corrected is None else _with_tangent(equations, corrected[0], direction * row)


def step(equations: Equations, start: Point, distance: float) -> tuple[Point, int] | None:
    """Find the point at a distance along the tangent, and count the corrections; None if it is lost."""
    guess = equations.moved(start.y, distance * start.tangent)
    corrected = _corrected(equations, guess, start.y, start.tangent, distance)
    if corrected is None:
        return None
    point = _with_tangent(equations, corrected[0], start.tangent)
    return None if point is None else (point, corrected[1])


def follow(equations: Equations, start: Point, most: int) -> Iterator[Point]:
    """Follow the curve from `start`, which is not repeated, up to an end of the range; at most `most` points.

    The last point is at the end of the range, unless the curve is lost before.
    """
    here, distance, away = start, FIRST_DISTANCE, False
    for _ in range(most):
        found = step(equations, here, distance)
        while found is None or not here.tangent @ found[0].tangent > _TURNED:
            distance /= 2
            if distance < SHORTEST:
                return
            found = step(equations, here, distance)
        point, corrections = found
        if not 0 <= point.s <= 1:
            end = 0.0 if point.s < 0 else 1.0
            if here.s != end:
                last = locate(equations, here, point, _beyond(end))
                if last is not None:
                    yield last
            return
        if not equations.is_valid(point.y):
            return
        yield point
        gap = float(np.linalg.norm(point.y - start.y))
        away |= gap > 3 * LONGEST
        if away and gap < distance and point.tangent @ start.tangent > _TURNED:
            return  # a closed curve
        here = point
        if corrections <= _EASY:
            distance = min(1.5 * distance, LONGEST)


def _beyond(end: float) -> Callable[[Point], float]:
    return lambda point: point.s - end


def locate(equations: Equations, start: Point, end: Point, value: Callable[[Point], float]) -> Point | None:
    """Find where `value` is zero between two neighbours on the curve, by Brent's method; None if lost."""
    from scipy.optimize import brentq  # slow to import

    whole = float(start.tangent @ (end.y - start.y))
    points = {0.0: start, whole: end}  # by their distances along the tangent

    def value_at(distance: float) -> float:
        if distance not in points:
            found = step(equations, start, distance)
            if found is None:
                raise ValueError("the curve is lost")
            points[distance] = found[0]
        return value(points[distance])

    try:
        return points[brentq(value_at, 0.0, whole, xtol=_CLOSE_TO_ROOT * whole, maxiter=40, disp=False)]
    except ValueError:  # or one sign at both ends, or no number
        return None


def _corrected(
    equations: Equations, guess: Floats, start: Floats, row: Floats, distance: float
) -> tuple[Floats, int] | None:
    """Correct a guess in the plane row·(y − start) = distance; the solution and the number of corrections."""
    y, before = guess, np.inf
    for count in range(1, _MOST_CORRECTIONS + 1):
        dy = equations.correction(y, row, float(row @ (y - start)) - distance)
        size = float(np.linalg.norm(dy))
        if not size < min(_FAR, 2 * before):
            return None
        y = equations.moved(y, dy)
        if size < equations.tolerance:
            return y, count
        before = size
    return None


def _with_tangent(equations: Equations, y: Floats, row: Floats) -> Point | None:
    """Find the tangent at a solution, in the direction of `row`."""
    tangent = equations.tangent(y, row)
    size = float(np.linalg.norm(tangent))
    if not np.isfinite(size) or size == 0:
        return None
    return Point(y, tangent / size * np.sign(tangent @ row))
