"""Outliers: runs that are far from their own repeats, for example because of a misplaced decimal point.

If, in one output, the runs of a condition are more than `FAR` robust standard deviations apart, the run that is
farthest from the model as given is excluded. A missing effect does not cause this: it changes all repeats alike.
"""

from __future__ import annotations

import numpy as np

from calibration.statistics.forward_model import Runs
from sim.arrays import Flags, Floats

FAR = 12.0
_MAD = 1.4826  # median absolute deviation to standard deviation


def find_outliers(data: Runs, prediction: Floats) -> tuple[Flags, tuple[str, ...]]:
    """Find the runs (n,) to exclude, and say why; `prediction` (n, k) of the model as given."""
    bad = np.zeros(len(data), dtype=bool)
    residual = data.y - prediction
    residual -= np.median(residual, 0)
    groups = [np.flatnonzero(data.condition == c) for c in np.unique(data.condition)]
    groups = [g for g in groups if len(g) > 1]
    if not groups:
        return bad, ()
    centred = np.concatenate([data.y[g] - np.median(data.y[g], 0) for g in groups])
    # The deviation of two repeats from their median is half their difference.
    pairs = np.sqrt(np.mean([(len(g) - 1) / len(g) for g in groups]))
    scatter = _MAD * np.median(np.abs(centred), 0) / pairs
    reasons = []
    for group in groups:
        while len(group) > 1:
            spread = np.ptp(data.y[group], axis=0) / np.maximum(scatter, 1e-300)
            worst = int(np.argmax(spread))
            if spread[worst] < FAR or scatter[worst] == 0:
                break
            out = group[np.argmax(np.abs(residual[group, worst]))]
            bad[out] = True
            far = f"{spread[worst]:.0f} standard deviations from its repeat"
            reasons.append(f"row {data.rows[out]}: {data.outputs[worst]} is {far}")
            group = group[group != out]
    return bad, tuple(reasons)
