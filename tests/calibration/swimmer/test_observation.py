"""What a camera sees in a current, against the sum of two velocities."""

from __future__ import annotations

import numpy as np
import pytest

from calibration.swimmer.observation import Observation


@pytest.mark.parametrize("side", [1, -1])
def test_speed_and_slip_angle_are_those_of_the_sum_of_both_velocities(side: int) -> None:
    """A robot that turns to the left (1) or right, with all headings, in a current of a third of its speed."""
    surge, sway, heading, current = 0.6, 1.1, np.linspace(0, 2 * np.pi, 25), 0.3 - 0.2j
    seen = (surge + 1j * side * sway) * np.exp(1j * heading) + current
    path = seen / np.abs(seen)
    along, left = (current * path.conj()).real, (current * path.conj()).imag
    one, zero = np.ones((1, 1)), np.zeros((1, 1))
    view = Observation(("theta", "v"), one, one, one, zero, along[None], side * left[None], one, zero)
    motion = {name: size * one for name, size in (("omega_h_bar", 1), ("omega_t_bar", 1), ("omega_yr_bar", 1e-9))}
    motion |= {"v_z": surge * one, "v_x": sway * one}
    theta, speed = np.moveaxis(view.see(motion), -1, 0)
    assert np.exp(speed[0]) == pytest.approx(np.abs(seen))
    assert theta[0] == pytest.approx(side * np.angle(path * np.exp(-1j * heading)))
