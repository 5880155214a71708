"""Flow of segments, images and tails against integrals, symmetry and closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad_vec

from sim.mechanics.flow import stokeslets
from sim.solve.refinement import orbit_on_mesh
from tests.sim.robots import control, first_body, mean_tail_wrench


@pytest.mark.parametrize("where", [(0.3, 0.1, -0.2), (0.02, 0.01, -0.5), (0.0, 0.0, -0.5), (0.1, 0.0, 0.9)])
def test_flow_of_a_straight_piece_is_the_integral_of_stokeslets(where: tuple[float, float, float]) -> None:
    start, end, force, spread = np.array([0.0, 0, 0]), np.array([0.05, 0, -1.0]), np.array([0.3, -1.0, 0.7]), 0.03

    def point(share: float) -> np.ndarray:
        r = np.array(where) - start - share * (end - start)
        R = np.sqrt(r @ r + spread**2)
        return ((1 / R + spread**2 / R**3) * force + (r @ force) * r / R**3) / (8 * np.pi)

    expected = quad_vec(point, 0, 1, epsabs=1e-10, points=(0.5,))[0]
    found = stokeslets(where, tuple(start), tuple(end), tuple(force), spread)
    assert np.array(found) == pytest.approx(expected, rel=1e-7)


def test_nothing_flows_through_the_surface() -> None:
    """A segment and its image together: no normal velocity and no shear on the plane y = H."""
    start, end, force, height = (0.1, 0.2, 0.0), (0.3, -0.1, -0.8), (0.5, 0.9, -0.3), 0.6
    image = [(v[0], 2 * height - v[1], v[2]) for v in (start, end)]

    def velocity(y: float) -> np.ndarray:
        at = (0.4, y, -0.3)
        mirrored = (force[0], -force[1], force[2])
        direct = np.array(stokeslets(at, start, end, force, 0.03))
        return direct + np.array(stokeslets(at, *image, mirrored, 0.03))

    assert velocity(height)[1] == pytest.approx(0, abs=1e-15)
    shear = (velocity(height + 1e-4) - velocity(height - 1e-4))[[0, 2]] / 2e-4
    assert shear == pytest.approx([0, 0], abs=1e-8)


@pytest.mark.parametrize("tails", [2, 3, 4, 5])
def test_slow_tails_drag_each_other_as_much_as_rigid_rods(tails: int) -> None:
    """Torque against the closed form for evenly loaded rods on a ring (ours are loaded as the flow asks)."""
    few = {"N": tails, "omega_bar": 0.01}
    moments = []
    for share in (0.0, 1.0):
        body = first_body(control(**few, tail_interaction=share))
        solved, x, u = orbit_on_mesh(body, tails, 24)
        assert solved
        wrench = mean_tail_wrench(body, x, u)
        moments.append(wrench[3] / (0.01 + u[:, 3].mean()))
    j = np.arange(1, tails)
    distance = 2 / 6.875 * np.sin(np.pi * j / tails)
    s, e = np.arcsinh(1 / (2 * distance)), (1 + 4 * distance**2) ** -0.5
    more = (np.cos(2 * np.pi * j / tails) * s + np.cos(np.pi * j / tails) ** 2 * e).sum()
    alone = np.log(34.375) + 0.5
    assert moments[1] / moments[0] == pytest.approx(alone / (alone + more), rel=0.05)
