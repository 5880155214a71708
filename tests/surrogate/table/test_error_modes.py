"""Errors of a table as modes: sizes, how they differ between dwells, what is learned from held-out robots."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sim.model.presets import PRESETS
from sim.model.response import BEFORE, DWELLS
from surrogate.error_modes import STEADY, error_modes
from surrogate.table.curve_errors import CurveErrors
from surrogate.table.errors import error_scale
from surrogate.table.model_file import load
from surrogate.table.response_table import Basis

ERRORS = {name: {"rms": 0.002} for name in (*STEADY, "lag_z", "lag_x", "lag_psi_rad")}
MOTION = {"v_z": 0.018, "v_x": 0.042, "omega_yr_bar": 0.049}


def columns() -> dict[str, np.ndarray]:
    return {name: np.array([value]) for name, value in PRESETS["paper-control"].group_values().items()}


def test_errors_of_known_size_have_this_size_at_each_dwell() -> None:
    modes = error_modes(ERRORS, MOTION)
    curves = np.concatenate([modes.lag[:, None] + modes.memory, modes.lag[:, None]], 1)
    sizes = [0.002 * float(error_scale(name, MOTION)) for name in ("lag_z", "lag_x", "lag_psi_rad")]
    assert np.sqrt((curves**2).sum(0)) == pytest.approx(np.broadcast_to(sizes, curves.shape[1:]), rel=0.02)
    assert np.sqrt((modes.twist**2).sum(0)) == pytest.approx([0.002 * error_scale(n, MOTION) for n in STEADY])


def test_errors_of_unequal_dwells_do_not_cancel() -> None:
    """With one number for all dwells, errors of heading of a left and a right dwell cancelled, on curves too."""
    modes = error_modes(ERRORS, MOTION)
    after = {k: modes.lag + modes.memory[:, k] for k in range(len(BEFORE))}

    def heading(dwell: float, before: float) -> np.ndarray:
        i, k = int(np.argmin(abs(DWELLS - dwell))), int(np.argmin(abs(BEFORE - before)))
        return after[k][:, i, 2]

    size = np.sqrt((heading(0.6, 0.6) ** 2).sum())
    apart = np.sqrt(((heading(0.9, 0.4) - heading(0.4, 0.9)) ** 2).sum())
    assert 0.5 * size < apart < 1.5 * size


def test_sizes_and_shapes_are_learned_from_held_out_robots() -> None:
    """Errors of one known shape, whose size is proportional to a feature: the mode is this shape, at that size."""
    rng = np.random.default_rng(1)
    features = np.column_stack([rng.uniform(-1, 1, (600, 10)), np.zeros(600)])
    vectors = rng.normal(size=(3, 75))
    shape = (rng.normal(size=3) @ vectors).reshape(25, 3)
    sizes = np.exp(features[:, 4])
    lag = rng.normal(size=600)[:, None, None] * sizes[:, None, None] * shape
    noise = 0.02 * rng.normal(size=lag.shape)  # of time steps
    bases = {"lag": Basis(np.zeros(75), vectors), "memory": Basis(np.zeros(1200), np.zeros((1, 1200)))}
    errors = {"lag": lag + noise, "memory": np.zeros((600, len(BEFORE), 25, 3))}
    learned = CurveErrors.learned(features, errors, bases, np.full(600, 1e-4))
    for factor in (-0.8, 0.8):
        at = np.zeros((1, 11))
        at[0, 4] = factor
        modes = learned.modes(at, np.ones((1, 3)))[:, -1]
        assert np.sqrt((modes**2).sum(0)) == pytest.approx(np.exp(factor) * abs(shape), rel=0.25, abs=0.02)
    assert learned.simulator == pytest.approx(1e-4)


def test_the_shipped_table_states_smaller_errors_where_it_knows_more() -> None:
    """Local errors of the control robot, in the middle of the domain, against the mean error of all robots."""
    lookup = load()
    local, of_all = lookup.error_modes(columns()), error_modes(lookup.errors, MOTION)
    sizes = [np.sqrt((modes.lag[..., 2] ** 2).sum(0)).mean() for modes in (local, of_all)]
    assert 0 < sizes[0] < sizes[1]


def test_a_table_of_earlier_versions_states_its_mean_errors(tmp_path: Path) -> None:
    replace(load(), curve_errors=None).save(tmp_path / "model.safetensors")
    older = load(tmp_path / "model.safetensors")
    assert older.curve_errors is None
    motion = {name: float(values[0]) for name, values in older.query(columns()).items()}
    assert older.error_modes(columns()).lag == pytest.approx(error_modes(older.errors, motion).lag)
