"""cover(region, width, robot): tracks and turns of this robot that sweep a region with a round footprint.

The region, an outline with holes, is cut into parallel lanes, as far apart as the footprint is wide, less what
the zigzag needs. Among the directions of its edges and DIRECTIONS others the one is taken whose lanes and turns
are estimated to take least time. The lanes are then visited, each from either end, in the order in which the ways
between them take the least time (`planner.jobs.shortest_order`). So the robot skips lanes where its turns are
wider than a lane. Lengths in l, times in μ0 l⁴/EI.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple, Unpack

import numpy as np

from planner.goal.dubins import DubinsPaths
from planner.jobs.shortest_order import EXACT, MOST, Order, shortest_order
from planner.jobs.travel import SLACK, Travel, plan_track, preferred_setting
from planner.options import AnyRegion, AnyVehicle, JobOptions, Length, asked, length_of, region_of
from planner.paths.distance import distance_to
from planner.paths.obstacles import Circle, FreeSpace, Region
from planner.paths.path import arc_length, points_at, runs_of
from planner.paths.units import in_lab, read_degrees
from planner.planning.picture import DECLARED
from planner.planning.plan import Job, Plan
from sim.arrays import Flags, Floats
from sim.io.errors import InputError
from sim.io.keywords import checks_keywords
from sim.io.units import format_time

if TYPE_CHECKING:
    from matplotlib.axes import Axes

FORMAT = 1
DIRECTIONS = 12
_CROSSED = 3.0  # turn radii; a shorter hole is crossed, which is quicker than to turn
_LONGER = (0.0, 0.3, 0.6, 1.0, 1.5, -0.3, -0.6, -1.0)  # l, by which ends of lanes are moved outward
_LEFT_OUT = 10.0  # times that a lane which cannot be swum counts when directions are compared
_MOST_EDGES = 12  # whose directions are tried
SWATH = "#d5ead6"
_DISCS = 3_000  # at most, in a picture
_DENSE = 12  # discs on a way as long as the footprint is wide
_ACROSS = 7  # places across a lane where the region is sampled
_CELLS = 400  # of the raster, along the longer side


@dataclass(frozen=True)
class Field:
    """A region with holes."""

    outline: Region  # what is to be covered
    holes: tuple[Region, ...] = ()  # but for these

    def contains(self, points: Floats) -> Flags:
        """Tell which points (M, 2) are to be covered."""
        inside = self.outline.distance(points) <= 0
        for hole in self.holes:
            inside &= hole.distance(points) > 0
        return np.asarray(inside)

    def raster(self, cell: float) -> tuple[Floats, float]:
        """Return points (M, 2) of a square raster that are to be covered, and the area of a cell."""
        low, high = self.outline.box
        cell = max(min(cell, float((high - low).max()) / 50), float((high - low).max()) / _CELLS)
        x, y = (np.arange(low[i] + cell / 2, high[i], cell) for i in (0, 1))
        points = np.stack(np.meshgrid(x, y, indexing="ij"), -1).reshape(-1, 2)
        points = points[self.contains(points)]
        if not len(points):
            raise InputError("the region is empty: its holes cover it")
        return points, cell**2


@dataclass(frozen=True)
class Coverage(Job):
    """A region that a plan covers with a round footprint about the tracked point. Lengths in l, times in μ0 l⁴/EI.

    Example:
        >>> import softflagella as sf
        >>> cover = sf.cover([[0, 0], [2, 0], [2, 2], [0, 2]], 0.5, "paper-control", objective="time")
        >>> cover.job.share > 0.97, cover.duration > cover.job.bound
        (True, True)
    """

    field: Field  # the region and its holes
    width: float  # of the footprint
    lanes: Floats  # (k, 2, 2), start and end of each lane, in the order in which they are swum
    share: float  # of the area that the predicted track covers
    sure: float  # of the area that is covered as long as the robot stays within the stated error
    sure_tracked: float  # the same with feedback, if the margin around obstacles stays as it is
    bound: float  # area by width and net speed on straight lines: lanes take longer, by turns and overlap
    exact: bool  # no order of the lanes is quicker
    gap: float  # how much longer than with the quickest order the ways between lanes may take, as a share

    kind = "cover"

    def lines(self, plan: Plan) -> list[str]:
        """Say what is covered, and in what time."""
        robot = plan.robot
        scale, duration = robot.time_scale, plan.duration
        if plan.kept_clear is not None:
            proven = "the quickest order of those with direct ways"
        elif self.exact:
            proven = "no order of them is quicker"
        else:
            proven = f"another order takes at most {100 * self.gap / (1 + self.gap):.0f} % less"
        share, sure, tracked = (100 * each for each in (self.share, self.sure, self.sure_tracked))
        remedy = f", {tracked:.1f} % if a camera measures where it is (--feedback)" if tracked > sure else ""
        if tracked == 0:
            remedy = f"; with a camera (--feedback), give more than {in_lab(2 * plan.feedback_error, robot)}"
        return [
            f"{len(self.lanes)} lanes for a width of {in_lab(self.width, robot)}; {proven}",
            f"covers {share:.1f} % as predicted, {sure:.1f} % wherever the robot is within the stated error"
            f"{remedy}",
            f"{format_time(duration * scale)}; area by width and net speed, the bound for lanes without turns, is "
            f"{format_time(self.bound * scale)}",
        ]

    def title(self, plan: Plan) -> str:
        """Name the share that is covered."""
        return f"covers {100 * self.share:.1f} %"

    def draw(self, axes: Axes, plan: Plan) -> None:
        """Draw the region, its holes, and below the plan what is covered."""
        from matplotlib.collections import PatchCollection
        from matplotlib.patches import Circle as Disc

        cm, track, width = 100 * plan.robot.length_scale, plan.smooth_track, self.width
        way = arc_length(track)
        places = np.linspace(0.0, way[-1], min(_DISCS, math.ceil(_DENSE * way[-1] / width) + 1))
        centres = cm * points_at(places, way, track)
        discs = [Disc((x, y), cm * width / 2) for x, y in centres.tolist()]
        axes.add_collection(PatchCollection(discs, color=SWATH, lw=0, zorder=0))
        axes.plot([], [], color=SWATH, lw=6, label="swept")
        axes.autoscale_view()
        for region in (self.field.outline, *self.field.holes):
            outline = cm * region.corners
            axes.plot(*np.concatenate([outline, outline[:1]]).T, color=DECLARED, lw=1.0, ls="--")

    def to_dict(self, plan: Plan) -> dict[str, Any]:
        """Return the content of cover.json. Lengths in l, times in seconds."""
        scale = plan.robot.time_scale
        return {
            "format": FORMAT,
            "outline": FreeSpace((self.field.outline,)).to_dict()["keep_out"][0],
            "holes": FreeSpace(self.field.holes).to_dict()["keep_out"],
            "width_over_l": self.width,
            "lanes": self.lanes.tolist(),
            "share": self.share,
            "share_within_stated_error": self.sure,
            "duration_s": plan.duration * scale,
            "bound_s": self.bound * scale,
            "exact": self.exact,
            "gap": self.gap,
        }


class _Cut(NamedTuple):
    """Lanes that can be swum, and the length of those that cannot."""

    ends: Floats  # (k, 2, 2)
    left_out: float


@checks_keywords
def cover(
    region: AnyRegion,
    width: Length,
    robot: AnyVehicle,
    *,
    holes: Sequence[AnyRegion] = (),
    angle: float | str | None = None,
    **options: Unpack[JobOptions],
) -> Plan[Coverage]:
    """Sweep a region, in lanes and turns, with a camera, magnet or sampler under the robot.

    Args:
        region: circle:X,Y,RADIUS, box:LEFT,LOW,RIGHT,HIGH, or a CSV or SVG outline. In Python also a `Circle`, or
            corners (n, 2) [l].
        width: LENGTH, of the round footprint about the tracked point, such as 4cm.
        robot: robot.toml or the name of a preset, or the vehicle.toml of a measured vehicle. In Python also the
            robot or the vehicle.
        holes: REGION, a part that need not be swept, and may be crossed, as is what `keep_out` has.
        angle: DEGREES, direction of the lanes (default: the quickest). In Python also a number in rad.
        options: see `JobOptions`.

    Raises:
        InputError: the region is empty or needs too many lanes, or the width is too small for this robot.

    Example:
        >>> import softflagella as sf
        >>> swept = sf.cover([[0, 0], [2, 0], [2, 2], [0, 2]], 0.5, "paper-control", objective="time")
        >>> swept.job.share > 0.97, swept.duration > swept.job.bound
        (True, True)
    """
    tracked, request = asked(robot, options)
    swims, unit, space = tracked.robot, options.get("unit"), request.space
    outline = region_of(region, unit, swims, agree=True)
    field = Field(outline, (*(region_of(each, unit, swims) for each in holes), *space.regions))
    across = length_of(width, unit, swims, "--width")
    along = read_degrees(angle, "--angle") if isinstance(angle, str) else angle
    setting = preferred_setting(tracked, request)
    straight = setting.straight
    swath = across - 2 * straight.largest
    if not (math.isfinite(across) and swath > 0.3 * across):
        zigzags = in_lab(2 * straight.largest, swims)
        raise InputError(
            f"width {in_lab(across, swims)}: the robot's zigzag alone is {zigzags} wide; give a larger width, or "
            "shorter dwells"
        )
    travel = Travel.of(setting, space, 0.0)
    apart = _CROSSED * travel.radius
    angles = _angles(field) if along is None else [along]
    angles = [each for each in angles if extent_across(field, each) < MOST * swath]
    if not angles:
        raise InputError(f"the region needs more than {MOST} lanes: widen them, or cover it in parts")
    cut = min(
        (_clear(lanes(field, swath, each, apart=apart), travel) for each in angles),
        key=partial(_estimate, travel),
    ).ends
    if not len(cut):
        raise InputError("no lane of the region is clear of obstacles and walls; give a region further from them")
    if len(cut) > MOST:
        raise InputError(
            f"the region needs {len(cut)} lanes; at most {MOST} can be ordered: widen them, or cover it in parts"
        )
    ends, order = _ordered(cut, travel)
    progress = options.get("progress")
    plan = plan_track(lambda drift: _track(ends, travel.drifting(drift)), setting, request, progress)

    def sure(error: float) -> float:
        return share_covered(field, plan.reference, across - 2 * error) if across > 2 * error else 0.0

    tracked_sure = sure(plan.feedback_error)
    points, cell = field.raster(across / 20)
    job = Coverage(
        field=field,
        width=across,
        lanes=ends,
        share=share_covered(field, plan.track, across),
        sure=tracked_sure if request.feedback else sure(plan.stated_error),
        sure_tracked=tracked_sure,
        bound=len(points) * cell / (across * straight.net_speed),
        exact=len(cut) <= EXACT and space.empty,
        gap=order.gap,
    )
    return plan.with_job(job)


def _angles(field: Field) -> list[float]:
    """List directions of lanes to try."""
    angles = [math.pi * k / DIRECTIONS for k in range(DIRECTIONS)]
    if isinstance(field.outline, Circle):
        return angles[:1]
    edges = np.diff(np.concatenate([field.outline.corners, field.outline.corners[:1]]), axis=0)
    longest = np.argsort(-np.hypot(*edges.T))[:_MOST_EDGES]
    return [*np.arctan2(edges[longest, 1], edges[longest, 0]).tolist(), *angles]


def _estimate(travel: Travel, cut: _Cut) -> float:
    """Estimate the time of lanes and of the turns between them; lanes that cannot be swum count many times."""
    length = float(np.hypot(*(cut.ends[:, 1] - cut.ends[:, 0]).T).sum()) + _LEFT_OUT * cut.left_out
    return length / travel.straight + len(cut.ends) * 1.5 * math.pi * travel.radius / travel.turning


def _clear(cut: Floats, travel: Travel) -> _Cut:
    """Move the ends of lanes to where the robot is clear, and leave out those for which there is no such place."""
    if travel.limits.space.empty:
        return _Cut(cut, 0.0)
    length = np.hypot(*(cut[:, 1] - cut[:, 0]).T)
    along = (cut[:, 1] - cut[:, 0]) / length[:, None]
    result, found = cut.copy(), np.zeros(len(cut), dtype=bool)
    for more in _LONGER:
        moved = np.stack([cut[:, 0] - more * along, cut[:, 1] + more * along], 1)
        begin, end = _ends(moved, travel)
        room = np.minimum(travel.limits.clearance(begin), travel.limits.clearance(end))
        better = (room > travel.margin + SLACK).any(1) & ~found & (length + 2 * more > 0)
        result[better], found = moved[better], found | better
    return _Cut(result[found], float(length[~found].sum()))


def _ends(cut: Floats, travel: Travel) -> tuple[Floats, Floats]:
    """Return the pivot's poses (k, 2, 3) at the begin and at the end of lanes, swum forwards and backwards."""
    along = cut[:, 1] - cut[:, 0]
    course = np.arctan2(along[:, 1], along[:, 0])
    courses = np.stack([course, course + math.pi], 1)
    return travel.poses(cut, courses), travel.poses(cut[:, ::-1], courses)


