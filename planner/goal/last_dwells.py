"""Change the last dwells of a schedule so that the motion ends at a given pose: a goal, or the beginning of a lap.

The sum of the squares of the changes is least. A pose has three coordinates: changes of many dwells are small.

*A goal*: some of the last dwells may be dropped, if that saves time and needs no large changes of the others.

*A lap*: the reference of a closed path is followed for a lap and once more. The dwells of the second lap, which
began in motion, are the schedule: an even number of them. The last ones are changed so that pose and motion at the
end are those at the beginning. The first dwell of the first lap begins at rest; the start is where that one, too,
ends in the pose from which all laps go on. Lengths in l, times in μ0 l⁴/EI.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from common.arrays import Floats
from common.errors import InputError
from planner.guidance.line_of_sight import follow
from planner.planning.conditions import OVERLAP, Lap
from planner.planning.declare import FeasiblePath
from planner.planning.plan import J, Plan
from planner.planning.solve import Trial
from planner.planning.stated_error import drift_of_a_lap, plan_errors
from planner.progress import ProgressCallback
from planner.vehicle.vehicle import Switches, Vehicle, flips_after, roll_out
from sim.mechanics import planar
from sim.mechanics.planar import POSE

_STEP = 1e-4  # time units, for derivatives
_LAST = 30  # dwells before a goal that are changed
_DROPPED = 2  # at most this many are left out
_CHANGE = 40.0  # time units that the sum of the squares of changes costs
_REACHED = 1e-4  # l and rad
_MISSED = 1e6  # time units that more than that costs
_CONVERGED = 1e-6  # relative gain of the sum in a step, below which the search ends
_MOST_STEPS = 200  # about thirty are needed
_DAMPING = 1.0
_CHANGED = 60  # dwells before the end of a lap that are changed
_NEAR = 6  # flips, or 2 % of them, from where the lap should end: its end is sought among them
_FEWEST = 6  # dwells of a lap, below which none could be changed
_EXACT = 1e4  # weight of the pose at the end, over the change of a dwell as a share of it
_CLOSED = 1e-4  # l and rad; a lap that closes less well is refused


@dataclass(frozen=True)
class Ending:
    """Changes the last dwells of a plan's schedule so that it ends at a pose."""

    goal: POSE  # of the head's centre
    least: float  # dwell that the motor allows
    shorter: float  # share of the plan's shortest dwell that these dwells must keep

    def __call__(self, switches: Switches, declared: FeasiblePath, trial: Trial) -> Switches:
        """Change a schedule: without any or some of its last dwells, whichever costs least."""
        least = min(trial.dwell, max(self.least, self.shorter * trial.dwell))
        best, lowest = switches, math.inf
        for count in range(len(switches.dwells), max(len(switches.dwells) - _DROPPED, 1) - 1, -1):
            fewer = Switches(switches.first_direction, switches.dwells[:count], switches.poses[: count + 1])
            candidate, cost = _ended(fewer, self.goal, trial.tracked.vehicle, least)
            if cost < lowest:
                best, lowest = candidate, cost
        return replace(best, poses=roll_out(trial.tracked.vehicle, best, samples=1).flips)


def _ended(switches: Switches, goal: POSE, vehicle: Vehicle, least: float) -> tuple[Switches, float]:
    """Change the last dwells, none below `least`, so that a schedule ends at a goal; return it with its cost."""
    kept = max(len(switches.dwells) - _LAST, 0)
    turns = round((switches.poses[-1, 2] - goal[2]) / (2 * math.pi))
    target = np.array([goal[0], goal[1], goal[2] + 2 * math.pi * turns])
    planned = np.maximum(switches.dwells[kept:], least)

    def ends(dwells: Floats) -> Floats:
        return flips_after(vehicle, switches, kept, dwells)[:, -1]

    last = _least_change(ends, planned, target, least)
    dwells = np.concatenate([switches.dwells[:kept], last])
    missed = float(np.abs(ends(last[None])[0] - target).max())
    change = float(((last / planned - 1) ** 2).sum())
    cost = float(dwells.sum()) + _CHANGE * change + _MISSED * max(missed - _REACHED, 0.0)
    return replace(switches, dwells=dwells), cost


def _least_change(
    ends: Callable[[Floats], Floats], planned: Floats, goal: Floats, least: Floats | float
) -> Floats:
    """Find dwells (K,) that end at a goal and differ least from those planned, by Levenberg's method.

    A dwell that is the shortest stays so while only a shorter one would help.

    Args:
        ends: last poses (B, 3) after dwells (B, K).
        planned: (K,), the dwells to begin with; the sum of the squares of changes, as shares of them, is least.
        goal: (3,), the last pose.
        least: the shortest dwells.
    """

    def at(dwells: Floats) -> tuple[float, Floats, Floats]:
        """Compute the sum, and the normal equations: matrix (K, K) and gradient (K,)."""
        tried = np.concatenate([dwells[None], dwells + _STEP * np.eye(len(dwells))])
        values = np.concatenate([_EXACT * (ends(tried) - goal), tried / planned - 1], 1)
        slopes = (values[1:] - values[0]) / _STEP
        slopes[(dwells <= least) & (slopes @ values[0] > 0)] = 0.0
        return float(values[0] @ values[0]), slopes @ slopes.T, slopes @ values[0]

    dwells, damping = planned, _DAMPING
    cost, matrix, gradient = at(dwells)
    for _ in range(_MOST_STEPS):
        step = np.linalg.solve(matrix + damping * np.eye(len(dwells)), gradient)
        moved = np.maximum(dwells - step, least)
        candidate = at(moved)
        damping *= 6.0 if candidate[0] >= cost else 0.2
        if candidate[0] < cost:
            gained = 1 - candidate[0] / cost
            dwells, (cost, matrix, gradient) = moved, candidate
            if gained < _CONVERGED:
                break
    return dwells


