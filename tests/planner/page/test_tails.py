"""The wrench of the tails: inputs, terms and slopes are Python's."""

from __future__ import annotations

import numpy as np

from sim.model.groups import checked_values
from surrogate.wrench.heads import heads_and_tails
from surrogate.wrench.tails import (
    linear_thrust,
    linear_torque,
    single_inputs,
    tail_inputs,
    wrench_slopes,
    wrench_terms,
)
from tests.planner.page.page_core import answers
from tests.planner.page.robots import check_alike, columns_of, random_groups

COUNT = 20


def test_inputs_terms_and_slopes() -> None:
    robots = random_groups(COUNT)
    _, tails = heads_and_tails(checked_values(columns_of(robots)))
    motion = np.random.default_rng(0).normal(size=(COUNT, 5)) * [0.1, 0.1, 0.1, 1, 1]
    motion[:, 4] = np.abs(motion[:, 4]) + 1
    perp, parallel, offset, radius, number, spin_drag, head = tails
    pages = [
        {"perp": perp[i], "parallel": parallel[i], "offset": offset[i], "radius": radius[i], "number": number[i],
         "spinDrag": spin_drag[i], "head": head[i]}
        for i in range(COUNT)
    ]  # fmt: skip

    def each(name: str, *more: int) -> list[list[float]]:
        return answers([("tails.js", name, page, move, *more) for page, move in zip(pages, motion, strict=True)])

    check_alike(each("tailInputs"), tail_inputs(tails, motion), 1e-14)
    check_alike(each("networkInputs", 13), single_inputs(tails, motion), 1e-14)
    terms = np.stack(wrench_terms(perp, parallel, offset, number, motion.T), -1)
    check_alike(each("wrenchTerms"), terms, 1e-14)
    assert np.abs(np.array(each("wrenchSlopes")) - wrench_slopes(tails, motion)).max() < 1e-12


def test_linear_theory() -> None:
    drags = [0.1, 3.0, 60.0]
    found = answers([("tails.js", name, S) for name in ("linearThrust", "linearTorque") for S in drags])
    check_alike(found, [function(S) for function in (linear_thrust, linear_torque) for S in drags], 1e-14)
