"""The errors of a plan: distances of the predicted track from declared and drawn path, and the stated error."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from planner.paths.distance import distance_to
from planner.paths.path import Path2D
from planner.planning.declared_path import Declared
from planner.planning.error_growth import ErrorGrowth, error_growth
from planner.planning.stated_error import flips_between, predicted_error, rms_in_time, stated_error
from planner.vehicle.rollout import Switches, roll_out
from planner.vehicle.tracked_point import TrackedVehicle
from planner.vehicle.vehicle import Vehicle
from sim.arrays import Floats


@dataclass(frozen=True)
class PlanErrors:
    """The predicted track, its distances from the two paths, and what is stated for uncertain robots [l]."""

    track: Floats  # (S, 2): predicted tracked point, several samples a dwell
    distance: Floats  # (S,), of the track from the declared path
    dwells: Floats  # (M,)
    declared: Floats  # (m, 2), the declared path
    drawn: Path2D  # the path as drawn
    stated: float  # holds for 95 % of the robots that the model's uncertainty allows, open loop
    guaranteed: float | None  # bound for a robot without errors, however long the path; None: not known
    closure: float | None  # from the end of the track to the beginning of a closed path
    table_share: float = 1.0  # of the look-up table in the variance of the deviations

    @property
    def predicted_rms(self) -> float:
        """Distance of the track from the declared path, root mean square over time."""
        return rms_in_time(self.distance, self.dwells)

    @property
    def predicted_max(self) -> float:
        """Largest distance of the track from the declared path."""
        return float(self.distance.max())

    @property
    def drawn_rms(self) -> float:
        """Distance of the track from the path as drawn, root mean square over time."""
        return rms_in_time(self._from_drawn, self.dwells)

    @property
    def drawn_max(self) -> float:
        """Largest distance of the track from the path as drawn."""
        return float(self._from_drawn.max())

    @cached_property  # a plan that is only compared with others does not need it
    def _from_drawn(self) -> Floats:
        path = self.drawn.polyline()
        same = np.array_equal(path, self.declared)
        return self.distance if same else distance_to(path, self.track)


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
    path, count = declared.reference.p, len(switches.dwells)
    rollout = roll_out(tracked.vehicle, switches, tracked.offset)
    predicted = predicted_error(path, rollout.track, closed=drawn.closed)
    growth = error_growth(tracked.vehicle, switches, rollout, flips_between(count))
    return PlanErrors(
        track=rollout.track,
        distance=predicted.distance,
        dwells=switches.dwells,
        declared=path,
        drawn=drawn,
        stated=stated_error(growth, predicted, seed=seed),
        guaranteed=guaranteed,
        closure=float(np.linalg.norm(rollout.track[-1] - path[0])) if drawn.closed else None,
        table_share=_table_share(tracked.vehicle, growth),
    )


def _table_share(vehicle: Vehicle, growth: ErrorGrowth) -> float:
    """Return the share of the look-up table's modes in the squared deviations along a schedule."""
    squares = (growth.deviation**2).sum((0, 2))
    of_table = sum(float(squares[p]) for p, mode in enumerate(vehicle.modes) if mode.name.startswith("table: "))
    return of_table / max(float(squares.sum()), 1e-300)
