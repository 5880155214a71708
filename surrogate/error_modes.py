"""The error of a table at one robot, as independent modes of one standard deviation each.

A steady error is a number. An error of the response to a flip is a curve: it depends on the dwell T and on the
dwell before S, so it does not cancel between the unequal dwells of a turn, and adds up over many flips. Where only
the size of this error is known, it is taken as a Gaussian process with the squared exponential kernel of length λ
in the logarithms of the dwells:

    k = exp(−(ln T/T')²/2λ² − (ln S/S')²/2λ²)

Its modes are the principal components of k on the knots of the curves. Source: Rasmussen and Williams, Gaussian
Processes for Machine Learning (2006), ch. 4.

Where held-out robots have shown the error (`CurveErrors`), each axis has a local size instead, and a covariance
over axis, dwell and dwell before. The errors are projected on the principal components of the curves
(`surrogate.response`): what is outside them is the noise of the simulator's time steps, and does not count. The
modes are the principal components of the errors over the speeds and the local sizes. The sizes are learned as
widths of intervals (`surrogate.intervals`): of robots that the table knows less well, errors are larger. An error
of more than _OUTLIER sizes counts as this many.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache

import numpy as np

from common.arrays import Floats
from sim.model.response import BEFORE, DWELLS, FORGOTTEN, LAGS
from surrogate.interface import ErrorModes
from surrogate.intervals import Intervals
from surrogate.response import Basis

LENGTH = 1.0  # of the kernel, in the logarithm of a dwell
STEADY = ("v_z", "v_x", "omega_yr_bar")
_KEPT = 0.999  # share of the variance
CURVE_ERRORS = "curve_errors"  # the entry of a model file; files of earlier versions lack it
KINDS = ("lag", "memory")
NORMAL_90 = 1.6449  # half of an interval that holds 90 % of a normal distribution, in standard deviations
_OUTLIER = 5.0
_KEPT_OF_LEARNED = 0.985  # of the variance


def error_modes(
    errors: Mapping[str, Mapping[str, float]], motion: Mapping[str, float], known: Floats | None = None
) -> ErrorModes:
    """Return the modes of errors of which only the sizes are known.

    Args:
        errors: relative errors by output, each with its "rms", see `surrogate.held_out`. "rest", where given,
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


@dataclass(frozen=True)
class CurveErrors:
    """Local sizes and the covariance of the errors of lag and memory."""

    widths: Intervals  # of the sizes
    curves: Floats  # (P, K + 1, D, 3): modes after dwells BEFORE and after a long one, for sizes 1
    simulator: float  # relative error of the simulator itself: the median over the robots

    def modes(self, features: Floats, speeds: Floats) -> Floats:
        """Return modes of the lag of one robot, (P, K + 1, D, 3), after dwells BEFORE and after a long one.

        Args:
            features: (1, F), see `surrogate.motions.Motions`.
            speeds: (1, 3), see `surrogate.response`.
        """
        return self.curves * _sizes(self.widths, features)[0] * speeds[0]

    @staticmethod
    def learned(
        features: Floats, errors: Mapping[str, Floats], bases: Mapping[str, Basis], simulator: Floats
    ) -> CurveErrors:
        """Learn from held-out robots.

        Args:
            features: (M, F).
            errors: of lag (M, D, 3) and memory (M, K, D, 3), over the speeds.
            bases: of the response.
            simulator: (M,), relative errors of the simulator.
        """
        lag, memory = (_within(errors[kind], bases[kind].vectors) for kind in KINDS)
        curves = np.concatenate([lag[:, None] + memory, lag[:, None]], 1)
        rms = np.sqrt((curves**2).mean((1, 2)))
        half = np.arange(len(rms)) % 2 == 0
        widths = Intervals.learned(features[half], _named(rms[half]))
        widths = widths.calibrated(features[~half], _named(rms[~half]))
        local = np.maximum(_sizes(widths, features), rms / _OUTLIER)
        scaled = (curves / local[:, None, None]).reshape(len(rms), -1) / np.sqrt(len(rms))
        _, values, vectors = np.linalg.svd(scaled, full_matrices=False)
        kept = int(np.searchsorted(np.cumsum(values**2) / np.sum(values**2), _KEPT_OF_LEARNED)) + 1
        modes = (values[:kept, None] * vectors[:kept]).reshape(kept, *curves.shape[1:])
        return CurveErrors(widths, modes, float(np.median(simulator)))


def _within(errors: Floats, vectors: Floats) -> Floats:
    """Project errors (M, ...) on the principal components (C, D) of the curves."""
    flat = errors.reshape(len(errors), -1)
    components = np.linalg.lstsq(vectors.T, flat.T, rcond=None)[0]
    return np.asarray((components.T @ vectors).reshape(errors.shape))


def _named(sizes: Floats) -> dict[str, Floats]:
    return dict(zip(LAGS, sizes.T, strict=True))


def _sizes(widths: Intervals, features: Floats) -> Floats:
    """Return one standard deviation of the errors of each axis, (M, 3)."""
    return widths.half_widths(LAGS, features).T / NORMAL_90
