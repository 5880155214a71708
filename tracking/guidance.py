"""The tracker's guidance: line of sight about a reference that changes, and a way back to it.

The reference of a plan holds the drift that the plan knows (`planner.paths.tractrix`). A robot that drifts
otherwise has another heading where its tracked point is on the path. The difference ε of the headings obeys, in
first order along the pivot's way σ,

    dε/dσ = −(ε + r)/a,   r = slip of the learned drift − slip of the plan's drift + κ (a′ − a),

with a the distance from the pivot to the tracked point, a′ the learned one, and κ the reference's curvature: on a
straight line ε goes to −r, on a curve it lags behind. The reference is turned by ε about the tracked point.

A robot that is farther from its reference than a limit, or turned away from the wanted heading by more than AWAY,
gets a way back: a shortest Dubins track of the pivot from where it is to a pose of the remaining path. The cost of
a target is the length of the track, and LEFT_OUT times the length of the path that is left out before it. Targets
are tried at equal strides along the path, then one by one about the best. The pivot follows the way by line of
sight. Where it ends the robot is on the reference again. Lengths in l.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from common.arrays import Floats, Integers
from planner.paths.dubins import TURNS, DubinsPaths, segment_lengths
from planner.paths.tractrix import Drift
from planner.planning.conditions import OVERLAP
from planner.planning.line_of_sight import LineOfSight, look_ahead
from planner.planning.plan import Plan
from planner.planning.request import POSE

SHORTEST_ROD = 1e-9  # l
AWAY = 1.0  # rad
STRAIGHT = 1e-6  # l; shorter arcs do not decide to which side the robot turns first
_NEAR = 0.5  # of the pivot's turn radius: the distance within which the guidance steers back to its reference
_ERRORS = 4.0  # or of the largest predicted error
LEFT_OUT = 0.1  # of a length of the path: what it costs to leave it out
MOST_LEFT_OUT = 0.1  # of a lap of a closed path, whose end is near its beginning: what all ways may leave out
STRIDE = 0.5  # between two targets, in radii
ROOM = 0.95  # the share of its largest curvature that the robot uses on the way
SEGMENTS = 3


class TrackerGuidance(LineOfSight):
    """Line of sight about the plan's reference, turned by the learned drift, or about a way back to it."""

    def __init__(self, plan: Plan):
        tracked, straight = plan.tracked, plan.straight
        reference, overlap = plan.declared.reference, OVERLAP * tracked.vehicle.pivot_radius
        followed = reference if plan.lap is None else reference.laps(1, overlap)  # on into the next lap
        super().__init__(followed, tracked.vehicle, plan.guidance, tracked.offset)
        self._lap = 0 if plan.lap is None else len(reference.q) - 1  # its points; 0: the path is followed once
        self._lap_turn = reference.turn
        self._around, self._stopping = self._lap > 0, False
        x, y = (tracked.vehicle.current / straight.speed).tolist()
        self._planned = self._drift = Drift(straight.drift / straight.speed, (x, y))
        self._turns = 0.0  # whole turns by which headings differ from those of the reference
        self._pivot_distance = tracked.vehicle.pivot_distance
        self._pivot_radius = tracked.vehicle.pivot_radius
        self._swing = plan.guidance.swing
        self._way_ahead = float(look_ahead(tracked.vehicle, 0.0, straight))
        self._limit = max(_NEAR * self._pivot_radius, _ERRORS * plan.predicted_max)
        self._stride = stride(plan)
        lap = float(reference.arc[-1])
        self._may_leave_out = self._may_leave_out_of_lap = MOST_LEFT_OUT * lap if plan.drawn.closed else math.inf
        self._way: WayBack | None = None
        self._leg, self._along = SEGMENTS, 0.0  # of the way; the path follows its last segment

    def update_drift(self, drift: Drift) -> None:
        """Update the drift with what was learned."""
        self._drift = drift

    def integrate(self, pose: POSE, sense: int) -> None:
        """Add to the integral, and turn the reference as the drift asks after the way since the last flip."""
        before = self._reached
        if self._way is not None:
            self._excess(pose, sense)
            if self._leg < SEGMENTS:
                return
            self._way = None
            before = self._reached = self._arc[self.place]
            self._last_error = 0.0
        super().integrate(pose, sense)
        way = max(self._reached - before, 0.0) / max(self._rod, SHORTEST_ROD)
        heading, lean = self._heading[self.place], self._lean - self._turns
        slip = float(self._drift.slip_at(heading + lean) - self._planned.slip_at(heading))
        (_, a, b), (_, c, d) = self._twist
        longer = (abs(a) + abs(c)) / (abs(b) + abs(d)) - self._pivot_distance
        slip += longer * self._bend()[0]
        self._lean = (lean + slip) / (1 + way + way * way / 2) - slip + self._turns
        self._go_around()

    def finish_lap(self) -> None:
        """End the path at the end of this lap."""
        self._stopping = self._lap > 0
        self._go_around()

    def _go_around(self) -> None:
        """Begin the next lap at the end of one."""
        if self._around and self._way is None and self.place >= self._lap:
            self.place -= self._lap
            self._reached -= self._arc[self._lap]
            self._lean += self._lap_turn
            self._turns += self._lap_turn
            self._may_leave_out = self._may_leave_out_of_lap
        if self._stopping and self._way is None and self.place < self._lap:
            self._around, self._last = False, self._lap - 1

    def where(self) -> tuple[int, float, int, float]:
        """Return the place on path and way, which `go_to` takes."""
        return self.place, self.share, self._leg, self._along

    def go_to(self, where: tuple[int, float, int, float]) -> None:
        self.place, self.share, self._leg, self._along = where

    def is_off(self, pose: POSE) -> bool:
        """Tell whether a pose is too far from path or way for the line of sight."""
        deviation = self._excess(pose, 1)
        if self._leg < SEGMENTS:
            return abs(self._error) > self._limit or abs(deviation + self._way_hysteresis()) > AWAY
        i, share = self.place, self.share
        _, step = self._bend()
        beyond = step * max(share - 1, -share, 0.0)
        off = self._error * self._error + beyond * beyond > self._limit * self._limit
        return off or abs(deviation + self._hysteresis[i]) > AWAY

    def distance(self, pose: POSE) -> tuple[float, float]:
        """Compute the distance of the tracked point from the path, and the direction [rad] in which it is.

        On the way back it is the distance from the place where the way ends.
        """
        value = self._excess(pose, 1)
        i, rod = self.place, self._rod
        if self._leg < SEGMENTS:
            heading = self._heading[i]
            x = pose[0] + self._offset * math.cos(pose[2]) - self._x[i] - rod * math.cos(heading)
            y = pose[1] + self._offset * math.sin(pose[2]) - self._y[i] - rod * math.sin(heading)
            return math.sqrt(x * x + y * y), math.atan2(y, x)
        turn, step = self._bend()
        turned = value + self._hysteresis[i] - math.atan(self._error / self._ahead) - self._bias
        slip = float(self._planned.slip_at(self._heading[i]))
        tangent = math.atan2(math.sin(slip) + rod * turn, math.cos(slip))  # from the heading, where all is well
        ahead = rod * (math.cos(turned) - 1)
        aside = self._error + rod * math.sin(turned)
        across = math.cos(tangent) * aside - math.sin(tangent) * ahead
        beyond = step * max(self.share - 1, -self.share, 0.0)
        normal = pose[2] - turned + tangent + math.pi / 2
        return math.copysign(math.sqrt(across * across + beyond * beyond), across), normal

    def plan_way(self, pose: POSE) -> None:
        """Plan the way back from a pose to the path that remains after the place."""
        place = self._way.target if self._way is not None else self.place
        drift, planned, rod = self._drift, self._planned, self._rod
        rows = slice(place, self._last + 2)
        heading = np.array(self._heading[rows])
        known = planned.slip_at(heading)
        course, lean = heading + known, known - drift.slip_at(heading)
        x = np.array(self._x[rows]) + rod * (np.cos(heading) - np.cos(heading + lean))
        y = np.array(self._y[rows]) + rod * (np.sin(heading) - np.sin(heading + lean))
        left_out = np.array(self._arc[rows]) - self._arc[place]
        allowed = left_out <= max(self._may_leave_out, 0.0)
        left_out = left_out[allowed]
        start = self._pivot(pose)
        targets, radius = np.stack([x, y, course], 1)[allowed], self._radius()
        track, target = shortest_way(start, targets, left_out, self._stride, radius)
        self._may_leave_out -= float(left_out[target])
        at = min(place + target, self._last)
        self._way = WayBack.of(track, at)
        turns = round((self._way.course - course[target]) / (2 * math.pi))
        self._leg, self._along = 0, 0.0
        self.place, self.share = at, 0.0
        self._turns = 2 * math.pi * turns
        self._lean = float(lean[target]) + self._turns

    @property
    def first_turn(self) -> int:
        """Side to which the way turns first: +1, −1, or 0 for a straight way."""
        if self._way is not None:
            for segment in self._way.segments:
                if segment.curvature != 0 and segment.length > STRAIGHT:
                    return 1 if segment.curvature > 0 else -1
        return 0

    @property
    def ended(self) -> bool:
        return not self._around and self._leg >= SEGMENTS and self.place >= self._last and self.share >= 1

    def _bend(self) -> tuple[float, float]:
        """Return the curvature of the reference at the place, and the length of its step."""
        i = self.place
        dx, dy = self._x[i + 1] - self._x[i], self._y[i + 1] - self._y[i]
        step = math.sqrt(dx * dx + dy * dy)
        return (self._heading[i + 1] - self._heading[i]) / max(step, SHORTEST_ROD), step

    def _radius(self) -> float:
        """Return the radius of arcs on the way, for the learned robot in the learned current."""
        tightest = max(abs(forward / rate) for forward, _, rate in self._twist)
        return tightest * (1 + math.hypot(*self._drift.current)) / ROOM

    def _pivot(self, pose: POSE) -> POSE:
        """Return place and course of the pivot."""
        x, y, heading = pose
        a = self._pivot_distance
        return x - a * math.cos(heading), y - a * math.sin(heading), heading + float(self._drift.slip_at(heading))

    def _way_hysteresis(self) -> float:
        assert self._way is not None
        bend = min(abs(self._way.segments[self._leg].curvature) * self._pivot_radius, 1.0)
        return self._swing * (1 + bend) / 2

    def _excess(self, pose: POSE, sense: int) -> float:
        """Compute σ(φ − φ_d) − h about the way, or after it about the path."""
        way, moved = self._way, 0
        if way is None:
            return super()._excess(pose, sense)
        if self._leg == SEGMENTS:
            value = super()._excess(pose, sense)
            if self.place > way.target or (self.place == way.target and self.share >= 0):
                return value
            self._leg, self._along, moved = SEGMENTS - 1, way.segments[-1].length, -1
        self.place = way.target
        x, y, course = self._pivot(pose)
        while True:
            segment = way.segments[self._leg]
            along, error = segment.project(x, y, self._along)
            if along > segment.length and moved >= 0:
                self._leg, self._along, moved = self._leg + 1, 0.0, 1
                if self._leg == SEGMENTS:
                    return super()._excess(pose, sense)
            elif along < 0 and self._leg > 0 and moved <= 0:
                self._leg, self._along, moved = self._leg - 1, way.segments[self._leg - 1].length, -1
            else:
                break
        self._along, self._error = along, error
        wanted = segment.course + segment.curvature * along - math.atan(error / self._way_ahead)
        return sense * (course - wanted) - self._way_hysteresis()


