"""The response to a flip by time steps, for robots whose steady motion cannot be solved for directly.

From the steady motion in the opposite direction: one flip, and poses after every dwell. The state at the end is
steady in the new direction. From there two flips, a short dwell apart, give the response after a short dwell.
Curves are means over two phases of the disc, half a tail spacing apart, and their spread is that of the two, with
the wobble of a turn.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from common.arrays import Floats
from sim.mechanics import planar
from sim.model.body import Body
from sim.motion.run import Resolution, SteppedRobot
from sim.motion.settling import steady_state
from sim.solve.march import PHASE, SURGE, SWAY, YAW

_ADAPTS = 0.5  # time units after which time steps have forgotten that they began on an orbit of another mesh
_WINDOW = 0.5  # shortest averaging time of the steady circle
_APPROACH = 0.9  # of the angle that is left; the steps to its end must not become tiny


class Curves(NamedTuple):
    """Response of one robot, as in `sim.model.response.Responses`, over D dwells and K dwells before."""

    lag: Floats  # (D, 3)
    memory: Floats  # (K, D, 3)
    rest: Floats  # (D, 3)
    spread: Floats  # (D, 3)


def stepped_response(
    body: Body,
    tails: int,
    dwells: Floats,
    before: Floats,
    *,
    reverse: Body | None = None,
    resolution: Resolution | None = None,
    history: bool = True,
    settled: float = np.inf,
) -> Curves:
    """Step the curves of one robot.

    Args:
        body: with the motor's speed after the flip.
        dwells: T̄, (D,), increasing; the last one long enough for the motion to settle.
        before: T̄ of the dwell before, (K,), increasing.
        reverse: the robot before the flip; by default the same with another sign of ω̄, see `SteppedRobot`.
        resolution: mesh and step; by default what the motor's speed needs.
        history: step memory and rest, too; else they are NaN.
        settled: T̄ from which the lag is taken to be constant.

    Returns:
        NaN where the robot breaks down.
    """
    chosen = resolution or Resolution.fitting(body.omega)
    reverse = body._replace(omega=-body.omega) if reverse is None else reverse
    unknown = np.full((len(dwells), 3), np.nan)
    lost = Curves(unknown, np.full((len(before), *unknown.shape), np.nan), unknown, unknown)
    state = steady_state(reverse, tails, chosen)
    if state is None:
        return lost
    run = SteppedRobot(reverse, tails, chosen, state, reverse=body)
    sense = float(np.sign(body.omega))
    # From `settled` on all dwells have one lag, which is stepped once.
    times, index = np.unique(np.minimum(dwells, settled), return_inverse=True)
    _, turn = steady_twist(run, tails, sense)
    changes, after_short = [], []
    # Two phases half a turn apart: their mean leaves out what changes sign from one to the other.
    for share in (0.0, 0.5):
        if run.failed:
            return lost
        copy = run.copy()
        if share:
            copy.go(share * turn)
        changes.append(_flipped_poses(copy, times, sense))
        if history:
            after_short.append(_after_short_dwells(copy, before, times, sense))
    twist, _ = steady_twist(copy, tails, sense)
    if run.failed or copy.failed:
        return lost
    circle = planar.inverse(planar.arc(twist, times))
    each = planar.compose(np.array(changes), circle)
    lag, spread = each.mean(0), each.std(0)
    rest, memory = lost.rest, lost.memory
    if history:
        from_rest = SteppedRobot(body, tails, chosen)
        rest = planar.compose(_poses(from_rest, times, sense), circle)
        memory = planar.compose(np.mean(after_short, 0), circle) - lag
        if from_rest.failed:
            return lost
        rest, memory = rest[index], memory[:, index]
    return Curves(lag[index], memory, rest, spread[index])


def _after_short_dwells(run: SteppedRobot, before: Floats, dwells: Floats, sense: float) -> Floats:
    """Compute the pose changes (K, D, 3) from a steady run: back for each of `before`, then forth."""
    back = run.copy()
    back.flip()
    lags, now = np.full((len(before), len(dwells), 3), np.nan), 0.0
    for k, time in enumerate(before):
        back.go(float(time - now))
        now = time
        lags[k] = _flipped_poses(back.copy(), dwells, sense)
    return lags


def _flipped_poses(run: SteppedRobot, dwells: Floats, sense: float) -> Floats:
    run.flip()
    return _poses(run, dwells, sense)


def _poses(run: SteppedRobot, dwells: Floats, sense: float) -> Floats:
    """Step to each dwell: pose changes (D, 3), seen as for a positive motor; NaN where the run breaks down."""
    start, now = run.pose, 0.0
    poses = np.full((len(dwells), 3), np.nan)
    for i, time in enumerate(dwells):
        run.go(float(time - now))
        if run.failed:
            return poses
        now = time
        poses[i] = planar.between(start, run.pose)
    return poses if sense > 0 else poses * planar.MIRROR


def steady_twist(
    run: SteppedRobot, tails: int, sense: float, *, adapts: float = _ADAPTS, window: float = _WINDOW
) -> tuple[Floats, float]:
    """Average forward, leftward and yaw rate for a positive motor; return the time of a turn by one spacing, too.

    Velocities repeat with the spacing of the tails: means over a whole number of spacings. The spin may change
    within a turn (near a free surface, say), so the end is approached by the angle of the disc.

    Args:
        adapts: time units before the averaging.
        window: shortest averaging time.
    """
    run.go(adapts)
    before, spacing, time = run.state.pose.copy(), 2 * np.pi / tails, 0.0
    angle = spacing * max(1, math.ceil(window * abs(run.omega_t) / spacing))
    for share in (_APPROACH, _APPROACH, 1.0):
        remaining = angle - abs(run.state.pose[PHASE] - before[PHASE])
        step = share * max(remaining, 0.0) / max(abs(run.omega_t), 1e-300)
        run.go(step)
        time += step
    change = (run.state.pose - before) / time
    turn = spacing / max(abs(change[PHASE]), 1e-300)
    return np.array([change[SURGE], sense * change[SWAY], sense * change[YAW]]), turn
