"""A query of the look-up table with arrays, step by step: reference for `surrogate.table.compiled_query`."""

from __future__ import annotations

from typing import Any

import numpy as np

from sim.arrays import Flags, Floats
from sim.inputs import check_columns
from sim.mechanics import planar
from sim.model.groups import DWELL
from sim.motion.net_speed import twists
from sim.motion.steady_motion import STEADY_OUTPUTS
from surrogate.table.compiled_query import BRANCHES
from surrogate.table.errors import RESPONSE_OUTPUTS, error_scale
from surrogate.table.lookup import Motions, NeuralTable
from surrogate.table.response_table import SHAPES, between_dwells, curve_speeds
from surrogate.table.wrench_table import network_index, rows_by_network
from surrogate.wrench.heads import heads_and_tails
from surrogate.wrench.tails import network_inputs, tail_inputs

_RANGES = ("omega_bar", "l_over_R", "l_over_r0", "a_over_R")


def answer(table: NeuralTable, columns: dict[str, Floats]) -> dict[str, Any]:
    """Return outputs of robots (M,), with DWELL among the columns also those of the response."""
    motions, outside = _motions(table, columns)
    gap = table.tails.tail_gap(motions.tails, motions.motion)
    values = table.tails.outputs(motions.heads, motions.motion, gap)
    steady: dict[str, Any] = dict(zip(STEADY_OUTPUTS, values, strict=True))
    if DWELL not in columns:
        return {**steady, "outside": outside}
    lag = between_dwells(_lags(table, motions), columns[DWELL])
    twist = twists(steady["v_z"], steady["v_x"], steady["omega_yr_bar"], motions.heads.sense)
    speed = planar.net_speed(twist, lag, columns[DWELL])
    return {**steady, **dict(zip(RESPONSE_OUTPUTS, (speed, *lag.T[::-1]), strict=True)), "outside": outside}


def half_widths(table: NeuralTable, columns: dict[str, Floats], found: dict[str, Any]) -> dict[str, Floats]:
    """Return half-widths of the intervals of outputs, (M,) each."""
    motions, _ = _motions(table, columns)
    features = table.width_features(motions)
    assert table.intervals is not None
    widths = {}
    for name in [name for name in found if name in table.intervals.factor]:
        half = table.intervals.half_widths(name, features, error_scale(name, found), motions.heads.couples)
        widths[name] = np.where(np.isfinite(found[name]), half, 0.0)
    return widths


def _motions(table: NeuralTable, columns: dict[str, Floats]) -> tuple[Motions, Flags]:
    values = check_columns({name: array for name, array in columns.items() if name != DWELL})
    heads, tails = heads_and_tails(values)
    motion, converged = table.tails.solve(heads, tails)
    inputs = tail_inputs(tails, motion)
    inside = np.zeros(len(motion), dtype=bool)
    for k, rows in rows_by_network(network_index(tails.number)):
        support = table.support[k]
        if support is not None:
            own = network_inputs(tails.at(rows), motion[rows], len(support.shift))
            inside[rows] = support.novelty(own) <= 1
    for name in _RANGES:
        low, high = table.ranges[name]
        inside &= (low * (1 - 1e-9) <= np.abs(values[name])) & (np.abs(values[name]) <= high * (1 + 1e-9))
    inside &= converged & (np.abs(motion[:, 2]) <= BRANCHES * np.abs(motion[:, 4]))
    return Motions(heads, tails, motion, inputs, [""] * len(motion)), ~inside


def _lags(table: NeuralTable, motions: Motions) -> Floats:
    """Return lags with the memory of a dwell before of the same length, (M, D, 3)."""
    components = table.curves._components(motions.tails, motions.motion)
    both = np.concatenate([components["lag"], components["memory"]], 1)
    basis = table.curves.equal_dwells
    curve = (basis.mean + both @ basis.vectors).reshape(-1, *SHAPES["lag"])
    return np.asarray(curve * curve_speeds(motions.heads, motions.motion)[:, None])
