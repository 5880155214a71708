"""Derivatives of formulas by the complex step, exact to rounding: nothing is subtracted.

    d/dt f(x + t d) at t = 0  =  Im f(x + i h d)/h,   h = 10⁻¹⁰⁰

So f must be an analytic function of arrays, in which `magnitude` and `sign` take the place of abs and np.sign;
these drop the imaginary part. Of real arrays they return the same numbers. Source: Squire and Trapp, SIAM Rev. 40,
110 (1998).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from common.arrays import Floats

_STEP = 1e-100


def derivative(function: Callable[[Floats], Floats], point: Floats, direction: Floats) -> Floats:
    """Return the derivative of a function of arrays at a point, along a direction."""
    return np.asarray(function(point + 1j * _STEP * direction).imag / _STEP)


def magnitude(x: Any) -> Any:
    """Return |x|."""
    return np.abs(x) if np.isrealobj(x) else x * np.sign(x.real)


def sign(x: Any) -> Any:
    """Return −1, 0 or 1."""
    return np.sign(x.real)
