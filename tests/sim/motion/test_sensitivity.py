"""Derivatives of the steady motion against differences of solutions."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sim.effects import catalogue
from sim.io.errors import InputError
from sim.model.groups import Groups
from sim.model.slopes import SLOPE_INPUTS, SLOPE_OUTPUTS
from sim.motion.sensitivity import sensitivities
from sim.motion.steady import orbits
from sim.solve.refinement import MANY
from tests.sim.points import sweep_points
from tests.sim.robots import control

LOCAL = {name: effect for name, effect in catalogue().items() if effect.reach == "local"}


def steady_values(groups: Groups) -> dict[str, np.ndarray]:
    motion = orbits(groups, phases=MANY)
    assert motion.converged.all()
    values = (motion.omega_t, motion.omega_h, motion.omega_yr, motion.v_x, motion.v_z, motion.turn_radius)
    return dict(zip(SLOPE_OUTPUTS, (*values, motion.slip_angle), strict=True))


def moved(groups: Groups, name: str, by: float) -> Groups:
    if name in SLOPE_INPUTS:
        return replace(groups, **{name: getattr(groups, name) + by})
    size = groups.effects.get(name, np.full(len(groups), catalogue()[name].null))
    return replace(groups, effects={**groups.effects, name: size + by})


@pytest.mark.parametrize("tails", [2, 3, 5])
def test_derivatives_equal_differences_of_solutions(tails: int) -> None:
    """In every input and local effect, for robots of the sweep; both motor directions. (Others: test_nonlocal.)"""
    points = sweep_points(48)
    rows = np.flatnonzero(points["N"] == tails)[:3]
    columns = {name: values[rows].copy() for name, values in points.items()}
    columns["omega_bar"][1] *= -1
    effects = {name: np.full(len(rows), 0.5 * effect.typical) for name, effect in LOCAL.items()}
    groups = Groups.from_columns({**columns, **effects})
    names = (*SLOPE_INPUTS, *LOCAL)
    derivatives = sensitivities(groups, names)
    plain = steady_values(groups)
    for output in SLOPE_OUTPUTS:
        assert derivatives.values[output] == pytest.approx(plain[output], rel=1e-12)
    for k, name in enumerate(names):
        size = (
            float(np.abs(getattr(groups, name)).mean()) if name in SLOPE_INPUTS else abs(catalogue()[name].typical)
        )
        width = 1e-3 * size
        before, after = steady_values(moved(groups, name, -width)), steady_values(moved(groups, name, width))
        for output in SLOPE_OUTPUTS:
            slope = (after[output] - before[output]) / (2 * width)
            # The differences carry the error of Newton's tolerance and of their own width.
            close = 3e-5 * np.abs(plain[output]) / size + 2e-3 * np.abs(slope)
            assert (np.abs(derivatives.derivatives[output][:, k] - slope) < close).all(), (name, output)


def test_an_unknown_parameter_is_refused() -> None:
    with pytest.raises(InputError, match="no parameter 'colour'"):
        sensitivities(control(), ["colour"])
