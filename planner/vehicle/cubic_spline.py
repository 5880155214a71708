"""Cubic splines through a few knots: two continuous derivatives, as `scipy.interpolate.CubicSpline` makes them.

On a segment of width h with the slopes m at its ends, at the share t of it:

    y = (1 + 2t)(1 − t)² y_0 + t²(3 − 2t) y_1 + h t (1 − t)² m_0 − h t² (1 − t) m_1

The second derivative is continuous at the inner knots. At an end the third derivative is continuous at the next
knot ("not a knot"), or the slope vanishes. scipy's are slow to import, and a plan needs nothing else of it.
"""

from __future__ import annotations

import numpy as np

from sim.arrays import Floats


def spline_at(knots: Floats, values: Floats, places: Floats, *, flat_end: bool = False) -> Floats:
    """Evaluate the spline through values (D, …) at knots (D,), D ≥ 4, at places (T,), (T, …).

    Args:
        knots: ascending.
        flat_end: whether the slope at the last knot is zero, rather than the third derivative continuous.
    """
    slopes = _slopes(knots, values, flat_end=flat_end)
    segment = np.clip(np.searchsorted(knots, places, side="right") - 1, 0, len(knots) - 2)
    width = np.diff(knots)[segment]
    axes = (slice(None), *[None] * (values.ndim - 1))
    t, h = ((places - knots[segment]) / width)[axes], width[axes]
    first, second = values[segment], values[segment + 1]
    ends = (1 + 2 * t) * (1 - t) ** 2 * first + t**2 * (3 - 2 * t) * second
    bent = h * t * (1 - t) * ((1 - t) * slopes[segment] - t * slopes[segment + 1])
    return np.asarray(ends + bent)


def _slopes(knots: Floats, values: Floats, *, flat_end: bool) -> Floats:
    """Solve for the slopes at the knots, (D, …)."""
    h = np.diff(knots)
    flat = values.reshape(len(knots), -1)
    secant = np.diff(flat, axis=0) / h[:, None]
    matrix, right = np.zeros((len(knots), len(knots))), np.zeros_like(flat)
    inner = np.arange(1, len(knots) - 1)
    matrix[inner, inner - 1], matrix[inner, inner], matrix[inner, inner + 1] = h[1:], 2 * (h[:-1] + h[1:]), h[:-1]
    right[1:-1] = 3 * (h[1:, None] * secant[:-1] + h[:-1, None] * secant[1:])
    matrix[0, :2], right[0] = _not_a_knot(h[0], h[1], secant[0], secant[1])
    if flat_end:
        matrix[-1, -1] = 1.0
    else:
        matrix[-1, :-3:-1], right[-1] = _not_a_knot(h[-1], h[-2], secant[-1], secant[-2])
    return np.asarray(np.linalg.solve(matrix, right), dtype=float).reshape(values.shape)


def _not_a_knot(
    h: float, next_h: float, secant: Floats, next_secant: Floats
) -> tuple[tuple[float, float], Floats]:
    """Return the two coefficients and the right side of the equation of an end, from the end inwards."""
    total = h + next_h
    return (next_h, total), ((h + 2 * total) * next_h * secant + h**2 * next_secant) / total
