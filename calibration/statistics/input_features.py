"""Features of the runs' inputs, for what the fitted model leaves: inputs, squares, products, cubes."""

from __future__ import annotations

import numpy as np

from calibration.statistics.forward_model import Runs
from sim.arrays import Flags, Floats

_CUBIC = 0.2  # share of a cube that lower powers must leave


def features(runs: Runs, used: Flags) -> tuple[tuple[str, ...], Floats]:
    """Names, and the inputs that differ, their squares, products and cubes for all runs, (n, f).

    Standardised on the runs in `used` (n,).
    """
    spread = runs.inputs[used].std(0)
    own = np.flatnonzero(spread > 1e-9).tolist()
    inputs = (runs.inputs[:, own] - runs.inputs[used][:, own].mean(0)) / spread[own]
    names, columns = [runs.input_names[i] for i in own], list(inputs.T)
    for i in range(len(own)):
        for j in range(i, len(own)):
            product = inputs[:, i] * inputs[:, j]
            if product[used].std() > 1e-9:
                names.append(f"{names[i]} × {names[j]}" if i != j else f"({names[i]})²")
                columns.append((product - product[used].mean()) / product[used].std())
    for i, column in zip(own, inputs.T, strict=True):
        lower = np.stack([np.ones_like(column), column, column**2], 1)
        weights = np.linalg.lstsq(lower[used], column[used] ** 3, rcond=None)[0]
        cube = column**3 - lower @ weights  # beyond lower powers; little for two or three levels
        if cube[used].std() > _CUBIC * (column[used] ** 3).std():
            names.append(f"({runs.input_names[i]})³")
            columns.append(cube / cube[used].std())
    return tuple(names), np.stack(columns, 1) if columns else np.empty((len(runs), 0))
