"""Torque of a tail whose head is held: against an exact filament and linear theory."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sim.mechanics.drag import tail_coefficients
from sim.model.presets import PRESETS
from sim.reference.linear_theory import linear_filament
from tests.oracles.held_head import held_torque, linear_torque

ROBOT = PRESETS["paper-control"]  # l = 11 cm, a = R = 16 mm


def test_the_torque_is_that_of_the_exact_filament() -> None:
    """Of a boundary-value solver, for motor speeds of 2, 4, 8, 12 and 16 rad/s."""
    groups = ROBOT.groups()
    speed = np.array([2.0, 4.0, 8.0, 12.0, 16.0]) * ROBOT.time_scale
    S = speed * tail_coefficients(groups.l_over_r0)[1]
    exact = np.array([1.732e-4, 2.571e-4, 4.32812e-4, 6.183e-4, 8.036e-4])  # N m
    torque = held_torque(groups, S) * ROBOT.bending_stiffness / ROBOT.tail_length
    assert torque == pytest.approx(exact, rel=2e-3)


def test_close_to_the_axis_the_torque_is_that_of_linear_theory() -> None:
    offset = 0.01
    groups = replace(ROBOT.groups(), a_over_R=np.array([offset * ROBOT.tail_length / ROBOT.head_radius]))
    S = np.array([1.0, 10.0, 40.0])
    assert held_torque(groups, S) == pytest.approx([linear_torque(s, offset, 0.0) for s in S], rel=0.01)
    assert [linear_torque(s, 1.0, 0.0) / s for s in S] == pytest.approx(
        [linear_filament(s)[1] for s in S], rel=1e-3
    )


def test_a_slowly_turning_tilted_rod_is_rigid() -> None:
    """∫ (a + θ s)² ds."""
    assert linear_torque(1e-3, 0.3, 0.5) / 1e-3 == pytest.approx(0.09 + 0.15 + 0.25 / 3, rel=1e-4)
