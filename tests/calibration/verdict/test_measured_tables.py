"""Measured tables, where they are on the machine, and a helix by its parts."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from calibration.examples.helices import read_helices, resistive, with_flow
from calibration.examples.spheres import median_error, read_spheres
from calibration.statistics.noise import repeat_covariance
from calibration.swimmer.measured_table import read_measurements
from calibration.swimmer.swimmer import Swimmer
from calibration.verdict.calibrate import calibrate
from tests.calibration.toy_tables import START

MEASURED = Path(__file__).parents[4] / "shared" / "measured"


@pytest.mark.skipif(not MEASURED.is_dir(), reason="the measured tables are not on this machine")
@pytest.mark.parametrize("name", ["run01.csv", "run02.csv"])
def test_measured_tables_are_read_whole(name: str) -> None:
    data = read_measurements(MEASURED / name)
    assert len(data) == 192
    assert data.set_aside == ()
    assert data.session_names == ("N = 2", "N = 3", "N = 4", "N = 5")
    spread = np.sqrt(np.diag(repeat_covariance(data.y, data.condition)))
    assert ((spread > 0.01) & (spread < 0.05)).all()


@pytest.mark.skipif(not MEASURED.is_dir(), reason="the measured tables are not on this machine")
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


@pytest.mark.skipif(not MEASURED.is_dir(), reason="the measured tables are not on this machine")
@pytest.mark.parametrize(
    ("name", "effect", "size"),
    [
        ("run04.csv", "natural_curvature", -0.295),
        pytest.param("run05.csv", "viscosity_with_time", 0.0444, marks=pytest.mark.long),
    ],
)
def test_what_came_out_of_the_measured_tables(name: str, effect: str, size: float) -> None:
    """docs/measured-tables.md; the others take longer and are written down there."""
    result = calibrate(Swimmer(START, read_measurements(MEASURED / name)), progress=False)
    assert result.effects == (effect,)
    assert result.final.parameters[effect] == pytest.approx(size, rel=0.05)
    assert result.error_after < 1.15 * result.noise_ceiling


def test_a_helix_with_the_flow_of_its_parts() -> None:
    """Converged in the number of pieces; a straight wire drags as Tirado and Garcia de la Torre (1979) say."""
    pitch = np.array([2.226, 9.811])
    assert with_flow(pitch, pieces=240) == pytest.approx(with_flow(pitch, pieces=480), rel=0.01)
    wire = with_flow(np.array([1e3]))[0]
    slenderness = 130.0 / (2 * 0.397)
    assert wire[2] == pytest.approx(2 * math.pi * 130.0 / 6.3 / (math.log(slenderness) - 0.207), rel=0.01)
    assert resistive(np.array([1e3]))[0, 0] == pytest.approx(0, abs=0.5)


@pytest.mark.skipif(not MEASURED.is_dir(), reason="the measured tables are not on this machine")
def test_resistive_force_theory_fails_for_a_helix_and_flow_explains_it() -> None:
    """Rodenborn et al. (2013): thrust three times too large at the shortest pitch; 6 % with the flow."""
    pitch, measured = read_helices(MEASURED / "published" / "rodenborn_fig2.csv")
    thrust = resistive(pitch)[:, 0] / measured[:, 0]
    assert thrust[0] == pytest.approx(3.0, abs=0.1)
    assert thrust[-1] < 0.8
    off = with_flow(pitch) / measured - 1
    assert np.sqrt((off**2).mean(0)).max() < 0.07
