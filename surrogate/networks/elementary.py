"""Elementary functions without branches or calls, so that loops over robots become vector instructions.

The C library takes one number at a time. These take as many as a vector of the processor holds. Their errors are a
few units of the last place, in `log_of` and `arcsinh_of` also an absolute 1e-16, in `exp_of` a relative 1e-16 |x|.
They hold for finite numbers, the logarithm for positive ones.
"""

from __future__ import annotations

import math

import numpy as np

from sim.compiling import compiled

_MAGIC = 6755399441055744.0  # 1.5 · 2^52: a small integer added to it stands in its lowest bits
_ROOT_BITS = 4604544271217802189  # of √½
_LOG2_E = 1.4426950408889634
_LN2 = 0.6931471805599453
_EIGHTH = 0.41421356237309503  # tan(π/8)


@compiled
def log_of(x: float) -> float:
    """Return the natural logarithm: the series of 2 artanh((m − 1)/(m + 1)) for the mantissa m around 1."""
    bits = np.float64(x).view(np.int64)
    power = (bits - _ROOT_BITS) >> 52
    mantissa = np.int64(bits - (power << 52)).view(np.float64)
    t = (mantissa - 1) / (mantissa + 1)
    q = t * t
    s = 1 / 21.0
    s = s * q + 1 / 19.0
    s = s * q + 1 / 17.0
    s = s * q + 1 / 15.0
    s = s * q + 1 / 13.0
    s = s * q + 1 / 11.0
    s = s * q + 1 / 9.0
    s = s * q + 1 / 7.0
    s = s * q + 1 / 5.0
    s = s * q + 1 / 3.0
    return float(power) * _LN2 + 2 * t * (s * q + 1)


@compiled
def exp_of(x: float) -> float:
    """Return e^x, with e^700 and e^−700 as bounds: a power of two times the Taylor series."""
    bounded = min(max(x, -700.0), 700.0)
    power = np.floor(bounded * _LOG2_E + 0.5)
    r = bounded - power * _LN2
    s = 1 / 6227020800.0
    s = s * r + 1 / 479001600.0
    s = s * r + 1 / 39916800.0
    s = s * r + 1 / 3628800.0
    s = s * r + 1 / 362880.0
    s = s * r + 1 / 40320.0
    s = s * r + 1 / 5040.0
    s = s * r + 1 / 720.0
    s = s * r + 1 / 120.0
    s = s * r + 1 / 24.0
    s = s * r + 1 / 6.0
    s = s * r + 0.5
    s = s * r + 1.0
    s = s * r + 1.0
    return s * np.int64((np.float64(power + _MAGIC).view(np.int64) + 1023) << 52).view(np.float64)


@compiled
def arcsinh_of(x: float) -> float:
    """Return the inverse hyperbolic sine."""
    size = abs(x)
    value = log_of(size + np.sqrt(size * size + 1))
    return -value if x < 0 else value


@compiled
def angle_of(y: float, x: float) -> float:
    """Return the angle of the point (x, y), as arctan2(y, x); zero for the origin."""
    along, across = abs(x), abs(y)
    large, small = max(along, across), min(along, across)
    ratio = small / (large if large > 0 else 1.0)
    beyond = ratio > _EIGHTH
    t = (ratio - 1) / (ratio + 1) if beyond else ratio
    q = t * t
    s = 1 / 41.0
    s = 1 / 39.0 - s * q
    s = 1 / 37.0 - s * q
    s = 1 / 35.0 - s * q
    s = 1 / 33.0 - s * q
    s = 1 / 31.0 - s * q
    s = 1 / 29.0 - s * q
    s = 1 / 27.0 - s * q
    s = 1 / 25.0 - s * q
    s = 1 / 23.0 - s * q
    s = 1 / 21.0 - s * q
    s = 1 / 19.0 - s * q
    s = 1 / 17.0 - s * q
    s = 1 / 15.0 - s * q
    s = 1 / 13.0 - s * q
    s = 1 / 11.0 - s * q
    s = 1 / 9.0 - s * q
    s = 1 / 7.0 - s * q
    s = 1 / 5.0 - s * q
    s = 1 / 3.0 - s * q
    angle = t * (1 - s * q) + (math.pi / 4 if beyond else 0.0)
    angle = math.pi / 2 - angle if across > along else angle
    angle = math.pi - angle if x < 0 else angle
    return -angle if y < 0 else angle
