"""Batches of robots, and derivatives of the steady motion against differences of solutions."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from sim.effects import catalogue
from sim.io.errors import InputError
from sim.model.groups import Groups
from sim.model.sweepable import SLOPE_INPUTS, SLOPE_OUTPUTS
from sim.motion.batches import in_batches, sensitivity_columns, split
from sim.motion.sensitivity import sensitivities
from sim.motion.steady import orbits
from sim.solve.refinement import PHASES_FOR_SLOPES
from tests.sim.robots import CONTROL_VALUES, control, sweep_points


def test_batches_hold_every_row_once_and_one_n_each() -> None:
    tails = np.array([2.0, 5.0, 2.0, 3.0, 2.0, 5.0, 2.0])
    batches = split(tails, 2)
    assert sorted(np.concatenate(batches).tolist()) == list(range(7))
    assert all(len(b) <= 2 and len(set(tails[b])) == 1 for b in batches)
    with pytest.raises(InputError, match="no parameter 'colour'"):
        sensitivities(control(), ["colour"])
    with pytest.raises(InputError, match="jobs = 0; give at least 1"):
        in_batches(vars, {}, 1, jobs=0)


def blas_threads() -> set[int]:
    return {library["num_threads"] for library in threadpool_info() if library["user_api"] == "blas"}


def test_threads_at_work_leave_the_number_of_threads_alone() -> None:
    """Workers that overlap and end in the order in which they began."""
    with threadpool_limits(2, user_api="blas"):

        def work(groups: Groups) -> dict[str, np.ndarray]:
            time.sleep(groups.omega_bar[0])
            return {"threads": np.array(list(blas_threads()))}

        columns = {name: np.full(4, value) for name, value in CONTROL_VALUES.items()}
        seen = in_batches(work, {**columns, "omega_bar": np.array([0.1, 0.2, 0.2, 0.2])}, 1, jobs=2)
        assert seen["threads"].tolist() == [1] * 4
        assert blas_threads() == {2}


def test_sensitivities_in_threads_are_those_of_one_robot_at_a_time() -> None:
    """In the order of the rows, tails mixed; forward differentiation must not leak from thread to thread."""
    count = 35
    values = {**CONTROL_VALUES, "N": np.tile([2.0, 3.0, 2.0, 4.0, 2.0], count // 5)}
    values["omega_bar"] = np.linspace(2.0, 12.0, count)
    columns = {k: np.broadcast_to(np.asarray(v, float), count).copy() for k, v in values.items()}
    names = ("C_t", "tail_spin_drag")
    found = sensitivity_columns(columns, names, jobs=2, title="")
    for row in (0, 1, 33):
        alone = sensitivities(Groups.from_columns({k: v[row : row + 1] for k, v in columns.items()}), names)
        assert found.values["omega_yr_bar"][row] == pytest.approx(alone.values["omega_yr_bar"][0], rel=1e-9)
        assert found.derivatives["v_z"][row] == pytest.approx(alone.derivatives["v_z"][0], rel=1e-6)


LOCAL = {name: effect for name, effect in catalogue().items() if effect.reach == "local"}


def steady_values(groups: Groups) -> dict[str, np.ndarray]:
    motion = orbits(groups, phases=PHASES_FOR_SLOPES)
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
