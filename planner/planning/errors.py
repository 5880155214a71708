"""The errors of a plan: distances of the predicted track from declared and drawn path, and the stated error."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from planner.paths.distance import distance_to
from planner.paths.path import Path2D
from planner.planning.declared_path import Declared
from planner.planning.stated_error import predicted_error, rms_in_time, stated_error
from planner.vehicle.rollout import Switches, trace
from planner.vehicle.tracked_point import TrackedVehicle
from sim.arrays import Floats

FEEDBACK_EVERY = 20  # flips


@dataclass(frozen=True)
class PlanErrors:
    """The predicted track, its distances from the two paths, and what is stated for uncertain robots [l]."""

    track: Floats  # (S, 2): predicted tracked point, several samples a dwell
    predicted_rms: float  # from the declared path, over time
    predicted_max: float  # largest distance from the declared path
    drawn_rms: float  # from the path as drawn
    drawn_max: float  # largest distance from the path as drawn
    stated: float  # holds for 95 % of the robots that the model's uncertainty allows, open loop
    feedback: float  # the same where the pose is measured, and the rest planned again, every 20 flips
    guaranteed: float | None  # bound for a robot without errors, however long the path; None: not known
    closure: float | None  # from the end of the track to the beginning of a closed path


def plan_errors(
    tracked: TrackedVehicle,
    drawn: Path2D,
    declared: Declared,
    switches: Switches,
    *,
    guaranteed: float | None,
    seed: int,
) -> PlanErrors:
    """Compute the errors of a schedule.

    Args:
        tracked: the vehicle and its tracked point.
        drawn: the path as drawn.
        declared: the path that the vehicle follows.
        switches: the schedule.
        guaranteed: bound on the error without uncertainty, if there is one.
        seed: of the random robots.
    """
    vehicle = tracked.vehicle
    track = trace(vehicle, switches, tracked.offset)
    predicted = predicted_error(declared.reference.p, track, closed=drawn.closed)
    from_drawn = distance_to(drawn.polyline(), track)
    return PlanErrors(
        track=track,
        predicted_rms=rms_in_time(predicted.distance, switches.dwells),
        predicted_max=predicted.largest,
        drawn_rms=rms_in_time(from_drawn, switches.dwells),
        drawn_max=float(from_drawn.max()),
        stated=stated_error(vehicle, switches, track, predicted, seed=seed),
        feedback=stated_error(vehicle, switches, track, predicted, every=FEEDBACK_EVERY, seed=seed),
        guaranteed=guaranteed,
        closure=float(np.linalg.norm(track[-1] - declared.reference.p[0])) if drawn.closed else None,
    )
