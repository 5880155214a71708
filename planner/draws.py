"""Standard normal numbers from a counter, so that another program can draw the same ones.

Number n of seed s is Φ⁻¹(u) with u = (h + ½)/2³² and a 32-bit hash h of (s, n), which is a bijection in n. Φ⁻¹ is
algorithm AS 241 (PPND16) without its branch for u < e⁻²⁵, which does not occur. Sources: Wichura, Appl. Stat. 37,
477 (1988); constants of the hash: Wellons, hash-prospector (2018).
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from sim.arrays import Floats

_WEYL, _FIRST, _SECOND = 0x9E3779B9, 0x21F0AAAD, 0x735A2D97
_MIDDLE = (  # numerator and denominator, in powers of 0.180625 − (u − ½)²
    (3.387132872796366608, 133.14166789178437745, 1971.5909503065514427, 13731.693765509461125,
     45921.953931549871457, 67265.770927008700853, 33430.575583588128105, 2509.0809287301226727),
    (1.0, 42.313330701600911252, 687.1870074920579083, 5394.1960214247511077,
     21213.794301586595867, 39307.89580009271061, 28729.085735721942674, 5226.495278852545925),
)  # fmt: skip
_TAIL = (  # in powers of √(−ln min(u, 1 − u)) − 1.6
    (1.42343711074968357734, 4.6303378461565452959, 5.7694972214606914055, 3.64784832476320460504,
     1.27045825245236838258, 0.24178072517745061177, 0.0227238449892691845833, 7.7454501427834140764e-4),
    (1.0, 2.05319162663775882187, 1.6763848301838038494, 0.68976733498510000455,
     0.14810397642748007459, 0.0151986665636164571966, 5.475938084995344946e-4, 1.05075007164441684324e-9),
)  # fmt: skip


@lru_cache(maxsize=8)  # plans ask for the same numbers again and again
def normals(seed: int, first: int, count: int) -> Floats:
    """Draw the numbers `first` to `first + count − 1` of a seed, (count,)."""
    number = np.arange(first + 1, first + count + 1, dtype=np.uint32)
    hashed = _mixed(_mixed(number * np.uint32(_WEYL)) ^ _mixed(np.array([(seed + 1) % 2**32], dtype=np.uint32)))
    drawn = quantile((hashed + 0.5) / 2.0**32)
    drawn.flags.writeable = False
    return drawn


def _mixed(x: np.ndarray) -> np.ndarray:
    x = (x ^ (x >> np.uint32(16))) * np.uint32(_FIRST)
    x = (x ^ (x >> np.uint32(15))) * np.uint32(_SECOND)
    return x ^ (x >> np.uint32(15))


def quantile(u: Floats) -> Floats:
    """Compute Φ⁻¹(u), (count,), for e⁻²⁵ ≤ u ≤ 1 − e⁻²⁵."""
    q = u - 0.5
    tail = np.abs(q) > 0.425
    r = np.sqrt(-np.log(np.minimum(u, 1.0 - u)[tail])) - 1.6
    z = q * _polynomial(_MIDDLE[0], s := 0.180625 - q * q) / _polynomial(_MIDDLE[1], s)
    z[tail] = np.copysign(_polynomial(_TAIL[0], r) / _polynomial(_TAIL[1], r), q[tail])
    return np.asarray(z)


def _polynomial(powers: tuple[float, ...], r: Floats) -> Floats:
    total = np.full_like(r, powers[-1])
    for power in powers[-2::-1]:
        total = total * r + power
    return total
