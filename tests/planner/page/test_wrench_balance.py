"""Motions in balance: those of the core leave nothing unbalanced in Python's equations."""

from __future__ import annotations

import numpy as np

from sim.model.groups import checked_values
from surrogate.table.jacobian import numbers_of
from surrogate.wrench.heads import heads_and_tails, unbalanced
from tests.planner.page.page_core import TABLE, answers
from tests.planner.page.robots import columns_of, random_groups, shipped, shipped_data


def test_forces_are_in_balance() -> None:
    robots = [robot | {"N": 3.0} for robot in random_groups(20)]
    found = answers([("lookup.js", "query", TABLE, robot, {"flag": True}) for robot in robots], shipped_data())
    heads, tails = heads_and_tails(checked_values(columns_of(robots)))
    yaw, spin = (np.array([one[name] for one in found]) * heads.sense for name in ("omega_yr_bar", "omega_h_bar"))
    sway = np.array([one["v_x"] for one in found]) * heads.sense - yaw * heads.length / 2
    u = np.column_stack([sway, [one["v_z"] for one in found], yaw, spin])
    network = shipped().tails.wrench[2]
    assert network is not None
    left = unbalanced(heads, tails, u, numbers_of(network))
    assert np.abs(left / (heads.resistance[:, :, :4] @ np.abs(u)[..., None])[..., 0]).max() < 1e-8
