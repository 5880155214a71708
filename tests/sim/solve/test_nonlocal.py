"""Orbits: the stated error, and effects that reach further than one node, against time steps and differences."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sim.effects import catalogue
from sim.linear.spectral import with_phases
from sim.model.groups import Groups
from sim.motion.run import Resolution
from sim.motion.sensitivity import sensitivities
from sim.motion.settling import settle
from sim.motion.steady import orbits
from sim.solve.orbit import mean_motion
from sim.solve.refinement import PHASES, PHASES_FOR_SLOPES, SOLVED, difference, refined_orbit, with_edges
from tests.sim.robots import control, first_body, solve_orbit, sweep_points

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
