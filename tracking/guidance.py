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

import numpy as np

from common.arrays import Floats, Integers
from planner.guidance.law import NO_WAY, SEGMENTS, Segment, excess
from planner.guidance.line_of_sight import LineOfSight, look_ahead
from planner.paths.dubins import TURNS, DubinsPaths, segment_lengths
from planner.paths.tractrix import Drift
from planner.planning.conditions import OVERLAP
from planner.planning.plan import Plan
from sim.mechanics.planar import POSE

SHORTEST_ROD = 1e-9  # l
AWAY = 1.0  # rad
STRAIGHT = 1e-6  # l; shorter arcs do not decide to which side the robot turns first
_NEAR = 0.5  # of the pivot's turn radius: the distance within which the guidance steers back to its reference
_ERRORS = 4.0  # or of the largest predicted error
LEFT_OUT = 0.1  # of a length of the path: what it costs to leave it out
MOST_LEFT_OUT = 0.1  # of a lap of a closed path, whose end is near its beginning: what all ways may leave out
STRIDE = 0.5  # between two targets, in radii
ROOM = 0.95  # the share of its largest curvature that the robot uses on the way


class TrackerGuidance(LineOfSight):
    """Line of sight about the plan's reference, turned by the learned drift, or about a way back to it."""

    def __init__(self, plan: Plan):
        tracked, straight = plan.tracked, plan.straight
        reference, overlap = plan.declared.reference, OVERLAP * tracked.vehicle.pivot_radius
        followed = reference if plan.lap is None else reference.laps(1, overlap)  # on into the next lap
        super().__init__(followed, tracked.vehicle, plan.guidance, tracked.offset)
        self._lap = 0 if plan.lap is None else len(reference.q) - 1  # its points; 0: the path is followed once
        self._lap_turn = reference.turn
        self._stopping = False
        x, y = (tracked.vehicle.current / straight.speed).tolist()
        self._planned = Drift(straight.drift / straight.speed, (x, y))
        self.update_drift(self._planned)  # until another is learned
        self._turns = 0.0  # whole turns by which headings differ from those of the reference
        self._pivot_distance = tracked.vehicle.pivot_distance
        self._pivot_radius = tracked.vehicle.pivot_radius
        self._swing = plan.guidance.swing
        way_ahead = float(look_ahead(tracked.vehicle, 0.0, straight))
        self._law = self._law._replace(around=self._lap > 0, way_ahead=way_ahead)
        self._limit = max(_NEAR * self._pivot_radius, _ERRORS * plan.predicted_max)
        self._stride = stride(plan)
        lap = float(reference.arc[-1])
        self._may_leave_out = self._may_leave_out_of_lap = MOST_LEFT_OUT * lap if plan.drawn.closed else math.inf

    def update_drift(self, drift: Drift) -> None:
        """Update the drift with what was learned."""
        self._drift = drift
        self._law = self._law._replace(drift=(drift.sideways, *drift.current))

    def integrate(self, pose: POSE, sense: int) -> None:
        """Add to the integral, and turn the reference as the drift asks after the way since the last flip."""
        before = self.state.reached
        if self._law.target != NO_WAY:
            self._excess(pose, sense)
            if self.state.leg < SEGMENTS:
                return
            before = self._law.arc[self.state.step]
            self._law = self._law._replace(target=NO_WAY)
            self.state = self.state._replace(reached=before, last_error=0.0)
        super().integrate(pose, sense)
        law, state = self._law, self.state
        way = max(state.reached - before, 0.0) / max(law.rod, SHORTEST_ROD)
        heading, lean = law.heading[state.step], law.lean - self._turns
        slip = float(self._drift.slip_at(heading + lean) - self._planned.slip_at(heading))
        (_, a, b), (_, c, d) = law.twist
        longer = (abs(a) + abs(c)) / (abs(b) + abs(d)) - self._pivot_distance
        slip += longer * self._bend()[0]
        lean = (lean + slip) / (1 + way + way * way / 2) - slip + self._turns
        self._law = law._replace(lean=lean)
        self._go_around()

    def finish_lap(self) -> None:
        """End the path at the end of this lap."""
        self._stopping = self._lap > 0
        self._go_around()

    def _go_around(self) -> None:
        """Begin the next lap at the end of one."""
        law, state = self._law, self.state
        if law.around and law.target == NO_WAY and state.step >= self._lap:
            self.state = state._replace(step=state.step - self._lap, reached=state.reached - law.arc[self._lap])
            self._law = law._replace(lean=law.lean + self._lap_turn)
            self._turns += self._lap_turn
            self._may_leave_out = self._may_leave_out_of_lap
        if self._stopping and law.target == NO_WAY and self.state.step < self._lap:
            self._law = self._law._replace(around=False, last=self._lap - 1)

    def _excess(self, pose: POSE, sense: int) -> float:
        """Compute σ(φ − φ_d) − h, and move the place."""
        value, self.state = excess(self._law, self.state, pose, sense)
        return value

    def is_off(self, pose: POSE) -> bool:
        """Tell whether a pose is too far from path or way for the line of sight."""
        deviation, law = self._excess(pose, 1), self._law
        state = self.state
        if state.leg < SEGMENTS:
            return abs(state.error) > self._limit or abs(deviation + law.way[state.leg].hysteresis) > AWAY
        beyond = self._bend()[1] * max(state.share - 1, -state.share, 0.0)
        off = state.error * state.error + beyond * beyond > self._limit * self._limit
        return off or abs(deviation + law.hysteresis[state.step]) > AWAY

    def distance(self, pose: POSE) -> tuple[float, float]:
        """Compute the distance of the tracked point from the path, and the direction [rad] in which it is.

        On the way back it is the distance from the place where the way ends.
        """
        value, law = self._excess(pose, 1), self._law
        state, rod = self.state, law.rod
        heading = law.heading[state.step]
        if state.leg < SEGMENTS:
            x = pose[0] + law.offset * math.cos(pose[2]) - law.x[state.step] - rod * math.cos(heading)
            y = pose[1] + law.offset * math.sin(pose[2]) - law.y[state.step] - rod * math.sin(heading)
            return math.sqrt(x * x + y * y), math.atan2(y, x)
        turn, step = self._bend()
        turned = value + law.hysteresis[state.step] - math.atan(state.error / law.ahead) - state.bias
        slip = float(self._planned.slip_at(heading))
        tangent = math.atan2(math.sin(slip) + rod * turn, math.cos(slip))  # from the heading, where all is well
        ahead = rod * (math.cos(turned) - 1)
        aside = state.error + rod * math.sin(turned)
        across = math.cos(tangent) * aside - math.sin(tangent) * ahead
        beyond = step * max(state.share - 1, -state.share, 0.0)
        normal = pose[2] - turned + tangent + math.pi / 2
        return math.copysign(math.sqrt(across * across + beyond * beyond), across), normal

    def plan_way(self, pose: POSE) -> None:
        """Plan the way back from a pose to the path that remains after the place."""
        law = self._law
        index = self.state.step if law.target == NO_WAY else law.target
        drift, planned, rod = self._drift, self._planned, law.rod
        rows = slice(index, law.last + 2)
        heading = np.array(law.heading[rows])
        known = planned.slip_at(heading)
        course, lean = heading + known, known - drift.slip_at(heading)
        x = np.array(law.x[rows]) + rod * (np.cos(heading) - np.cos(heading + lean))
        y = np.array(law.y[rows]) + rod * (np.sin(heading) - np.sin(heading + lean))
        left_out = np.array(law.arc[rows]) - law.arc[index]
        allowed = left_out <= max(self._may_leave_out, 0.0)
        left_out = left_out[allowed]
        start = self._pivot(pose)
        targets, radius = np.stack([x, y, course], 1)[allowed], self._radius()
        track, target = shortest_way(start, targets, left_out, self._stride, radius)
        self._may_leave_out -= float(left_out[target])
        at, way = min(index + target, law.last), self._way_of(track)
        turns = round((way[-1].course + way[-1].curvature * way[-1].length - course[target]) / (2 * math.pi))
        self._turns = 2 * math.pi * turns
        self._law = law._replace(way=way, target=at, lean=float(lean[target]) + self._turns)
        self.state = self.state._replace(step=at, share=0.0, leg=0, along=0.0)

    def _way_of(self, track: DubinsPaths) -> tuple[Segment, Segment, Segment]:
        """Return the segments of a single track."""
        lengths, curvatures = track.lengths[0], track.turns[0] / track.radius
        starts = track.poses((np.cumsum(lengths) - lengths)[None])[0]
        swings = self._swing * (1 + np.minimum(np.abs(curvatures) * self._pivot_radius, 1.0)) / 2
        first, second, third = np.column_stack([starts, curvatures, lengths, swings]).tolist()
        return Segment(*first), Segment(*second), Segment(*third)

    @property
    def first_turn(self) -> int:
        """Side to which the way turns first: +1, −1, or 0 for a straight way."""
        if self._law.target != NO_WAY:
            for segment in self._law.way:
                if segment.curvature != 0 and segment.length > STRAIGHT:
                    return 1 if segment.curvature > 0 else -1
        return 0

    def _bend(self) -> tuple[float, float]:
        """Return the curvature of the reference at the place, and the length of its step."""
        law, i = self._law, self.state.step
        dx, dy = law.x[i + 1] - law.x[i], law.y[i + 1] - law.y[i]
        step = math.sqrt(dx * dx + dy * dy)
        return (law.heading[i + 1] - law.heading[i]) / max(step, SHORTEST_ROD), step

    def _radius(self) -> float:
        """Return the radius of arcs on the way, for the learned robot in the learned current."""
        tightest = max(abs(forward / rate) for forward, _, rate in self._law.twist)
        return tightest * (1 + math.hypot(*self._drift.current)) / ROOM

    def _pivot(self, pose: POSE) -> POSE:
        """Return place and course of the pivot."""
        x, y, heading = pose
        a = self._pivot_distance
        return x - a * math.cos(heading), y - a * math.sin(heading), heading + float(self._drift.slip_at(heading))


def stride(plan: Plan) -> int:
    """Return the points of the reference from one target of a way back to the next."""
    arc = plan.declared.reference.arc
    spacing = float(arc[-1]) / (len(arc) - 1)
    return max(round(STRIDE * plan.tracked.vehicle.pivot_radius / max(spacing, 1e-9)), 1)


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