def looped(plan: Plan[J], progress: ProgressCallback | None = None) -> Plan[J]:
    """Turn the plan of a closed path into a schedule that repeats.

    Args:
        plan: of a closed path, for one lap from rest.
        progress: called now and then with the share of the path that is done.

    Raises:
        InputError: no schedule closes.
    """
    tracked, reference, seed = plan.tracked, plan.declared.reference, plan.request.seed
    twice = reference.laps(2, OVERLAP * tracked.vehicle.pivot_radius)
    long = follow(twice, tracked.vehicle, plan.guidance, tracked.offset, progress=progress)
    turn = reference.turn
    tried = [_closed(long, first, last, turn, plan) for first, last in _ends(long, len(plan.dwells), turn)]
    laps = [lap for lap in tried if lap is not None]
    if not laps and len(plan.dwells) < _FEWEST:
        raise InputError(
            f"the robot flips too seldom to correct a lap ({len(plan.dwells)} dwells), as the path is nearly its "
            "own circle; allow shorter dwells (--objective error), or draw the path wider"
        )
    if not laps:
        raise InputError("no schedule of this path repeats; change the dwell a little (--minimum-dwell)")
    _, switches = min(laps, key=lambda lap: lap[0])
    errors = plan_errors(
        tracked, plan.drawn, plan.declared, switches, guaranteed=plan.errors.guaranteed, seed=seed
    )
    again = roll_out(tracked.vehicle, replace(switches, dwells=np.tile(switches.dwells, 2)), samples=1).flips
    x, y, angle = (again[-1] - again[len(switches.dwells)]).tolist()
    lap = Lap(math.hypot(x, y), abs(angle - turn), *drift_of_a_lap(tracked, switches, seed))
    return replace(plan, switches=switches, errors=errors, lap=lap)


def _ends(long: Switches, count: int, turn: float) -> list[tuple[int, int]]:
    """List first and last flip of laps that nearly close: an even number of dwells, one more pair, one less."""
    first = count - 1
    pose = long.poses[first] + np.array([0.0, 0.0, turn])
    ahead = np.array([math.cos(pose[2]), math.sin(pose[2])])
    reach = max(_NEAR, count // 50)
    near = [last for last in range(2 * count - 1 - reach, 2 * count - 1 + reach + 1)
            if (last - first) % 2 == 0 and first < last < len(long.dwells)]  # fmt: skip
    if not near:
        return []
    best = min(near, key=lambda last: abs(float((long.poses[last, :2] - pose[:2]) @ ahead)))
    return [(first, last) for last in (best, best - 2, best + 2) if first + 4 <= last < len(long.dwells)]


def _closed(long: Switches, first: int, last: int, turn: float, plan: Plan) -> tuple[float, Switches] | None:
    """Change the last dwells of a lap so that it closes; return the size of the changes, and the lap from rest."""
    vehicle = plan.tracked.vehicle
    sense = long.first_direction * (-1) ** first
    dwells = long.dwells[first:last].copy()
    dwells[-1] = long.dwells[first - 1]  # so that each lap begins after the same dwell
    kept = max(len(dwells) - 1 - _CHANGED, 1)
    lap = Switches(sense, dwells, long.poses[first : last + 1])
    goal = long.poses[first] + np.array([0.0, 0.0, turn])
    planned, least = dwells[kept:-1], np.minimum(plan.minimum_dwell, dwells[kept:-1].min())

    def ends(changed: Floats) -> Floats:
        """Predict the last poses (B, 3) with changed dwells (B, K)."""
        final = np.full((len(changed), 1), dwells[-1])
        return flips_after(vehicle, lap, kept, np.concatenate([changed, final], 1))[:, -1]

    solution = _least_change(ends, planned, goal, least)
    if np.abs(ends(solution[None])[0] - goal).max() > _CLOSED:
        return None
    dwells[kept:-1] = solution
    return float(((solution / planned - 1) ** 2).sum()), _from_rest(vehicle, lap, dwells, turn)


def _from_rest(vehicle: Vehicle, lap: Switches, dwells: Floats, turn: float) -> Switches:
    """Choose the start, at rest, from which the first dwell ends where it ends in every lap."""
    sense, first = lap.first_direction, float(dwells[0])
    moved = vehicle.motion(sense, None, first)
    after = lap.poses[1] - np.array([0.0, 0.0, turn])
    after[:2] -= vehicle.current * first
    start = planar.compose(after, planar.inverse(moved))
    return Switches(sense, dwells, roll_out(vehicle, Switches(sense, dwells, start[None])).flips)
