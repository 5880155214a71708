"""Friction of the contact line: constant above its speed, in proportion to the speed below it."""

from __future__ import annotations

import numpy as np
import pytest

from sim.mechanics.contact_line import CREEP, add_contact_line
from sim.motion.steady import steady
from tests.sim.robots import control, first_body


def force(speed: float, **effects: float) -> np.ndarray:
    """Compute the force on a head that surges."""
    wrench = np.zeros(4)
    add_contact_line(first_body(control(contact_line=0.5, **effects)), np.array([0.0, speed, 0.0, 0.0]), wrench)
    return wrench


@pytest.mark.parametrize("size", [0.0, 4.0])
def test_above_its_speed_it_is_constant_and_below_proportional(size: float) -> None:
    creep = CREEP * np.exp(size)
    high, higher = (force(factor * creep, contact_line_speed=size)[1] for factor in (100.0, 200.0))
    low, lower = (force(factor * creep, contact_line_speed=size)[1] for factor in (0.02, 0.01))
    assert higher == pytest.approx(high, rel=1e-3)
    assert low == pytest.approx(2 * lower, rel=1e-3)
    assert high < low < 0
    assert force(creep, contact_line_speed=size)[1] == pytest.approx(high / np.sqrt(2), rel=1e-3)


def test_at_its_null_the_speed_changes_nothing() -> None:
    plain, null = (steady(control(contact_line=0.1, **e)).v_z[0] for e in ({}, {"contact_line_speed": 0.0}))
    assert plain == null


def test_a_fast_line_is_felt_less() -> None:
    slow, fast, free = (
        steady(control(contact_line=size, contact_line_speed=speed)).v_z[0]
        for size, speed in ((0.1, 0.0), (0.1, 5.0), (0.0, 0.0))
    )
    assert slow < fast < free
