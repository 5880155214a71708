"""What the last dwell but one changes: against flips that go on until the motion repeats, and where it fades."""

from __future__ import annotations

import numpy as np
import pytest

from sim.model.response import BEFORE, DWELLS
from sim.motion.longer_memory import longer_memory
from sim.motion.net_speed import net_speeds, twists
from sim.motion.resolution import Resolution
from sim.motion.response import responses
from sim.motion.steady import steady
from sim.motion.switching import switch_response
from tests.sim.robots import control


def test_with_it_the_net_speed_of_short_dwells_is_that_of_flips_that_go_on() -> None:
    """At dwells of 0.3 and 0.4 it explains most of what the curves, which know one dwell before, leave."""
    few = np.array([3, 5])
    groups = control(omega_bar=12.0, N=4.0)
    both = control(2, omega_bar=12.0, N=4.0)
    stepped = switch_response(both, DWELLS[few], resolution=Resolution(24, 72)).net_speed
    motion, curves = steady(groups), responses(groups)
    twist = twists(motion.v_z, motion.v_x, motion.omega_yr, np.ones(1))
    longer = curves.memory + longer_memory(groups)
    off = [abs(net_speeds(twist, curves.lag, memory)[0, few] - stepped) for memory in (curves.memory, longer)]
    assert (off[1] < 0.4 * off[0]).all()


@pytest.mark.parametrize("changes", [{}, {"left_right_bias": 0.2}])
def test_it_fades(changes: dict[str, float]) -> None:
    found = np.abs(longer_memory(control(omega_bar=20.0, **changes))[0]).max((1, 2))
    assert found[BEFORE > 1.0].max() < 0.02 * found[0]


def test_a_reversed_motor_gives_the_same() -> None:
    there, back = (longer_memory(control(omega_bar=w, end_over_end_drag=3.0)) for w in (12.0, -12.0))
    assert there == pytest.approx(back, abs=1e-6)
