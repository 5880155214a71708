"""Effects of hardware against an independent solver, and against what they follow from."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import quad

from sim.arrays import Floats
from sim.model.groups import Groups
from sim.motion.steady import steady
from sim.solve.assembly import assemble
from tests.oracles.harmonic_balance import settle_in_harmonics
from tests.oracles.plain_swimmer import NOMINAL, Hardware
from tests.sim.robots import control

WITHIN = 5e-4


def here(groups: Groups) -> Floats:
    motion = steady(groups)
    return np.array([motion.omega_t[0], motion.omega_yr[0], motion.v_x[0], motion.v_z[0]])


def independent(groups: Groups, hardware: Hardware = NOMINAL) -> Floats:
    coarse, fine = (settle_in_harmonics(groups, hardware, edges=edges) for edges in (8, 16))
    return np.asarray((4 * fine - coarse) / 3)


@pytest.mark.parametrize(("N", "omega_bar"), [(1, -5.0), (3, 30.0)])
def test_equal_tails_move_as_in_the_simulator(N: int, omega_bar: float) -> None:
    groups = control(N=N, omega_bar=omega_bar)
    assert here(groups) == pytest.approx(independent(groups), rel=WITHIN)


@pytest.mark.parametrize("size", [-0.1, 0.1])
def test_immersion_changes_the_head_as_far_as_it_is_wetted(size: float) -> None:
    level = math.asin(0.7) + size
    before, after = (assemble(control(immersion_by_weight=s)).resistance[..., 0] for s in (0.0, size))
    arcs = [(-math.pi - end, end) for end in (math.asin(0.7), level)]
    side, spin = ([quad(f, *arc)[0] for arc in arcs] for f in (math.sin, lambda _: 1.0))
    assert after[0, 3] / before[0, 3] == pytest.approx(side[1] / side[0])
    assert after[3, 3] / before[3, 3] == pytest.approx(spin[1] / spin[0])
    assert after[1, 1] / before[1, 1] == pytest.approx(spin[1] / spin[0])


def test_a_head_that_turns_about_its_centre_of_drag_has_no_drag() -> None:
    groups = control(head_drag_centre=0.2)
    R = assemble(groups).resistance[..., 0]
    ahead = 0.7 * (groups.L_over_R / groups.l_over_R).item()  # of J
    assert R[:, :4] @ [-ahead, 0, 1, 0] == pytest.approx(0, abs=1e-12)
