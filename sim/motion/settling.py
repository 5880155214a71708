"""Settling: time stepping from rest until the motion is steady.

A robot starts from rest with straight tails and is stepped in time (`sim.solve.march`). From time SETTLED on,
means over whole revolutions of the disc are compared with those of the revolutions before. The motion is converged
when all means agree to DRIFT. At time LONGEST the run ends, and the row is flagged. Every mean is taken over at
least one whole revolution, because with N = 2 a part of a revolution gives a wrong ω_yr. If Newton's method fails,
the robot is tried once more with half the step.

This is the reference for the orbits of `sim.solve.refinement`. It finds the motion that straight tails reach from
rest, also where the tails do not move alike. Units: l, μ0 l⁴/EI.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from multiprocessing import parent_process

import numpy as np
from tqdm import tqdm

from common.arrays import Floats
from sim.mechanics.balance import motor_gain
from sim.mechanics.tail_contact import tail_gap
from sim.model.body import Body
from sim.model.groups import Groups
from sim.motion.run import BROKE_DOWN, MOST_WORK, TOO_MUCH, Resolution, SteppedRobot, steps_in
from sim.motion.shapes import state_on_orbit
from sim.motion.steady_motion import STEPPING, Steady
from sim.solve.assembly import bodies
from sim.solve.march import PHASE, SURGE, SWAY, YAW, State

SETTLED = 1.5  # time units before the first mean
LONGEST = 12.0  # the run ends then, or later when the first mean over whole revolutions is known
DRIFT = 2e-4  # relative change between consecutive means that counts as converged
NO_REVOLUTION = "the tails do not complete a revolution"
_WINDOW = 0.5  # shortest averaging time
_CHUNK = 0.25  # time units after which the means are compared
_MEANS = [PHASE, YAW, SWAY, SURGE]
_SILENT = 3.0  # s, before a robot that is stepped says so
VERY_FAST = 1000.0  # ω̄; the robots of the paper have 10 to 33
_SHARE = 0.1  # of the work that a row may take, for a motor above it: its units are doubtful
TOO_FAST = f"ω̄ above {VERY_FAST:g} is so fast that time stepping takes too long: are all units right?"
_BAR = "{desc}: {n:.2f} time units, {elapsed}"
_GAP_SHAPES = 12  # shapes of the last revolution in which the gap between tails is measured


@dataclass(frozen=True)
class Settled:
    """What came out for one robot."""

    means: Floats  # (4,): ω_t, ω_yr, v_x, v_z of the head's centre; NaN where failed
    drift: float
    converged: bool
    failed: str  # why there are no means; empty where there are
    gap: float
    state: State


@np.errstate(all="ignore")  # robots that overflow are flagged
def settle(
    groups: Groups, *, resolution: Resolution | Callable[[float], Resolution] = Resolution.fitting
) -> Steady:
    """Step robots of one N from rest until their motion is steady.

    Args:
        groups: the robots, B of them; ω̄ may have either sign.
        resolution: mesh and step of all robots, or a function of ω̄; by default what each robot needs.
    """
    robots = bodies(groups)
    ended = []
    for body in robots:
        chosen = resolution if isinstance(resolution, Resolution) else resolution(body.omega)
        settled = settle_one(body, groups.N, chosen)
        broke_down = settled.failed == BROKE_DOWN
        ended.append(settle_one(body, groups.N, chosen.refined()) if broke_down else settled)
    means = np.array([e.means for e in ended]).T
    return Steady(
        omega_t=means[0],
        omega_h=(means[0] - [body.omega for body in robots]) / [motor_gain(body) for body in robots],
        omega_yr=means[1],
        v_x=means[2],
        v_z=means[3],
        tail_gap=np.array([e.gap for e in ended]),
        error=np.full(len(robots), np.nan),
        converged=np.array([e.converged for e in ended]),
        failed=np.array([bool(e.failed) for e in ended]),
        method=np.full(len(robots), STEPPING),
        growth=np.full(len(robots), np.nan),
        note=np.array([e.failed or _drift_note(e) for e in ended]),
    )


def _drift_note(settled: Settled) -> str:
    return "" if settled.converged else f"still drifting by {settled.drift:.1e} a revolution"


def settle_one(body: Body, tails: int, resolution: Resolution) -> Settled:
    """Step one robot with N tails from rest until its motion is steady."""
    very_fast = abs(body.omega) > VERY_FAST
    run = SteppedRobot(body, tails, resolution, most_work=MOST_WORK * (_SHARE if very_fast else 1.0))

    def lost() -> Settled:
        failed = TOO_FAST if very_fast and run.failed == TOO_MUCH else run.failed
        return Settled(np.full(4, np.nan), np.nan, False, failed, np.nan, run.state)

    if not run.can_afford(SETTLED + 2 * _WINDOW):  # the first drift is known then, or later
        return lost()
    dt = run.time_step
    count = int(steps_in(_CHUNK, dt))
    poses = [np.zeros((1, 6))]
    doubt = ", which is very fast: are all units right?" if very_fast else ""
    words = f"stepping in time at ω̄ = {abs(body.omega):.3g}{doubt}"
    hidden = parent_process() is not None or None  # None: a bar on a terminal, not in a file
    with tqdm(desc=words, delay=_SILENT, bar_format=_BAR, leave=False, disable=hidden) as bar:
        while True:
            poses.append(run.steps(count, dt * count)[0])
            if run.failed:
                return lost()
            time = dt * count * (len(poses) - 1)
            bar.update(dt * count)
            if time < SETTLED:
                continue
            track = np.concatenate(poses)
            means, drift, known = _means(np.asarray(np.arange(len(track)) * dt), track, body.omega, tails)
            converged = known and drift < DRIFT
            if converged or (known and time > LONGEST) or time > 8 * LONGEST:
                break
    if not known:
        run.failed = NO_REVOLUTION
        return lost()
    gap = _smallest_gap(run, 2 * np.pi / abs(means[0]))
    return lost() if run.failed else Settled(means, drift, converged, "", gap, run.state)


def steady_state(body: Body, tails: int, resolution: Resolution) -> State | None:
    """Find a state of the steady motion: on the orbit, or settled from rest; None where the robot breaks down."""
    state = state_on_orbit(body, tails, resolution.edges, 0.0)
    if state is not None:
        return state
    settled = settle_one(body, tails, resolution)
    return None if settled.failed else settled.state


def _smallest_gap(run: SteppedRobot, revolution: float) -> float:
    """Compute the smallest gap between tails at some instants of the next revolution."""
    part = revolution / _GAP_SHAPES
    smallest = np.inf
    for _ in range(_GAP_SHAPES):
        if not run.can_afford(part):
            break
        _, shapes = run.steps(int(steps_in(part, run.time_step)), part, shapes=1)
        smallest = min(smallest, *(tail_gap(shape, run.body.offset, run.body.tail_radius) for shape in shapes))
    return smallest


def _means(time: Floats, poses: Floats, omega: float, tails: int) -> tuple[Floats, float, bool]:
    """Average the rates (4,) over the last whole revolutions; return their drift, and whether they are known.

    The drift compares the last window with the one before it. Where one revolution is longer than the transient,
    it compares with the same window an N-th of a revolution earlier, scaled up to a whole window.
    """
    phase = poses[:, PHASE] * np.sign(omega)
    unknown = np.full(4, np.nan), np.inf, False
    first = np.flatnonzero(np.diff(phase) <= 0).max(initial=-1) + 1  # from here on the disc only turns forward
    end, turn = phase[-1], 2 * np.pi
    speed = max(end / time[-1], 1e-6)
    window = turn * max(1, math.ceil(_WINDOW * speed / turn))
    shift = window / tails if window / speed > SETTLED else window
    oldest = end - shift - window
    if oldest < phase[first] or len(phase) - first < 4:
        return unknown
    start = max(first, int(np.searchsorted(phase, oldest)) - 4)
    from scipy.interpolate import CubicSpline  # slow to import, and most steady motions are not stepped

    table = np.column_stack([time, poses[:, _MEANS]])[start:]
    marks = CubicSpline(phase[start:], table)([end, end - window, end - shift, oldest])
    if marks[3, 0] < SETTLED:
        return unknown
    latest, before = _rates(marks[1], marks[0]), _rates(marks[3], marks[2])
    speed_scale = np.hypot(latest[2], latest[3])
    scale = np.array([abs(omega), abs(latest[1]), speed_scale, speed_scale])
    return latest, float((np.abs(latest - before) / scale).max() * window / shift), True


def _rates(start: Floats, end: Floats) -> Floats:
    difference = end - start
    return np.asarray(difference[1:] / difference[0])
