"""Fit scaling laws: exponents of outputs in inputs, and those of linear theory for comparison.

An exponent is ∂ln y/∂ln x with all other inputs held. It comes from a linear fit of ln y to the logarithms of all
inputs, over the rows in which x lies in one third of its range. A scaling law holds where the three thirds agree.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from sim.arrays import Floats
from sim.inputs import check_columns
from sim.mechanics.drag import tail_coefficients
from sim.model.groups import Groups
from sim.reference.linear_theory import linear_motion

_ERRORS = 1.96  # standard errors in an interval of 95 %
_ROWS_PER_INPUT = 3  # in each third
_MOST_LINEAR_ROWS = 2000  # linear theory takes about a millisecond a robot


@dataclass(frozen=True)
class Exponents:
    """∂ln y/∂ln x in the lower, middle and upper third of x, with half-widths of 95 % intervals."""

    output: str
    input: str
    value: tuple[float, float, float]
    half_width: tuple[float, float, float]

    @property
    def holds(self) -> bool:
        """Return whether one power law describes all thirds: exponents differ by less than 0.1."""
        return max(self.value) - min(self.value) < 0.1


def exponents(inputs: Mapping[str, Floats], output: str, values: Floats) -> list[Exponents]:
    """Fit exponents of an output (M,) in every input (M,) that varies; rows that are not above 0 are left out."""
    good = np.isfinite(values) & (values > 0)
    names = [name for name, column in inputs.items() if np.ptp(column[good]) > 0]
    logs = np.stack([np.log(inputs[name][good]) for name in names], 1)
    y = np.log(values[good])
    return [Exponents(output, name, *_by_third(logs, y, k)) for k, name in enumerate(names)]


def rows_for_exponents(inputs: int) -> int:
    """Return how many rows exponents of so many inputs need."""
    return 3 * _ROWS_PER_INPUT * inputs


def _by_third(logs: Floats, y: Floats, k: int) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
    """Fit exponents and half-widths of intervals in the thirds of input k."""
    edges = np.quantile(logs[:, k], [0, 1 / 3, 2 / 3, 1])
    slopes, errors = [], []
    for low, high in pairwise(edges):
        third = (logs[:, k] >= low) & (logs[:, k] <= high)
        x = logs[third] - logs[third].mean(0)
        if np.ptp(x[:, k]) == 0 or third.sum() < _ROWS_PER_INPUT * logs.shape[1]:
            slopes.append(np.nan)
            errors.append(np.nan)
            continue
        slope, _, _, _ = np.linalg.lstsq(x, y[third] - y[third].mean(), rcond=None)
        residual = y[third] - y[third].mean() - x @ slope
        freedom = max(len(residual) - x.shape[1] - 1, 1)
        covariance = np.linalg.pinv(x.T @ x) * residual.var() * len(residual) / freedom
        slopes.append(float(slope[k]))
        errors.append(_ERRORS * float(np.sqrt(covariance[k, k])))
    return (slopes[0], slopes[1], slopes[2]), (errors[0], errors[1], errors[2])


def linear_rows(columns: Mapping[str, Floats], *, seed: int = 0) -> tuple[np.ndarray, dict[str, Floats]]:
    """Evaluate linear theory for some of the rows: their numbers (K,), and outputs and drag number S, (K,) each.

    Args:
        columns: inputs by name, each (M,), without effects.
    """
    count = len(columns["N"])
    rows = np.arange(count)
    if count > _MOST_LINEAR_ROWS:
        rows = np.sort(np.random.default_rng(seed).choice(count, _MOST_LINEAR_ROWS, replace=False))
    values = check_columns({name: column[rows] for name, column in columns.items()})
    values_by_row = []
    for i in range(len(rows)):
        groups = Groups.from_columns({name: column[i : i + 1] for name, column in values.items()})
        motion, perpendicular = linear_motion(groups), tail_coefficients(groups.l_over_r0)[1].item()
        values_by_row.append(
            (motion.omega_t, motion.omega_yr, motion.v_x, motion.v_z, perpendicular * motion.omega_t)
        )
    omega_t, omega_yr, v_x, v_z, drag_number = np.abs(np.array(values_by_row).T)
    return rows, {
        "omega_t_bar": omega_t,
        "omega_yr_bar": omega_yr,
        "v_z": v_z,
        "R_yr_over_l": np.hypot(v_x, v_z) / omega_yr,
        "theta_deg": np.degrees(np.arctan2(v_x, v_z)),
        "S": drag_number,
    }
