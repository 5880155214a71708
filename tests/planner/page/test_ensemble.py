"""Networks of the core answer as Python's."""

from __future__ import annotations

import numpy as np

from surrogate.networks.ensemble import Ensemble, state_shapes
from tests.planner.page.page_core import answers, call, check_near, typed


def test_members_and_their_mean() -> None:
    rng = np.random.default_rng(0)
    for shape in (
        {"inputs": 7, "outputs": 6, "width": 10, "depth": 3, "members": 3},
        {"inputs": 5, "outputs": 1, "width": 4, "depth": 1, "members": 1},
    ):
        network = Ensemble.from_state(
            {name: rng.normal(size=size) for name, size in state_shapes(**shape).items()}
        )
        state = {name: {"values": typed(part.ravel())} for name, part in network.state.items()}
        x = rng.normal(size=(1, shape["inputs"]))
        prepared = call("ensemble.js", "networkOf", {"shape": shape, "state": state})
        members, mean = answers([("ensemble.js", name, prepared, x[0]) for name in ("membersAt", "evaluate")])
        check_near(members, network.members_at(x)[:, 0], 1e-13)
        check_near(mean, network.packed.evaluate(x)[0], 1e-13)
