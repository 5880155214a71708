"""The tractrix against closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest

from planner.paths.path import Path2D, circle
from planner.paths.tractrix import reference


def test_tractrix_of_a_circle() -> None:
    """The pivot settles on a circle of radius √(ρ² − a²)."""
    ref = reference(circle(2.0), 0.87, 0.005)
    assert np.linalg.norm(ref.q, axis=1) == pytest.approx(np.full(len(ref.q), math.sqrt(4 - 0.87**2)), rel=1e-3)
    assert ref.curvature[5:-5] == pytest.approx(1 / math.sqrt(4 - 0.87**2), rel=0.05)


def test_tractrix_of_a_kink_decays_exponentially() -> None:
    """Behind a kink of angle α: tan(δ/2) = tan(α/2) exp(−s/a)."""
    path = Path2D.of([[0, 0], [1, 0], [1, 3]])
    ref = reference(path, 0.5, 0.01)
    after = ref.p[:, 1] > 1e-9
    s = ref.p[after, 1]
    expected = math.pi / 2 - 2 * np.arctan(np.exp(-s / 0.5))
    assert ref.heading[after] == pytest.approx(expected, abs=0.01)