def _ordered(cut: Floats, travel: Travel) -> tuple[Floats, Order]:
    """Order the lanes (k, 2, 2), and choose the end at which each begins."""
    begin, end = _ends(cut, travel)
    count = len(cut)
    starts, goals = end.reshape(-1, 3), begin.reshape(-1, 3)
    rows, columns = (part.ravel() for part in np.indices((2 * count, 2 * count)))
    costs = travel.times(starts[rows], goals[columns]).reshape(count, 2, count, 2)
    order = shortest_order(costs, np.zeros((count, 2)), np.zeros((count, 2)))
    ends = [cut[k] if option == 0 else cut[k, ::-1] for k, option in zip(order.visits, order.options, strict=True)]
    return np.array(ends), order


def _track(ends: Floats, travel: Travel) -> DubinsPaths:
    """Join lanes by the quickest tracks between them."""
    begin, end = (poses[:, 0] for poses in _ends(ends, travel))
    length = np.hypot(*(ends[:, 1] - ends[:, 0]).T)
    parts = []
    for k in range(len(ends)):
        lane = np.array([[length[k], 0.0, 0.0]])
        parts.append(DubinsPaths(begin[k : k + 1], np.zeros((1, 3), dtype=np.int64), lane, travel.radius))
        if k + 1 < len(ends):
            parts.append(travel.tracks(end[k : k + 1], begin[k + 1 : k + 2]))
    return DubinsPaths.joined(parts)


