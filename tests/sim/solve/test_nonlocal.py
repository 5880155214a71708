"""Effects that reach further than one node: orbits against time steps, differences, meshes; contact of tails."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.spatial.distance import cdist

from sim.effects import catalogue
from sim.linear.spectral import with_phases
from sim.mechanics.geometry import straight
from sim.mechanics.tail_contact import FIRM, SOFTNESS, contact_forces, tail_gap
from sim.model.body import Body
from sim.model.groups import Groups
from sim.model.presets import PRESETS
from sim.motion.run import Resolution
from sim.motion.sensitivity import sensitivities
from sim.motion.settling import settle
from sim.motion.steady import orbits
from sim.solve.orbit import mean_motion
from sim.solve.refinement import (
    PHASES,
    PHASES_FOR_SLOPES,
    SOLVED,
    difference,
    orbit_on_mesh,
    refined_orbit,
    with_edges,
)
from tests.sim.robots import CONTROL_VALUES, control, first_body, growth, solve_orbit, sweep_points

# Natural twist alone shows nothing (it needs natural splay beside it).
NONLOCAL = tuple(e.name for e in catalogue().values() if e.reach == "nonlocal" and not e.beside)


@pytest.mark.slow
@pytest.mark.parametrize("name", NONLOCAL)
def test_orbits_are_what_time_steps_settle_to(name: str) -> None:
    """Second order in the mesh: the finer one is four times nearer to the extrapolated orbit."""
    groups = control(N=2, **{name: catalogue()[name].typical})
    motion = orbits(groups)
    assert motion.converged.all()
    coarse, fine = (settle(groups, resolution=Resolution(n, 48)) for n in (12, 24))
    for key in ("omega_yr", "v_x", "v_z"):
        limit = getattr(motion, key)[0]
        away = [abs(getattr(m, key)[0] / limit - 1) for m in (coarse, fine)]
        assert away[1] < 5e-3
        assert away[1] < 0.45 * away[0] + 5e-4


def yaw_rates(groups: Groups) -> np.ndarray:
    """Compute ω_yr on the phases that derivatives are taken on."""
    return orbits(groups, phases=PHASES_FOR_SLOPES).omega_yr


# Friction has no derivative where it starts: its bounds end at its null.
PLACES = [*((name, "typical") for name in NONLOCAL), ("tail_interaction", "null"), ("natural_splay", "null")]


@pytest.mark.parametrize(("name", "at"), PLACES)
def test_sensitivities_are_differences(name: str, at: str) -> None:
    effect = catalogue()[name]
    size, width = getattr(effect, at), 1e-3 * (effect.typical - effect.null)
    found = sensitivities(control(N=3, **{name: size}), (name, "C_t"))
    around = np.array([size - width, size + width])  # also below a null that is a bound
    low, high = yaw_rates(replace(control(2, N=3), effects={name: around}))
    slope = (high - low) / (2 * width)
    assert found.derivatives["omega_yr_bar"][0, 0] == pytest.approx(slope, rel=2e-3, abs=1e-5)
    C_t = 3.0
    low, high = yaw_rates(control(2, N=3, C_t=[C_t * 0.999, C_t * 1.001], **{name: size}))
    slope = (high - low) / (0.002 * C_t)
    assert found.derivatives["omega_yr_bar"][0, 1] == pytest.approx(slope, rel=2e-3)


def test_nonlocal_effects_stand_beside_each_other() -> None:
    sizes = {name: 0.3 * catalogue()[name].typical for name in NONLOCAL}
    assert orbits(control(N=4, **sizes)).converged.all()


def test_the_stated_error_covers_a_much_finer_mesh() -> None:
    """Against 24 and 36 edges, extrapolated: nine rows in ten are within it, all within three times."""
    points = sweep_points(12)
    ratios = []
    for i in range(12):
        groups = Groups.from_columns({name: values[i : i + 1] for name, values in points.items()})
        body = first_body(groups)
        orbit = refined_orbit(body, groups.N, PHASES)
        assert orbit.status == SOLVED
        x, u = orbit.x[2], orbit.u[2]
        phases = 2 * x.shape[1]
        x, u = with_phases(x, phases), with_phases(u.reshape(1, -1, 4), phases // groups.N)[0]
        fine = []
        for n in (24, 36):
            x = with_edges(x, body.offset, n)
            size = solve_orbit(body, x, u, 1e-7)
            assert size < 1e-7
            fine.append(mean_motion(body, u))
        truth = (36**2 * fine[1] - 24**2 * fine[0]) / (36**2 - 24**2)
        assert difference(orbit.means, truth) < 2e-3
        ratios.append(difference(orbit.means, truth) / orbit.error)
    assert np.quantile(ratios, 0.9) < 1
    assert max(ratios) < 3


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


def test_sensitivities_of_tails_in_contact_are_differences() -> None:
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


EDGES = 8


def bundle(tails: int, seed: int) -> tuple[Body, np.ndarray]:
    """Make a robot whose tails lean towards the axis and twist about each other; free nodes (n, N, 3)."""
    body = first_body(control(N=tails, tail_contact=0.5))
    random = np.random.default_rng(seed)
    x = straight(EDGES, tails, body.offset)
    along = -x[:, :, 2]
    angle, near = 2.0 * along**2, 1 - (1 - along) ** 4
    radius = body.offset * (1 - near) + body.tail_radius / np.sin(np.pi / tails) * near
    x[:, :, 0], x[:, :, 1] = radius * np.cos(angle), radius * np.sin(angle)
    return body, x + 2e-3 * random.normal(size=x.shape)


def forces(body: Body, x: np.ndarray) -> np.ndarray:
    """Compute contact forces on nodes 0..n of tails x (n, N, 3), in the frame of each tail, (n + 1, N, 3)."""
    out = np.full((len(x) + 1, *x.shape[1:]), np.nan)
    contact_forces(body, x, 0, x.shape[1], out)
    return out


def together(vectors: np.ndarray) -> np.ndarray:
    """Turn vectors (K, N, 3) from the frames of their tails into the frame of tail 0."""
    turn = 2 * np.pi * np.arange(vectors.shape[1]) / vectors.shape[1]
    out = vectors.copy()
    out[:, :, 0] = np.cos(turn) * vectors[:, :, 0] - np.sin(turn) * vectors[:, :, 1]
    out[:, :, 1] = np.sin(turn) * vectors[:, :, 0] + np.cos(turn) * vectors[:, :, 1]
    return out


@pytest.mark.parametrize("tails", [2, 3, 4, 5])
def test_total_force_and_moment_are_zero(tails: int) -> None:
    body, x = bundle(tails, tails)
    root = np.zeros((1, tails, 3))
    root[:, :, 0] = body.offset
    force, place = together(forces(body, x)), together(np.concatenate([root, x]))
    scale = np.abs(force).sum()
    assert scale > 0.1
    assert np.abs(force.sum((0, 1))).max() < 1e-13 * scale
    assert np.abs(np.cross(place, force).sum((0, 1))).max() < 1e-13 * scale


def test_forces_come_from_an_energy() -> None:
    """Their derivative in the positions is symmetric."""
    body, x = bundle(2, 1)
    step, count = 1e-7, x.size
    slopes = np.empty((count, count))
    for i in range(count):
        ends = []
        for sign in (-1, 1):
            moved = x.copy()
            moved.reshape(-1)[i] += sign * step
            ends.append(forces(body, moved)[1:].reshape(-1))
        slopes[:, i] = (ends[1] - ends[0]) / (2 * step)
    assert np.abs(slopes).max() > 10
    assert np.abs(slopes - slopes.T).max() < 1e-5 * np.abs(slopes).max()


@pytest.mark.parametrize("gap", [0.97, 0.99, 1.0, 1.01])
def test_parallel_tails_repel_by_the_law(gap: float) -> None:
    """Straight tails at a distance: the force per length, away from each other; nothing beyond a tenth more."""
    body = first_body(control(N=2, tail_contact=0.5))
    body = body._replace(offset=gap * body.tail_radius)
    force = forces(body, straight(EDGES, 2, body.offset))
    law = body.nonlocal_terms.tail_contact * SOFTNESS / FIRM * np.log1p(np.exp((1 - gap) / SOFTNESS))
    middle = slice(3, -3)  # at its ends the other tail ends, too
    assert force[middle, :, 0] * EDGES == pytest.approx(np.full((3, 2), law), rel=1e-6)
    assert np.abs(force[middle, :, 1:]).max() < 1e-9 * law
    assert force[:, :, 0].sum() == pytest.approx(2 * law, rel=0.05)
    apart = body._replace(offset=1.11 * body.tail_radius)
    assert not forces(apart, straight(EDGES, 2, apart.offset)).any()


def test_the_gap_of_straight_tails() -> None:
    offset, radius = 1 / CONTROL_VALUES["l_over_R"], 1 / CONTROL_VALUES["l_over_r0"]
    tails = straight(EDGES, 4, offset)
    assert tail_gap(tails, offset, radius) == pytest.approx(math.sqrt(2) * offset / (2 * radius), rel=1e-12)
    assert math.isinf(tail_gap(tails[:, :1].copy(), offset, radius))
