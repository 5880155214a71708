"""The error of the learned response at one robot: a local size, and how the error varies over the dwells.

The errors of held-out robots are written in the principal components of the curves (`surrogate.table.response_table`),
over speeds and divided by a local size. The covariance of these components says how the error at one pair of dwells
goes with that at another one. What lies outside the components is the noise of the simulator's time steps, and does
not count. The size is learned as the width of an interval (`surrogate.table.intervals`): the robots that the table
knows less well have larger errors. A robot whose error is more than _OUTLIER sizes counts as if it had this many.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from sim.arrays import Floats
from sim.model.response import BEFORE, DWELLS
from surrogate.table.intervals import Intervals
from surrogate.table.response_table import SHAPES, Basis

import torch


def _t(x):
    return torch.as_tensor(np.asarray(x))


KINDS = ("lag", "memory")
NORMAL_90 = 1.6449  # half of an interval that holds 90 % of a normal distribution, in standard deviations
_SIZE = "curves"  # the name of the size among the widths
_OUTLIER = 2.5
_KEPT = 0.99  # share of the variance


@dataclass(frozen=True)
class CurveErrors:
    """Local size and covariance of the error of lag and memory."""

    widths: Intervals  # of the size
    factor: Floats  # (P, C): modes of the components of lag and memory, for size 1

    def modes(self, features: Floats, speeds: Floats, bases: Mapping[str, Basis]) -> Floats:
        """Return modes of the lag of one robot, (P, K + 1, D, 3), after dwells BEFORE and after a long one.

        Args:
            features: (1, F), see `surrogate.table.lookup`.
            speeds: (1, 3), see `surrogate.table.response_table`.
            bases: of the response.
        """
        size = float(self.widths.half_widths(_SIZE, _t(features), _t(np.ones(1)))[0]) / NORMAL_90
        parts = np.split(size * self.factor, [len(bases["lag"].vectors)], axis=1)
        lag, memory = (
            (part @ np.asarray(bases[kind].vectors)).reshape(len(part), *SHAPES[kind]) * speeds[0]
            for kind, part in zip(KINDS, parts, strict=True)
        )
        return np.concatenate([lag[:, None] + memory, lag[:, None]], 1)

    @staticmethod
    def learned(features: Floats, errors: Mapping[str, Floats], bases: Mapping[str, Basis]) -> CurveErrors:
        """Learn from held-out robots.

        Args:
            features: (M, F).
            errors: of lag (M, D, 3) and memory (M, K, D, 3), over the speeds.
            bases: of the response.
        """
        components = []
        for kind in KINDS:
            vectors = np.asarray(bases[kind].vectors)
            flat = errors[kind].reshape(len(features), -1)
            components.append(np.linalg.lstsq(vectors.T, flat.T, rcond=None)[0].T)
        within = [part @ np.asarray(bases[kind].vectors) for kind, part in zip(KINDS, components, strict=True)]
        lag, memory = (part.reshape(-1, *SHAPES[kind]) for kind, part in zip(KINDS, within, strict=True))
        size = np.sqrt(((lag[:, None] + memory) ** 2).mean((1, 2, 3)))
        half = np.arange(len(size)) % 2 == 0
        widths = Intervals.learned(
            _t(features[half]), {_SIZE: _t(size[half])}, _t(features[~half]), {_SIZE: _t(size[~half])}
        )
        local = widths.half_widths(_SIZE, _t(features), _t(np.ones(len(features)))).numpy() / NORMAL_90
        scaled = np.concatenate(components, 1) / np.maximum(local, size / _OUTLIER)[:, None]
        _, values, vectors = np.linalg.svd(scaled / np.sqrt(len(scaled)), full_matrices=False)
        share = np.cumsum(values**2) / np.sum(values**2)
        kept = int(np.searchsorted(share, _KEPT)) + 1
        return CurveErrors(widths, values[:kept, None] * vectors[:kept])
