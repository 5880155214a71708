"""Effects of hardware against an independent solver, and against what they follow from."""

from __future__ import annotations

import math
from dataclasses import replace

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


@pytest.mark.parametrize(
    ("name", "size", "hardware", "within"),
    [
        ("root_compliance", 0.1, Hardware(compliance=0.1), 3e-3),
        ("stratified_viscosity", 0.05, Hardware(stratification=0.05 * 6.875), WITHIN),
    ],
)
def test_an_effect_on_the_tails_changes_the_motion_as_in_the_independent_solver(
    name: str, size: float, hardware: Hardware, within: float
) -> None:
    groups = control(N=2, omega_bar=10.0)
    changed = here(replace(groups, effects={name: np.array([size])}))
    assert changed[:3] == pytest.approx(independent(groups, hardware)[:3], rel=WITHIN)
    assert changed[3] == pytest.approx(independent(groups, hardware)[3], rel=within)
    assert np.abs(changed / here(groups) - 1).max() > 20 * WITHIN


def test_the_same_clamps_give_less_to_shorter_tails_in_their_units() -> None:
    """α/M in rad/(N m) is the same for tails of 11 and 5.5 cm; l/EI is half as large for the shorter."""
    lengths = control(2, l_over_R=[6.875, 6.875 / 2], l_over_r0=[34.375, 34.375 / 2], root_compliance=0.1)
    assert assemble(lengths).nonlocal_terms.root_compliance == pytest.approx([0.1, 0.2])


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
