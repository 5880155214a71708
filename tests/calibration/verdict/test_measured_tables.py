"""Measured tables, where they are on the machine."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from calibration.examples.spheres import median_error, read_spheres
from calibration.statistics.gls import repeat_covariance
from calibration.swimmer.measured_table import read_measurements
from calibration.swimmer.swimmer import SwimmerModel
from calibration.verdict.calibrate import calibrate
from tests.calibration.toy_tables import START

MEASURED = Path(__file__).parents[4] / "shared" / "measured"
pytestmark = pytest.mark.skipif(not MEASURED.is_dir(), reason="the measured tables are not on this machine")


@pytest.mark.parametrize("name", ["run01.csv", "run02.csv"])
def test_measured_tables_are_read_whole(name: str) -> None:
    data = read_measurements(MEASURED / name)
    assert len(data) == 192
    assert data.excluded == ()
    assert data.session_names == ("N = 2", "N = 3", "N = 4", "N = 5")
    spread = np.sqrt(np.diag(repeat_covariance(data.y, data.condition)))
    assert ((spread > 0.01) & (spread < 0.05)).all()


def test_spheres_in_glycerine_need_the_wall() -> None:
    """5.1 % to 1.3 %; inertia does as well, so the verdict names both. One bead of ZK2026 is odd."""
    source = MEASURED / "published" / "falling_sphere_glycerine.csv"
    model = read_spheres(source, "KW2023")
    result = calibrate(model, progress=False)
    assert set(result.effects) >= {"wall"}
    assert result.verdict == "ambiguous"
    assert median_error(model, result, {}) == pytest.approx(0.051, abs=0.002)
    assert median_error(model, result, {"wall": 1.0}) == pytest.approx(0.0135, abs=0.002)
    assert calibrate(read_spheres(source, "ZK2026"), progress=False).verdict == "unexplained"


@pytest.mark.rates
@pytest.mark.parametrize(
    ("name", "effect", "size"),
    [
        ("run04.csv", "natural_curvature", -0.295),
        ("run05.csv", "viscosity_with_time", 0.0444),
    ],
)
def test_what_came_out_of_the_measured_tables(name: str, effect: str, size: float) -> None:
    """docs/results-calibration.md; the others take longer and are written down there."""
    result = calibrate(SwimmerModel(START, read_measurements(MEASURED / name)), progress=False)
    assert result.effects == (effect,)
    assert result.final.parameters[effect] == pytest.approx(size, rel=0.05)
    assert result.error_after < 1.15 * result.noise_ceiling
