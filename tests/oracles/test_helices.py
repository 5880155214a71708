"""Rigid helices: the flow that one part makes at another explains what resistive force theory misses."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from tests.oracles.helices import resistive, with_flow

MEASURED = Path(__file__).parents[3] / "shared" / "measured"


@pytest.mark.slow
def test_a_helix_with_the_flow_of_its_parts() -> None:
    """Converged in the number of segments; a straight wire drags as Tirado and Garcia de la Torre (1979) say."""
    pitch = np.array([2.226, 9.811])
    assert with_flow(pitch, pieces=240) == pytest.approx(with_flow(pitch, pieces=480), rel=0.01)
    wire = with_flow(np.array([1e3]))[0]
    slenderness = 130.0 / (2 * 0.397)
    assert wire[2] == pytest.approx(2 * math.pi * 130.0 / 6.3 / (math.log(slenderness) - 0.207), rel=0.01)
    assert resistive(np.array([1e3]))[0, 0] == pytest.approx(0, abs=0.5)


@pytest.mark.skipif(not MEASURED.is_dir(), reason="the measured tables are not on this machine")
def test_resistive_force_theory_fails_for_a_helix_and_flow_explains_it() -> None:
    """Rodenborn et al. (2013): thrust three times too large at the shortest pitch; 6 % with the flow."""
    table = pd.read_csv(MEASURED / "published" / "rodenborn_fig2.csv")
    pitch = table["lambda_over_R"].to_numpy()
    measured = table[["thrust_over_etaOmR2", "torque_over_etaOmR3", "drag_over_etaUR"]].to_numpy()
    thrust = resistive(pitch)[:, 0] / measured[:, 0]
    assert thrust[0] == pytest.approx(3.0, abs=0.1)
    assert thrust[-1] < 0.8
    off = with_flow(pitch) / measured - 1
    assert np.sqrt((off**2).mean(0)).max() < 0.07
