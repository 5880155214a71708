"""The error of a table at one robot, as independent modes of one standard deviation each.

A steady error is a number. An error of the response to a flip is a curve: it depends on the dwell T and on the
dwell before S, so it does not cancel between the unequal dwells of a turn, and adds up over many flips. Where only
the size of this error is known, it is taken as a Gaussian process with the squared exponential kernel of length λ
in the logarithms of the dwells:

    k = exp(−(ln T/T')²/2λ² − (ln S/S')²/2λ²)

Its modes are the principal components of k on the knots of the curves. Source: Rasmussen and Williams, Gaussian
Processes for Machine Learning (2006), ch. 4.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache

import numpy as np

from sim.arrays import Floats
from sim.model.response import BEFORE, DWELLS, FORGOTTEN, LAGS
from surrogate.interface import ErrorModes

LENGTH = 1.0  # of the kernel, in the logarithm of a dwell
STEADY = ("v_z", "v_x", "omega_yr_bar")
_KEPT = 0.999  # share of the variance


def error_modes(
    errors: Mapping[str, Mapping[str, float]], motion: Mapping[str, float], known: Floats | None = None
) -> ErrorModes:
    """Return the modes of errors of which only the sizes are known.

    Args:
        errors: relative errors by output, each with its "rms", see `surrogate.table.errors`. "rest", where given,
            is the part of it that is in no known mode.
        motion: the robot's steady motion, by output.
        known: modes (Q, K + 1, D, 3) of the lags that are known besides, after dwells BEFORE and after a long one.
    """
    speed, yaw = float(np.hypot(motion["v_x"], motion["v_z"])), abs(motion["omega_yr_bar"])
    scale = {"v_x": abs(motion["v_x"]), "omega_yr_bar": yaw, "lag_psi_rad": yaw}
    sizes = {
        name: errors[name].get("rest", errors[name]["rms"]) * scale.get(name, speed) for name in (*STEADY, *LAGS)
    }
    lag, functions = [sizes[name] for name in LAGS], _process()
    count = len(functions)
    curves = np.zeros((3 * count, *functions.shape[1:], 3))
    for axis in range(3):
        curves[axis * count : (axis + 1) * count, ..., axis] = lag[axis] * functions
    if known is not None:
        curves = np.concatenate([known, curves])
    return joined(np.diag([sizes[name] for name in STEADY]), curves)


def joined(twist: Floats, curves: Floats) -> ErrorModes:
    """Join modes of the steady motion (P, 3) and modes of lags (Q, K + 1, D, 3), after BEFORE and FORGOTTEN."""
    first, second = len(twist), len(curves)
    lag, memory = curves[:, -1], curves[:, :-1] - curves[:, -1:]
    return ErrorModes(
        np.concatenate([twist, np.zeros((second, 3))]),
        np.concatenate([np.zeros((first, *lag.shape[1:])), lag]),
        np.concatenate([np.zeros((first, *memory.shape[1:])), memory]),
    )


@cache
def _process() -> Floats:
    """Return the principal components of the process (P, K + 1, D), each times its standard deviation."""
    roots = []
    for knots in (np.append(BEFORE, FORGOTTEN), DWELLS):
        apart = np.log(knots[:, None] / knots) / LENGTH
        values, vectors = np.linalg.eigh(np.exp(-(apart**2) / 2))
        roots.append(vectors * np.sqrt(np.maximum(values, 0.0)))
    functions = np.einsum("ka,db->abkd", *roots).reshape(-1, len(BEFORE) + 1, len(DWELLS))
    size = (functions**2).sum((1, 2))
    order = np.argsort(-size)
    kept = int(np.searchsorted(np.cumsum(size[order]), _KEPT * size.sum())) + 1
    return np.ascontiguousarray(functions[order[:kept]])