def stride(plan: Plan) -> int:
    """Return the points of the reference from one target of a way back to the next."""
    arc = plan.declared.reference.arc
    spacing = float(arc[-1]) / (len(arc) - 1)
    return max(round(STRIDE * plan.tracked.vehicle.pivot_radius / max(spacing, 1e-9)), 1)


class Segment(NamedTuple):
    """An arc or a straight line: where it starts, its curvature and its length."""

    x: float
    y: float
    course: float
    curvature: float
    length: float

    def project(self, x: float, y: float, near: float) -> tuple[float, float]:
        """Return the progress along the segment, and the distance to its left; on an arc, nearest to `near`."""
        if self.curvature == 0:
            c, s = math.cos(self.course), math.sin(self.course)
            ahead, aside = x - self.x, y - self.y
            return c * ahead + s * aside, c * aside - s * ahead
        side = 1.0 if self.curvature > 0 else -1.0
        ahead = x - (self.x - math.sin(self.course) / self.curvature)
        aside = y - (self.y + math.cos(self.course) / self.curvature)
        turned = math.atan2(aside, ahead) + side * math.pi / 2 - self.course - self.curvature * near
        turned -= 2 * math.pi * math.floor((turned + math.pi) / (2 * math.pi))
        error = 1 / self.curvature - side * math.sqrt(ahead * ahead + aside * aside)
        return near + turned / self.curvature, error


