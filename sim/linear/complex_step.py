"""Derivatives of formulas by the complex step, exact to rounding: nothing is subtracted.

    d/dt f(x + t d) at t = 0  =  Im f(x + i h d)/h,   h = 10⁻¹⁰⁰

So f must be an analytic function of arrays, in which `magnitude`, `sign`, `angle` and `length` take the place of
abs, np.sign, np.arctan2 and np.hypot; these drop the imaginary part or refuse it. Of real arrays they return the
same numbers. Source: Squire and Trapp, SIAM Rev. 40, 110 (1998).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from sim.arrays import Floats

_STEP = 1e-100


def derivative(function: Callable[[Floats], Floats], point: Floats, direction: Floats) -> Floats:
    """Return the derivative of a function of arrays at a point, along a direction."""
    return np.asarray(function(moved(point, direction)).imag / _STEP)


def moved(point: Floats, direction: Floats) -> Floats:
    """Return the point with its complex step along a direction."""
    return np.asarray(point + 1j * _STEP * direction)


def change(value: Floats) -> Floats:
    """Return the derivative that a value carries; zero of a real one."""
    return np.asarray(value.imag / _STEP)


def magnitude(x: Any) -> Any:
    """Return |x|."""
    return np.abs(x) if np.isrealobj(x) else x * np.sign(x.real)


def sign(x: Any) -> Any:
    """Return −1, 0 or 1."""
    return np.sign(x.real)


def length(x: Any, y: Any) -> Any:
    """Return √(x² + y²)."""
    return np.hypot(x, y) if np.isrealobj(x) and np.isrealobj(y) else np.sqrt(x * x + y * y)


def angle(y: Any, x: Any) -> Any:
    """Return the angle of the point (x, y) from the axis of x."""
    turn = np.arctan2(np.real(y), np.real(x))
    if np.isrealobj(x) and np.isrealobj(y):
        return turn
    return turn + 1j * (np.real(x) * np.imag(y) - np.real(y) * np.imag(x)) / (np.real(x) ** 2 + np.real(y) ** 2)
