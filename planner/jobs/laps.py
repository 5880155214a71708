"""looped(plan): the plan of a closed path as a schedule that repeats until told otherwise.

The reference is followed for a lap and once more. The dwells of the second lap, which began in motion, are the
schedule: an even number of them. The last ones are changed a little, so that pose and motion at the end are those
at the beginning: the sum of the squares of the changes is least. The first dwell of the first lap begins at rest;
the start is where that one, too, ends in the pose from which all laps go on. Lengths in l, times in μ0 l⁴/EI.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from planner.goal.final_dwells import flips_after
from planner.planning.conditions import OVERLAP, Lap
from planner.planning.errors import drift_of_a_lap, plan_errors
from planner.planning.line_of_sight import follow
from planner.planning.plan import J, Plan
from planner.planning.request import Progress
from planner.vehicle.rollout import Switches, poses_at_flips
from planner.vehicle.vehicle import Vehicle
from sim.arrays import Floats
from sim.io.errors import InputError
from sim.mechanics import planar

_CHANGED = 60  # dwells before the end of a lap that are changed
_NEAR = 6  # flips, or 2 % of them, from where the lap should end: its end is sought among them
_EXACT = 1e4  # weight of the pose at the end, over the change of a dwell as a share of it
_STEP = 1e-4  # for derivatives
_CLOSED = 1e-4  # l and rad; a lap that closes less well is refused


def looped(plan: Plan[J], progress: Progress | None = None) -> Plan[J]:
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
    if not laps:
        raise InputError("no schedule of this path repeats; change the dwell a little (--minimum-dwell)")
    _, switches = min(laps, key=lambda lap: lap[0])
    errors = plan_errors(
        tracked, plan.drawn, plan.declared, switches, guaranteed=plan.errors.guaranteed, seed=seed
    )
    closes, closes_turn = _closure(tracked.vehicle, switches, turn)
    lap = Lap(closes, closes_turn, *drift_of_a_lap(tracked, switches, seed))
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

    def residuals(changed: Floats) -> Floats:
        return np.concatenate([_EXACT * (ends(changed[None])[0] - goal), changed / planned - 1])

    def slopes(changed: Floats) -> Floats:
        steps = np.concatenate([changed[None], changed + _STEP * np.eye(len(changed))])
        poses = ends(steps)
        return np.concatenate([_EXACT * (poses[1:] - poses[0]).T / _STEP, np.diag(1 / planned)])

    from scipy.optimize import least_squares  # here, for it takes longer to load than most plans to make

    solution = least_squares(
        residuals, planned * (1 + 1e-9), slopes, bounds=(least * (1 - 1e-9), np.inf), x_scale=plan.minimum_dwell
    ).x
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
    return Switches(sense, dwells, poses_at_flips(vehicle, Switches(sense, dwells, start[None])))


def _closure(vehicle: Vehicle, switches: Switches, turn: float) -> tuple[float, float]:
    """Predict how the pose after two laps differs from that after one: distance, and angle."""
    twice = Switches(switches.first_direction, np.tile(switches.dwells, 2), switches.poses)
    poses = poses_at_flips(vehicle, twice)
    x, y, angle = (poses[-1] - poses[len(switches.dwells)]).tolist()
    return math.hypot(x, y), abs(angle - turn)
