"""Batches: every row once, in order, and the process left as it was."""

from __future__ import annotations

import time

import numpy as np
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from sim.io.errors import InputError
from sim.model.groups import Groups
from sim.motion.batches import run_batches, sensitivity_columns, split
from sim.motion.sensitivity import sensitivities
from tests.sim.robots import CONTROL_VALUES


def test_batches_hold_every_row_once_and_one_n_each() -> None:
    tails = np.array([2.0, 5.0, 2.0, 3.0, 2.0, 5.0, 2.0])
    batches = split(tails, 2)
    assert sorted(np.concatenate(batches).tolist()) == list(range(7))
    assert all(len(b) <= 2 and len(set(tails[b])) == 1 for b in batches)


@pytest.mark.parametrize("jobs", [0, -3])
def test_fewer_than_one_job_is_refused(jobs: int) -> None:
    with pytest.raises(InputError, match=f"jobs = {jobs}; give at least 1"):
        run_batches(len, [[1]], sizes=[1], jobs=jobs)


def blas_threads() -> set[int]:
    return {library["num_threads"] for library in threadpool_info() if library["user_api"] == "blas"}


def test_threads_at_work_leave_the_number_of_threads_alone() -> None:
    """Workers that overlap and end in the order in which they began."""
    with threadpool_limits(2, user_api="blas"):

        def work(pause: float) -> set[int]:
            time.sleep(pause)
            return blas_threads()

        seen = run_batches(work, [0.1, 0.2, 0.2, 0.2], sizes=[1] * 4, jobs=2, threads=True)
        assert seen == [{1}] * 4
        assert blas_threads() == {2}


def test_sensitivities_in_threads_are_those_of_one_robot_at_a_time() -> None:
    """In the order of the rows, tails mixed; forward differentiation must not leak from thread to thread."""
    count = 70
    values = {**CONTROL_VALUES, "N": np.tile([2.0, 3.0, 2.0, 4.0, 2.0], count // 5)}
    values["omega_bar"] = np.linspace(2.0, 12.0, count)
    columns = {k: np.broadcast_to(np.asarray(v, float), count).copy() for k, v in values.items()}
    names = ("C_t", "tail_spin_drag")
    found = sensitivity_columns(columns, names, jobs=2, title="")
    for row in (0, 1, 33, 69):
        alone = sensitivities(Groups.from_columns({k: v[row : row + 1] for k, v in columns.items()}), names)
        assert found.values["omega_yr_bar"][row] == pytest.approx(alone.values["omega_yr_bar"][0], rel=1e-9)
        assert found.derivatives["v_z"][row] == pytest.approx(alone.derivatives["v_z"][0], rel=1e-6)
