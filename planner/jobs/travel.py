"""How this vehicle travels between poses that a job has chosen: time, track, and the plan of the whole track.

Tracks are Dubins' words of the pivot. In a turn the motor rarely flips, so the pivot moves nearly at its own
speed; on a straight line the robot zigzags and loses speed with every flip. Among obstacles the quickest of the
first WORDS words that is free counts; where none is free, a way around is assumed to take DETOUR turn radii more.
Poses whose body is not free are not reached. Times in μ0 l⁴/EI, lengths in l.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from common.arrays import Floats, Integers
from planner.goal.route import RouteLimits
from planner.jobs.detours import Around
from planner.paths.dubins import TURNS, DubinsPaths, segment_lengths
from planner.paths.obstacles import FreeSpace
from planner.paths.path import Path2D, axis_at
from planner.paths.tractrix import Drift, Reference
from planner.paths.units import check_size
from planner.planning.declare import AS_DRAWN, FeasiblePath
from planner.planning.plan import Plan
from planner.planning.request import PlanRequest
from planner.planning.solve import PathTask, Trial, solve
from planner.progress import ORDERING, ProgressCallback, tell
from planner.vehicle.tracked_point import TrackedVehicle
from planner.vehicle.zigzag import dwells_for

WORDS = 3  # tried among obstacles
DETOUR = 6.0  # turn radii that a blocked track counts longer
_BLOCK, _BLOCK_BESIDE = 50_000, 500  # pairs of poses at once, without obstacles and with some
_STEP = 0.15  # l, between the places where a track is checked
SLACK = 0.02  # l, by which clearances between these places may be smaller
_SPACING = 0.02  # l, of the reference's points


@dataclass(frozen=True)
class Travel:
    """The pivot's turns, its speeds, and what its tracks must keep clear of."""

    tracked: TrackedVehicle  # who travels
    limits: RouteLimits  # its turn radius is wider than the narrowest one, as for a path that is followed as drawn
    margin: float  # around the body
    straight: float  # speed on straight lines
    turning: float  # speed in turns

    @staticmethod
    def of(trial: Trial, space: FreeSpace, margin: float) -> Travel:
        """Take the vehicle's radius and speeds."""
        tracked, straight = trial.tracked, trial.straight.net_speed
        own = float(np.abs(tracked.vehicle.twist[:, 0]).mean())
        limits = RouteLimits(tracked.vehicle.pivot_radius / AS_DRAWN, tracked.body, space, trial.drift)
        return Travel(tracked, limits, margin, straight, straight + AS_DRAWN * (own - straight))

    def drifting(self, drift: Drift) -> Travel:
        """Travel with another drift."""
        return replace(self, limits=replace(self.limits, drift=drift))

    def poses(self, places: Floats, courses: Floats) -> Floats:
        """Return the pivot's poses (..., 3), place and course, where the tracked point is at places (..., 2)."""
        axis = axis_at(courses - self.limits.drift.slip_along(courses))
        return np.concatenate([places - self.tracked.rod * axis, courses[..., None]], -1)

    @property
    def radius(self) -> float:
        return self.limits.radius

    def times(self, start: Floats, goal: Floats, progress: ProgressCallback | None = None) -> Floats:
        """Compute the shortest times (M,) between M pairs of poses (M, 3): places and courses of the pivot."""
        times, margin = (
            [],
            self.margin + SLACK,
        )  # so that tracks which are chosen for their times are free for sure
        block = _BLOCK if self.limits.space.empty else _BLOCK_BESIDE
        for first in range(0, len(start), block):
            tell(progress, ORDERING, first / len(start))
            times.append(self._best(start[first : first + block], goal[first : first + block], margin)[1])
        return np.concatenate(times)

    def tracks(self, start: Floats, goal: Floats) -> DubinsPaths:
        """Find the quickest tracks between M pairs of poses."""
        return self._best(start, goal, self.margin)[0]

    def _best(self, start: Floats, goal: Floats, margin: float) -> tuple[DubinsPaths, Floats]:
        lengths = segment_lengths(start, goal, self.radius)
        times = (lengths / self._speed(TURNS)).sum(-1)
        order = times.argsort(-1)
        rows = np.arange(len(start))
        word = order[:, 0].copy()
        time = times[rows, word]
        if not self.limits.space.empty:
            blocked = rows
            for k in range(WORDS):
                tried = order[blocked, k]
                tracks = DubinsPaths(start[blocked], TURNS[tried], lengths[blocked, tried], self.radius)
                exists = np.isfinite(times[blocked, tried])
                free = np.zeros(len(blocked), dtype=bool)
                free[exists] = self.limits.free(tracks.take(np.flatnonzero(exists)), margin, step=_STEP)
                word[blocked[free]] = tried[free]
                time[blocked[free]] = times[blocked[free], tried[free]]
                blocked = blocked[~free]
            time[blocked] = times[blocked, order[blocked, 0]] + DETOUR * self.radius / self.straight
            unreached = (self.limits.clearance(goal) < margin) | (self.limits.clearance(start) < margin)
            time[unreached] = np.inf
        return DubinsPaths(start, TURNS[word], lengths[rows, word], self.radius), time

    def _speed(self, turns: Integers) -> Floats:
        return np.where(turns == 0, self.straight, self.turning)


def preferred_trial(tracked: TrackedVehicle, request: PlanRequest) -> Trial:
    """Return the vehicle with the dwell that the objective prefers."""
    least = request.least_dwell(tracked.robot)
    return Trial.of(tracked, request.dwell or dwells_for(tracked.vehicle, request.objective, least)[0])


def plan_track(
    track: Callable[[Drift], DubinsPaths],
    preferred: Trial,
    request: PlanRequest,
    progress: ProgressCallback | None,
) -> Plan[None]:
    """Plan for the pivot's track that a job gives for a drift.

    Raises:
        InputError: the track is too long, or there is no way around an obstacle.
    """
    tracked, space = preferred.tracked, request.space

    def source(trial: Trial) -> FeasiblePath:
        reference = Reference.of_pivot(track(trial.drift).chain(_SPACING), tracked.rod, trial.drift)
        return FeasiblePath(reference, float(np.abs(reference.curvature).max()))

    drawn = Path2D(source(preferred).reference.p, False)
    check_size(drawn, tracked.robot, tracked.vehicle.turn_radius, tracked.vehicle.speed)
    avoid = None if space.empty else Around(space, drawn)
    return solve(PathTask(source=source, avoid=avoid, drawn=drawn), tracked, request, progress)
