"""Response to switches: against a brute-force replay, and for what it must tend to."""

from __future__ import annotations

import numpy as np
import pytest

from sim.model.schedule import Schedule
from sim.motion.replay import replay
from sim.motion.resolution import Resolution
from sim.motion.run import Run
from sim.motion.settling import steady_state
from sim.motion.steady import steady
from sim.motion.switching import steady_twist, switch_response
from sim.solve.assembly import bodies
from tests.sim.robots import CONTROL_VALUES, control


def test_net_speed_falls_with_faster_flips_as_the_tails_turn_over() -> None:
    dwell = np.array([0.5, 1.0, 2.0, 4.0])
    groups = control(4)
    response = switch_response(groups, dwell)
    surge = steady(groups).v_z[0]
    assert not response.failed.any()
    assert (np.diff(response.net_speed) > 0).all()
    assert response.net_speed[-1] < surge
    assert response.net_speed == pytest.approx([0.0133, 0.0160, 0.0169, 0.0173], rel=0.02)
    # The offset of a flip no longer changes once the tails have turned over.
    assert response.lag_z[2:] == pytest.approx(np.full(2, response.lag_z[1]), rel=0.05)


@pytest.mark.parametrize("dwell", [0.35, 1.0, 2.5])
def test_net_motion_agrees_with_a_brute_force_replay(dwell: float) -> None:
    """Many flips in the lab against lag and arc of one; shorter and longer dwells than the tails' memory."""
    count = 24
    response = switch_response(control(N=3), np.array([dwell]))
    schedule = Schedule({**CONTROL_VALUES, "N": 3.0}, 1, np.full(count, dwell), (0.0, 0.0, 0.0), 1.0)
    track = replay([schedule])[0]
    flips = track.groupby("dwell").last()[["x_over_l", "y_over_l"]].to_numpy()
    moved = np.linalg.norm(flips[-1] - flips[3]) / (dwell * (count - 4))
    assert moved == pytest.approx(float(response.net_speed[0]), rel=8e-3)


@pytest.mark.parametrize("dwell", [0.35, 1.0])
def test_a_flip_leaves_little_error_of_the_step(dwell: float) -> None:
    """Every mode of the tails starts anew at a flip; equal steps were 1.6 and 0.5 % off."""
    default, fine = (
        switch_response(control(N=4), np.array([dwell]), resolution=Resolution(16, steps)).net_speed[0]
        for steps in (24, 24 * 16)
    )
    assert default == pytest.approx(fine, rel=4e-3)


@pytest.mark.slow
def test_the_steady_circle_is_a_mean_over_whole_turns_where_the_spin_changes() -> None:
    """Near a free surface the spin changes within a turn; before, successive means differed by 3 %."""
    body, mesh = bodies(control(free_surface=1.0))[0], Resolution(8, 24)
    run = Run(body, 2, mesh, steady_state(body, 2, mesh), most_work=np.inf)
    first, spacing = steady_twist(run, 2, 1.0)
    for _ in range(2):
        run.go(0.3 * spacing)
        again, _ = steady_twist(run, 2, 1.0)
        assert again == pytest.approx(first, rel=4e-3)
