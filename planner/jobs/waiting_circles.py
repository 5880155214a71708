"""Waiting circles: whole turns of the pivot that a plan makes at places of its path.

After a whole turn the pivot is where it was, with the same course. The circle becomes a part of the declared path,
so the guidance leads the robot around it and back, open loop as well as with a tracker, and the stated error
includes it. A time of arrival that was asked for is not kept. The circle is wider than the robot's narrowest one,
by 1/ROOM. Lengths in l, times in μ0 l⁴/EI.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from planner.goal.final_dwells import Ending
from planner.paths.tractrix import Reference
from planner.planning.line_of_sight import Start
from planner.planning.plan import J, Plan
from planner.planning.solve import Setting, follow_declared

ROOM = 0.7  # radius of the narrowest circle over that of a waiting circle
_SPACING = 0.02  # l, of the reference's points


class WaitingCircle(NamedTuple):
    """A whole turn at a place of the path."""

    place: int  # index of a point of the reference
    side: int  # +1: to the left, −1: to the right


def circle_reference(plan: Plan, circle: WaitingCircle) -> Reference:
    """Make the reference of a waiting circle; it begins and ends at the place, and ends a whole turn further."""
    reference, tracked = plan.declared.reference, plan.tracked
    drift = plan.drift
    radius = tracked.vehicle.pivot_radius / ROOM
    count = math.ceil(2 * math.pi * radius / _SPACING)
    ((x, y, course),) = reference.part(circle.place, circle.place + 1).courses(drift).tolist()
    courses = course + circle.side * 2 * math.pi * np.arange(count + 1) / count
    left = circle.side * radius * np.array([-math.sin(course), math.cos(course)])
    arms = circle.side * radius * np.stack([np.sin(courses), -np.cos(courses)], 1)
    poses = np.column_stack([np.array([x, y]) + left + arms, courses])
    return Reference.of_pivot(poses, tracked.rod, drift, float(reference.heading[circle.place]))


def with_circles(plan: Plan[J], circles: Sequence[WaitingCircle]) -> Plan[J]:
    """Plan again with waiting circles.

    Args:
        plan: the plan without them.
        circles: where to wait; those at the same place follow each other.

    Raises:
        InputError: the robot has no room for a circle.
    """
    if not circles:
        return plan
    goal, setting = plan.ends_at, Setting(plan.tracked, plan.minimum_dwell, plan.straight, plan.drift)
    declared = plan.declared.moved(_inserted(plan, circles), plan.drawn)
    if goal is None:
        circling = follow_declared(declared, setting, plan.request, drawn=plan.drawn)
    else:
        circling = follow_declared(
            declared, setting, plan.request, drawn=plan.drawn, guidance=plan.guidance,
            start=Start(plan.start, plan.first_direction), ending=Ending(goal, plan.minimum_dwell),
        )  # fmt: skip
    return replace(plan, declared=circling.declared, guidance=circling.guidance, switches=circling.switches,
                   errors=circling.errors, arrival=None)  # fmt: skip


def _inserted(plan: Plan, circles: Sequence[WaitingCircle]) -> Reference:
    """Insert circles into the reference of a plan."""
    reference = plan.declared.reference
    parts, begin = [], 0
    for circle in sorted(circles):
        parts += [reference.part(begin, circle.place), circle_reference(plan, circle).part(0, -1)]
        begin = circle.place
    return Reference.joined(*parts, reference.part(begin), closed=reference.closed)
