"""`softflagella.swim`: a closed loop in time steps, with another robot, in a current, seen by an askew marker."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import softflagella as sf
from planner.tracking.swim import swim_under
from tests.planner.vehicles import FINE

ROBOT = sf.load_robot("paper-control")


@pytest.mark.slow
def test_a_simulated_robot_swims_like_the_vehicle_of_its_plan() -> None:
    plan = sf.plan(sf.circle(1.0), ROBOT, objective="flips")
    simulated, moved = sf.swim(plan, camera=FINE), swim_under(sf.Tracker(plan), plan, plan.tracked.vehicle, FINE)
    assert simulated.finished
    assert simulated.rms() == pytest.approx(moved.rms(), rel=0.2)
    assert len(simulated.dwells) == pytest.approx(len(moved.dwells), abs=1)
    assert simulated.to_frame()["x_over_l"].to_numpy() == pytest.approx(simulated.poses[:, 0])


@pytest.mark.slow
def test_another_robot_with_an_askew_marker_in_a_current() -> None:
    """A tail that is a tenth shorter has other units of time and length; those of the plan are told."""
    plan = sf.plan(sf.circle(1.0), ROBOT, objective="flips")
    other = replace(ROBOT, tail_length=0.95 * ROBOT.tail_length)
    tracker = sf.Tracker(plan)
    camera = replace(FINE, marker=(0.0, 0.0, 0.3))
    result = sf.swim(tracker, other, camera, current_cm_s=(0.004, 0.0))
    assert result.finished
    assert result.rms() < 2 * plan.predicted_rms + 0.02
    assert tracker.learned["marker, angle"] == pytest.approx(0.3, abs=0.05)
    assert sf.check(plan, result.to_frame()).rms == pytest.approx(result.rms(), rel=0.05)


@pytest.mark.parametrize("wrong", [{"noise": (0.0, 0.01)}, {"every_s": 0.0}, {"delay_s": -1.0}, {"lost": 1.5},
                                   {"noise": (np.nan, 0.01)}])  # fmt: skip
def test_a_camera_that_cannot_be_is_refused(wrong: dict[str, object]) -> None:
    with pytest.raises(sf.InputError, match=f"{next(iter(wrong))} is"):
        sf.Camera(**wrong)  # type: ignore[arg-type]
