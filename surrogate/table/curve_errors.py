"""The error of the learned response at one robot: local sizes, and how the error varies over the dwells.

The errors of held-out robots are projected on the principal components of the curves
(`surrogate.table.response_table`): what is outside them is the noise of the simulator's time steps, and does not
count. Over the speeds and the local size of each axis, they have a covariance over axis, dwell and dwell before.
Its principal components are the modes. The sizes are learned as widths of intervals (`surrogate.table.intervals`):
of robots that the table knows less well, errors are larger. An error of more than _OUTLIER sizes counts as this
many.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from sim.arrays import Floats
from sim.model.response import LAGS
from surrogate.table.intervals import Intervals
from surrogate.table.response_table import Basis

CURVE_ERRORS = "curve_errors"  # the entry of a model file; files of earlier versions lack it
KINDS = ("lag", "memory")
NORMAL_90 = 1.6449  # half of an interval that holds 90 % of a normal distribution, in standard deviations
SIZES = LAGS  # the names of the sizes among the widths
_OUTLIER = 2.5
_KEPT = 0.99  # share of the variance


@dataclass(frozen=True)
class CurveErrors:
    """Local sizes and the covariance of the errors of lag and memory."""

    widths: Intervals  # of the sizes
    curves: Floats  # (P, K + 1, D, 3): modes after dwells BEFORE and after a long one, for sizes 1
    simulator: float  # relative error of the simulator itself: the median over the robots

    def modes(self, features: Floats, speeds: Floats) -> Floats:
        """Return modes of the lag of one robot, (P, K + 1, D, 3), after dwells BEFORE and after a long one.

        Args:
            features: (1, F), see `surrogate.table.lookup`.
            speeds: (1, 3), see `surrogate.table.response_table`.
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
        widths = Intervals.learned(features[half], _named(rms[half]), features[~half], _named(rms[~half]))
        local = np.maximum(_sizes(widths, features), rms / _OUTLIER)
        scaled = (curves / local[:, None, None]).reshape(len(rms), -1) / np.sqrt(len(rms))
        _, values, vectors = np.linalg.svd(scaled, full_matrices=False)
        kept = int(np.searchsorted(np.cumsum(values**2) / np.sum(values**2), _KEPT)) + 1
        modes = (values[:kept, None] * vectors[:kept]).reshape(kept, *curves.shape[1:])
        return CurveErrors(widths, modes, float(np.median(simulator)))


def _within(errors: Floats, vectors: Floats) -> Floats:
    """Project errors (M, ...) on the principal components (C, D) of the curves."""
    flat = errors.reshape(len(errors), -1)
    components = np.linalg.lstsq(vectors.T, flat.T, rcond=None)[0]
    return np.asarray((components.T @ vectors).reshape(errors.shape))


def _named(sizes: Floats) -> dict[str, Floats]:
    return dict(zip(SIZES, sizes.T, strict=True))


def _sizes(widths: Intervals, features: Floats) -> Floats:
    """Return one standard deviation of the errors of each axis, (M, 3)."""
    return widths.half_widths(SIZES, features).T / NORMAL_90
