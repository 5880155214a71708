"""Flips of the motor by time steps: response to one switch, and net motion when ω flips every half-period T.

After a flip the tails need about 0.7 time units to turn over, and meanwhile the robot lags the circle
that its new steady motion would draw. With g(T) the pose change over a dwell T, in the pose at the flip,

    lag(T) = g(T) ∘ circle(T)⁻¹   (Δψ, Δx sideways, Δz forward)

is the offset by which the robot, once the tails have turned over, follows its steady circle: lag tends to a
constant for long T, and a schedule's motion is a product of lags and arcs.

With equal dwells of T the robot zigzags along a line at the net speed

    v̄ = |p + Rot(Δψ) M p| / 2T,   g = (p, Δψ),  M the mirror image,

since a reversed motor mirrors the motion. Where T exceeds the tails' memory one flip from the steady motion gives
g. Where it does not, the motor flips on until the motion repeats: the shape at a flip is the mirror image of the
one at the flip before (the flipped periodic orbit; flips forget their start as fast as the tails turn over). g is
the mean over two disc phases half a tail spacing apart at the first flip: the phase at a flip matters for N = 2,
and a planner does not know it.

The steady circle in the lag is that of the same mesh and step, so that the discretisation's error, which grows
with T, cancels. The net speed is made of the lag and the arcs of the extrapolated steady motion.
Units: l, μ0 l⁴/EI.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from common.arrays import Flags, Floats
from common.errors import InputError
from sim.effects import check_effects, effect_named
from sim.mechanics import planar
from sim.model.body import Body
from sim.model.groups import DWELL, Groups
from sim.motion.run import Resolution, SteppedRobot
from sim.motion.settling import steady_state
from sim.motion.steady import steady
from sim.motion.steady_motion import Steady, twists
from sim.motion.stepped_response import steady_twist
from sim.solve.assembly import bodies

MEMORY = 1.2  # time units after which a flip is forgotten: the tails turn over in about 0.7
_AVERAGED = 2  # half-periods that the mean is taken over, where there are as many


@dataclass(frozen=True)
class SwitchResponse:
    """Response of B robots to flips with half-period T̄; all (B,), dimensionless, NaN where `failed`."""

    dwell: Floats
    net_speed: Floats
    lag_psi: Floats  # [rad], positive in the direction of the new turn
    lag_x: Floats  # sideways, positive towards the new turn's side
    lag_z: Floats  # forward
    failed: Flags


@np.errstate(all="ignore")  # robots that overflow are flagged
def switch_response(
    groups: Groups, dwell: Floats, motion: Steady | None = None, *, resolution: Resolution | None = None
) -> SwitchResponse:
    """Flip the motor every `dwell` from the steady motion.

    Args:
        groups: robots of one N; the sign of ω̄ is the direction before the first flip.
        dwell: half-periods T̄, (B,).
        motion: the robots' steady motion, if it is at hand; the net speed is made of its arcs and the lags.
        resolution: mesh and step; by default what each robot needs.
    """
    check_effects(groups.effects)
    dwell = np.asarray(dwell, dtype=float)
    for row in np.flatnonzero(~(np.isfinite(dwell) & (dwell > 0)))[:1]:
        raise InputError(f"{DWELL} = {dwell[row]} in row {row + 1}; it must be a finite number above 0")
    motion = steady(groups, stability=False) if motion is None else motion
    even = all(effect_named(name).symmetry == "even" for name in groups.effects)
    robots = bodies(groups)
    pairs = zip(robots, bodies(groups.reversed()), dwell, strict=True)
    lag = np.array([_lag(body, reverse, groups.N, T, even, resolution) for body, reverse, T in pairs])
    sense = np.sign([body.omega for body in robots])
    twist = twists(motion.v_z, motion.v_x, motion.omega_yr, sense)
    speed = planar.net_speed(twist, lag, dwell)
    failed = ~np.isfinite(speed)
    lag[failed] = np.nan
    return SwitchResponse(dwell, speed, lag[:, 2], lag[:, 1], lag[:, 0], failed)


def _lag(body: Body, reverse: Body, tails: int, dwell: float, even: bool, resolution: Resolution | None) -> Floats:
    """Step the lag (Δz, Δx, Δψ) of one robot; NaN where it breaks down."""
    chosen = resolution or Resolution.fitting(body.omega)
    state = steady_state(body, tails, chosen)
    if state is None:
        return np.full(3, np.nan)
    run = SteppedRobot(body, tails, chosen, state, reverse=reverse)
    sense = np.sign(body.omega)
    twist, turn = steady_twist(run, tails, sense)
    if run.failed:
        return np.full(3, np.nan)
    later = run.copy()
    later.go(0.5 * turn)
    changes = []
    for copy in (run, later):
        changes.append(_change(copy, dwell, even, sense))
        if copy.failed:
            return np.full(3, np.nan)
    return planar.compose(np.mean(changes, 0), planar.inverse(planar.arc(twist, dwell)))


def _change(run: SteppedRobot, dwell: float, even: bool, sense: float) -> Floats:
    """Compute the pose change over a dwell, seen in the direction of a positive motor."""
    flips = 1 + MEMORY / dwell
    if not run.can_afford(MEMORY + dwell, flips=flips):
        return np.full(3, np.nan)
    count = int(flips)
    count += 0 if even else count % 2
    changes = []
    for _ in range(count):
        run.flip()
        sense = -sense
        before = run.pose
        run.go(dwell)
        change = planar.between(before, run.pose)
        changes.append(change if sense > 0 else change * planar.MIRROR)
    return np.asarray(np.mean(changes[-_AVERAGED:] if even else changes[-1:], 0))
