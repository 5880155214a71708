"""Simulate a robot under a tracker's orders: `softflagella.swim`."""

from __future__ import annotations

from planner.planning.camera import Camera
from planner.planning.planned import Plan
from planner.tracking.swim import Swim
from planner.tracking.swim import swim as swim_under
from planner.tracking.tracker import Tracker
from sim.io.keywords import checks_keywords
from sim.robot_rows import OneRobot, one_robot


@checks_keywords()
def swim(
    pilot: Plan | Tracker,
    truth: OneRobot | None = None,
    camera: Camera | None = None,
    *,
    current_cm_s: tuple[float, float] = (0.0, 0.0),
    longest: float = 3.0,
) -> Swim:
    """Simulate a robot under a tracker's orders, seen by a camera: a closed loop.

    Args:
        pilot: a tracker that has not begun, or a plan, which gets a tracker that knows the camera's noise.
        truth: the robot that swims; default: the one that the plan was made for.
        camera: what sees it; default: that of the plan.
        current_cm_s: of the fluid, in x and y [cm/s], which the tracker does not know.
        longest: times the planned duration after which the swim ends in any case.

    Returns:
        Times, poses, distances from the declared path, the tracker's bounds on them, and dwells as ordered.

    Raises:
        InputError: the robot cannot be simulated.

    Example:
        >>> import softflagella as sf
        >>> result = sf.plan(sf.circle(1.2), "paper-control", objective="flips")
        >>> track = sf.swim(result, camera=sf.Camera(delay_s=0.5))
        >>> track.finished, track.rms() < 0.1
        (True, True)
    """
    plan = pilot.plan if isinstance(pilot, Tracker) else pilot
    camera = camera or plan.request.camera
    tracker = pilot if isinstance(pilot, Tracker) else Tracker(plan, noise=camera.noise)
    unit = plan.robot.time_scale / (100 * plan.robot.tail_length)
    return swim_under(
        tracker,
        plan,
        plan.robot if truth is None else one_robot(truth),
        camera,
        start=tracker.start,
        current=(unit * current_cm_s[0], unit * current_cm_s[1]),
        longest=longest,
    )
