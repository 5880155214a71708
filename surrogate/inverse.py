"""Inverse design with the table: robots that have a desired motion.

The free inputs are solved for by damped least squares (Levenberg and Marquardt) from many starts at once, with the
derivatives of the table. Several solutions are all returned.

Free inputs are varied as logarithms within their bounds. Left out: N, which is not continuous.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
from scipy.stats import qmc

from common.arrays import Floats, Integers
from common.errors import InputError
from sim.motion.steady_motion import STEADY_OUTPUTS
from surrogate.domain import BOUNDS
from surrogate.held_out import error_scale
from surrogate.table import OUTSIDE, NeuralTable

Bounds = Mapping[str, tuple[float, float]]

_STARTS, _STEPS = 16, 40
_SOLVED = 1e-6  # misfit, relative, of a solution
_SAME = 1e-3  # difference of ln(input) up to which two solutions are one


@dataclass(frozen=True)
class Solutions:
    """K solutions for M targets."""

    target: Integers  # (K,) row of the target
    inputs: dict[str, Floats]  # free inputs, each (K,)
    misfit: Floats  # (K,) root mean square of the relative misfits; 0 for an exact solution
    outside: Floats  # (K,) whether the solution is outside the table's domain


def inverse(
    lookup: NeuralTable, robots: Mapping[str, Floats], targets: Mapping[str, Floats], bounds: Bounds
) -> Solutions:
    """Find inputs that give wanted outputs.

    Args:
        lookup: the table.
        robots: the inputs that are given, each (M,).
        targets: outputs by name, each (M,); errors are relative as in `surrogate.held_out`.
        bounds: free inputs and their ranges.

    Returns:
        All different solutions, the best of each target first. Where no start solves a target, its best attempt.

    Raises:
        InputError: fewer targets than free inputs, or names that cannot be.
    """
    names, wanted = list(bounds), list(targets)
    if len(wanted) < len(names):
        raise InputError(
            f"{len(wanted)} targets for {len(names)} free inputs; give as many targets, or free fewer"
        )
    count = len(next(iter(targets.values())))
    low, high = (np.log([bounds[name][i] for name in names]) for i in (0, 1))
    starts = low + (high - low) * qmc.Sobol(len(names), rng=np.random.default_rng(0)).random(_STARTS)
    p = np.tile(starts, (count, 1))  # (M starts, F)
    row = np.repeat(np.arange(count), _STARTS)
    fixed = {name: np.asarray(array, dtype=float)[row] for name, array in robots.items() if name not in names}
    target_values = {name: np.asarray(array, dtype=float)[row] for name, array in targets.items()}
    size = _sizes(target_values)

    def misfits(p: Floats) -> tuple[Floats, Floats, Floats]:
        columns = {**fixed, **{name: np.exp(p[:, i]) for i, name in enumerate(names)}}
        outputs = lookup.query(columns, flag=True)
        slopes = lookup.derivatives(columns, names, flag=True)
        residual = np.stack([(outputs[name] - target_values[name]) / size[name] for name in wanted], -1)
        J = np.stack(
            [np.stack([slopes[o][n] * columns[n] for n in names], -1) / size[o][:, None] for o in wanted], 1
        )
        return residual, J, outputs[OUTSIDE]

    p, residual, outside = _least_squares(misfits, p, low, high)
    rms = np.sqrt((residual**2).mean(-1))
    return _different(row, p, rms, outside, names)


def inverse_table(
    lookup: NeuralTable, points: pd.DataFrame, free: Sequence[str], *, where: str = "the table"
) -> pd.DataFrame:
    """Find inputs for a table of targets, see `inverse`; a row for each solution.

    Args:
        lookup: the table.
        points: M rows: the given inputs of the robots, and outputs that they shall have.
        free: inputs to find.
        where: the name of `points`, for messages.

    Raises:
        InputError: there is no output among the columns, or an input cannot be found.
    """
    for name in free:
        if name not in BOUNDS:
            raise InputError(f"{name} cannot be found; allowed are {', '.join(BOUNDS)}")
    columns = {str(name): points[name].to_numpy() for name in points}
    targets = {name: array for name, array in columns.items() if name in STEADY_OUTPUTS}
    if not targets:
        raise InputError(f"{where} has no outputs; give at least one of {', '.join(STEADY_OUTPUTS)}")
    robots = {name: array for name, array in columns.items() if name not in targets}
    solutions = inverse(lookup, robots, targets, {name: BOUNDS[name] for name in free})
    return pd.DataFrame(
        {
            "target": solutions.target + 1,
            **solutions.inputs,
            "misfit": solutions.misfit,
            "outside": solutions.outside,
        }
    )


def _sizes(targets: Mapping[str, Floats]) -> dict[str, Floats]:
    """Return what misfits are relative to: themselves where the speed is not among the targets."""
    sizes = {}
    for name, value in targets.items():
        try:
            sizes[name] = np.broadcast_to(error_scale(name, targets), value.shape)
        except KeyError:
            sizes[name] = np.abs(value)
    return sizes


def _least_squares(
    misfits: Callable[[Floats], tuple[Floats, Floats, Floats]], p: Floats, low: Floats, high: Floats
) -> tuple[Floats, Floats, Floats]:
    """Minimise by Levenberg and Marquardt's method, for all rows of p (B, F) at once, within bounds."""
    damping = np.full(len(p), 1e-2)
    residual, J, outside = misfits(p)
    for _ in range(_STEPS):
        residual, J = np.nan_to_num(residual, nan=1e3), np.nan_to_num(J)
        A = np.einsum("bof,bog->bfg", J, J)
        diagonal = np.einsum("bff->bf", A)
        damped = A + (damping[:, None] * diagonal + 1e-12)[:, :, None] * np.eye(p.shape[1])
        step = np.linalg.solve(damped, np.einsum("bof,bo->bf", J, residual)[..., None])[..., 0]
        trial = np.clip(p - np.clip(step, -1, 1), low, high)
        new_residual, new_J, new_outside = misfits(trial)
        better = np.nan_to_num((new_residual**2).sum(-1), nan=np.inf) < (residual**2).sum(-1)
        p = np.where(better[:, None], trial, p)
        residual, J = np.where(better[:, None], new_residual, residual), np.where(better[:, None, None], new_J, J)
        outside = np.where(better, new_outside, outside)
        damping = np.where(better, damping / 5, damping * 4).clip(1e-9, 1e9)
        if (np.abs(step).max() < 1e-9) or (np.sqrt((residual**2).mean(-1)) < _SOLVED / 10).all():
            break
    return p, residual, outside


def _different(row: Integers, p: Floats, misfit: Floats, outside: Floats, names: list[str]) -> Solutions:
    kept: list[int] = []
    for target in np.unique(row):
        rows = np.flatnonzero(row == target)
        rows = rows[np.argsort(misfit[rows], kind="stable")]
        distinct = [rows[0]]
        for i in rows[1:]:
            if misfit[i] < _SOLVED and min(np.abs(p[i] - p[j]).max() for j in distinct) > _SAME:
                distinct.append(i)
        kept += [int(i) for i in distinct]
    inputs = {name: np.exp(p[kept, i]) for i, name in enumerate(names)}
    return Solutions(row[kept], inputs, misfit[kept], outside[kept])
