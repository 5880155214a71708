"""Tails in contact: gaps are kept, meshes converge, and time steps settle to the same motion."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.spatial.distance import cdist

from sim.linear.spectral import with_phases
from sim.model.groups import Groups
from sim.model.presets import PRESETS
from sim.motion.run import Resolution
from sim.motion.sensitivity import sensitivities
from sim.motion.settling import settle
from sim.motion.steady import orbits
from sim.solve.orbit import mean_motion
from sim.solve.refinement import PHASES, PHASES_FOR_SLOPES, SOLVED, difference, orbit_on_mesh, refined_orbit
from tests.sim.robots import control, first_body, growth

MEANS = ("omega_t", "omega_h", "omega_yr", "v_x", "v_z")
ROBOTS = {
    "measured": PRESETS["paper-measured"].groups(),
    "two": control(N=2, omega_bar=30.0, l_over_r0=18.0, C_yr=4.0),
    "three": control(N=3, omega_bar=80.0, l_over_r0=26.0),
    "five": control(N=5, omega_bar=25.0),
    "backwards": control(N=4, omega_bar=-60.0, l_over_r0=22.0),
}


def with_contact(groups: Groups, size: float = 1.0) -> Groups:
    return replace(groups, effects={**groups.effects, "tail_contact": np.full(len(groups), size)})


def axes(x: np.ndarray, offset: float, tails: int) -> np.ndarray:
    """Interpolate the tails of an orbit x (n, M, 3) as smooth curves in space, (phases, N, points, 3)."""
    x = with_phases(x, tails * (24 // tails))
    n, columns, _ = x.shape
    root = np.zeros((1, columns, 3))
    root[:, :, 0] = offset
    curves = CubicSpline(np.arange(n + 1) / n, np.concatenate([root, x]))(np.linspace(0, 1, 20 * n + 1))
    turn = 2 * np.pi * np.arange(columns) / columns
    cos, sin = np.cos(turn), np.sin(turn)
    along, across = cos * curves[..., 0] - sin * curves[..., 1], sin * curves[..., 0] + cos * curves[..., 1]
    placed = np.stack([along, across, curves[..., 2]], -1)
    return placed.reshape(20 * n + 1, tails, columns // tails, 3).transpose(2, 1, 0, 3)


def true_gap(x: np.ndarray, offset: float, radius: float, tails: int) -> float:
    """Measure the gap of two tails' axes over 2 r0, between points of both."""
    pairs = [(shapes[i], shapes[j]) for shapes in axes(x, offset, tails) for i, j in combinations(range(tails), 2)]
    return float(min(cdist(*pair).min() for pair in pairs)) / (2 * radius)


@pytest.mark.parametrize("name", list(ROBOTS))
def test_gaps_are_kept_to_two_per_cent(name: str) -> None:
    """Of the axes as smooth curves, over the whole revolution; without contact the tails overlap."""
    groups = ROBOTS[name]
    body = first_body(with_contact(groups))
    plain, found = (refined_orbit(b, groups.N, PHASES) for b in (first_body(groups), body))
    assert plain.status == found.status == SOLVED
    assert true_gap(plain.x[2], body.offset, body.tail_radius, groups.N) < 0.9
    assert true_gap(found.x[2], body.offset, body.tail_radius, groups.N) == pytest.approx(1, abs=0.02)
    assert difference(found.means, plain.means) > 10 * found.error


@pytest.mark.parametrize("name", ["measured", "five"])
def test_meshes_converge(name: str) -> None:
    """The means on 8, 12 and 16 edges come nearer and nearer to those on 32, which the stated error covers."""
    groups = with_contact(ROBOTS[name])
    body = first_body(groups)
    means = {}
    for edges in (8, 12, 16, 32):
        solved, _, u = orbit_on_mesh(body, groups.N, edges)
        assert solved
        means[edges] = mean_motion(body, u)
    away = [difference(means[n], means[32]) for n in (8, 12, 16)]
    assert away[1] < 0.6 * away[0]
    assert away[2] < 0.7 * away[1]
    assert away[2] < 0.01
    found = refined_orbit(body, groups.N, PHASES)
    assert difference(found.means, means[32]) < 2 * found.error + away[2] / 3


def test_a_reversed_motor_gives_the_mirror_image() -> None:
    left, right = (orbits(with_contact(control(N=4, omega_bar=w, l_over_r0=22.0))) for w in (60.0, -60.0))
    for name, sign in zip(MEANS, (-1, -1, -1, -1, 1), strict=True):
        assert getattr(right, name)[0] == pytest.approx(sign * getattr(left, name)[0], rel=1e-6)


def test_softer_contact_overlaps_more() -> None:
    gaps = [orbits(with_contact(ROBOTS["measured"], size)).tail_gap[0] for size in (0.0, 0.25, 0.5, 0.75, 1.0)]
    assert (np.diff(gaps) > 0).all()
    assert gaps[0] < 0.75


@pytest.mark.slow
@pytest.mark.parametrize("name", ["two", *(pytest.param(n, marks=pytest.mark.rest) for n in ("measured", "five"))])
def test_time_steps_settle_to_the_orbit(name: str) -> None:
    """From straight tails at rest, every tail for itself."""
    groups = with_contact(ROBOTS[name])
    motion = orbits(groups)
    stepped = settle(groups, resolution=Resolution(24, 72))
    assert motion.converged.all()
    assert stepped.converged.all()
    assert stepped.tail_gap[0] > 0.98
    for key in MEANS:
        assert getattr(stepped, key)[0] == pytest.approx(getattr(motion, key)[0], rel=1e-2)


def test_sensitivities_are_differences() -> None:
    def yaw(size: float, C_t: float) -> float:
        groups = replace(with_contact(ROBOTS["measured"], size), C_t=np.array([C_t]))
        return float(orbits(groups, phases=PHASES_FOR_SLOPES).omega_yr[0])

    C_t, size, width = ROBOTS["measured"].C_t.item(), 0.3, 1e-3
    found = sensitivities(with_contact(ROBOTS["measured"], size), ("tail_contact", "C_t"))
    by_size = (yaw(size + width, C_t) - yaw(size - width, C_t)) / (2 * width)
    by_drag = (yaw(size, C_t + width) - yaw(size, C_t - width)) / (2 * width)
    assert found.derivatives["omega_yr_bar"][0] == pytest.approx([by_size, by_drag], rel=5e-3)


def test_tails_that_push_a_little_keep_moving_alike_and_a_ring_of_five_stout_ones_buckles() -> None:
    def growth_of(groups: Groups) -> float:
        body = first_body(with_contact(groups))
        found = refined_orbit(body, groups.N, PHASES)
        return growth(body, groups.N, found.x[0], found.u[0])

    assert growth_of(control(N=2, omega_bar=25.0)) < -0.5
    assert growth_of(control(N=4, omega_bar=25.0)) < -0.5
    assert growth_of(control(N=5, omega_bar=58.8, l_over_r0=19.0)) > 0.5
