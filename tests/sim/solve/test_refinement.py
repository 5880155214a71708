"""The stated error of an orbit against a much finer mesh and more phases."""

from __future__ import annotations

import numpy as np

from sim.linear.spectral import with_phases
from sim.model.groups import Groups
from sim.solve.orbit import mean_motion, solve_orbit
from sim.solve.refinement import FEW, SOLVED, difference, refined_orbit, with_edges
from tests.sim.points import sweep_points
from tests.sim.robots import first_body


def test_the_stated_error_covers_a_much_finer_mesh() -> None:
    """Against 24 and 36 edges, extrapolated: nine rows in ten are within it, all within three times."""
    points = sweep_points(24)
    ratios = []
    for i in range(24):
        groups = Groups.from_columns({name: values[i : i + 1] for name, values in points.items()})
        body = first_body(groups)
        orbit = refined_orbit(body, groups.N, FEW)
        assert orbit.ended == SOLVED
        x, u = orbit.x[2], orbit.u[2]
        phases = 2 * x.shape[1]
        x, u = with_phases(x, phases), with_phases(u.reshape(1, -1, 4), phases // groups.N)[0]
        fine = []
        for n in (24, 36):
            x = with_edges(x, body.offset, n)
            _, size = solve_orbit(body, x, u, 1e-7)
            assert size < 1e-7
            fine.append(mean_motion(body, u))
        truth = (36**2 * fine[1] - 24**2 * fine[0]) / (36**2 - 24**2)
        assert difference(orbit.means, truth) < 2e-3
        ratios.append(difference(orbit.means, truth) / orbit.error)
    assert np.quantile(ratios, 0.9) < 1
    assert max(ratios) < 3