def extent_across(field: Field, angle: float) -> float:
    """Compute the extent of a region across a direction."""
    return float(np.ptp(field.outline.corners @ np.array([-np.sin(angle), np.cos(angle)])))


def lanes(field: Field, width: float, angle: float, *, apart: float) -> Floats:
    """Cut a region into lanes (k, 2, 2): start and end of the middle of each.

    Args:
        field: the region.
        width: of the swath around a lane.
        angle: direction of the lanes.
        apart: shorter gaps within a lane are crossed.
    """
    c, s = np.cos(angle), np.sin(angle)
    turn = np.array([[c, s], [-s, c]])  # to the frame of the lanes
    outline = field.outline.corners @ turn.T
    low, high = outline.min(0), outline.max(0)
    count = max(1, int(np.ceil((high[1] - low[1]) / width)))
    spacing = (high[1] - low[1]) / count
    step = min(width, high[0] - low[0]) / 10
    x = np.arange(low[0], high[0] + step, step)
    found = []
    for k in range(count):
        middle = low[1] + (k + 0.5) * spacing
        y = middle + spacing * (np.arange(_ACROSS) / (_ACROSS - 1) - 0.5) * 0.999
        points = np.stack(np.meshgrid(x, y, indexing="ij"), -1).reshape(-1, 2) @ turn
        wanted = np.asarray(field.contains(points).reshape(len(x), _ACROSS).any(1))
        for first, last in runs_of(wanted, x, apart):
            found.append([[x[first], middle], [max(x[last], x[first] + step), middle]])
    return np.array(found).reshape(-1, 2, 2) @ turn


def share_covered(field: Field, track: Floats, width: float) -> float:
    """Compute the share of a region's area within half a width of a track (S, 2)."""
    points, _ = field.raster(width / 20)
    return float((distance_to(track, points) <= width / 2).mean())
