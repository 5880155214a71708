"""Trigonometric interpolants: exact for what M phases can resolve."""

from __future__ import annotations

import numpy as np
import pytest

from sim.linear.spectral import differentiation, interpolation, with_phases


@pytest.mark.parametrize("phases", [3, 4, 5, 8])
def test_phases_are_resampled_and_differentiated_exactly(phases: int) -> None:
    at = 2 * np.pi * np.arange(phases) / phases
    finer = 2 * np.pi * np.arange(12) / 12
    for k in range(1, (phases - 1) // 2 + 1):
        values = np.cos(k * at + 0.3)
        assert differentiation(phases) @ values == pytest.approx(-k * np.sin(k * at + 0.3), abs=1e-12)
        assert interpolation(phases, finer) @ values == pytest.approx(np.cos(k * finer + 0.3), abs=1e-12)
        assert with_phases(values.reshape(1, -1, 1), 12)[0, :, 0] == pytest.approx(
            np.cos(k * finer + 0.3), abs=1e-12
        )