class WayBack(NamedTuple):
    """A track of three segments, and the step of the path at which it ends."""

    segments: list[Segment]
    target: int

    @staticmethod
    def of(track: DubinsPaths, target: int) -> WayBack:
        """Make a way of a single track."""
        lengths, curvatures = track.lengths[0], track.turns[0] / track.radius
        starts = track.poses((np.cumsum(lengths) - lengths)[None])[0]
        rows = np.column_stack([starts, curvatures, lengths]).tolist()
        return WayBack([Segment(*row) for row in rows], target)

    @property
    def course(self) -> float:
        """The course at the end."""
        last = self.segments[-1]
        return last.course + last.curvature * last.length


def shortest_way(
    start: tuple[float, float, float], targets: Floats, left_out: Floats, stride: int, radius: float
) -> tuple[DubinsPaths, int]:
    """Find the cheapest way, a single track, and the target where it ends.

    Args:
        start: place and course of the pivot.
        targets: its poses (m, 3) on the remaining path.
        left_out: length (m,) of the path before each.
        stride: targets between two that are tried first.
        radius: of the arcs.
    """

    def best(rows: Integers) -> tuple[int, Floats, int]:
        lengths = segment_lengths(np.array(start), targets[rows], radius)
        total = lengths.sum(-1)
        word = total.argmin(-1)
        row = int((total.min(-1) + LEFT_OUT * left_out[rows]).argmin())
        return int(rows[row]), lengths[row, word[row]], int(word[row])

    coarse = best(np.arange(0, len(targets), stride))[0]
    target, lengths, word = best(np.arange(max(coarse - stride + 1, 0), min(coarse + stride, len(targets))))
    return DubinsPaths(np.array([start]), TURNS[word : word + 1], lengths[None], radius), target
