"""Flips of the motor: response to one switch, and net motion when ω flips every half-period T.

After a flip the tails need about 0.7 time units to turn over, and meanwhile the robot lags the circle
that its new steady motion would draw. With g(T) the pose change over a dwell T, in the pose at the flip,

    lag(T) = g(T) ∘ circle(T)⁻¹   (Δψ, Δx sideways, Δz forward)

is the offset by which the robot, once the tails have turned over, follows its steady circle: lag tends to a
constant for long T, and a schedule's motion is a product of lags and arcs.

With equal dwells of T the robot zigzags along a line at the net speed

    v̄ = |p + Rot(Δψ) M p| / 2T,   g = (p, Δψ),  M the mirror image,

since a reversed motor mirrors the motion. Both come from one run: from the steady state the motor flips
until the start is forgotten (once, where T exceeds the tails' memory), and g is the mean over the last
half-periods and over two disc phases half a tail spacing apart at the first flip (the phase at a flip matters
for N = 2, and a planner does not know it).

Units: length l, time μ0 l⁴/EI.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from sim import planar
from sim.balance import Swimmer, assemble
from sim.effects import catalogue
from sim.motion import Steady
from sim.resolution import Resolution, time_step
from sim.robot import Groups
from sim.stepper import YAW, State, X, Y, step

MEMORY = 1.2  # time units after which a flip is forgotten: the tails turn over in about 0.7
_AVERAGED = 2  # half-periods that the mean is taken over, where there are as many


@dataclass(frozen=True)
class SwitchResponse:
    """Response of B robots to flips with half-period T̄; all (B,), dimensionless, NaN where `failed`."""

    dwell: NDArray[np.float64]
    net_speed: NDArray[np.float64]
    lag_psi: NDArray[np.float64]  # [rad], positive in the direction of the new turn
    lag_x: NDArray[np.float64]  # sideways, positive towards the new turn's side
    lag_z: NDArray[np.float64]  # forward
    failed: NDArray[np.bool_]


def segment(swimmer: Swimmer, state: State, omega: Tensor, duration: Tensor, resolution: Resolution) -> State:
    """Advance by `duration` (B,) at constant ω, in equal steps, the same number for all robots."""
    count = max(1, math.ceil(float((duration / time_step(omega, resolution)).max()) - 1e-9))
    for _ in range(count):
        state = step(swimmer, state, omega, duration / count)
    return state


def switch_response(
    groups: Groups,
    dwell: NDArray[np.float64],
    steady: Steady,
    state: State,
    *,
    resolution: Resolution | None = None,
) -> SwitchResponse:
    """Flip the motor every `dwell` from the steady motion that `sim.settling.settle` returned.

    Args:
        groups: robots of one N; the sign of ω̄ is the direction before the first flip.
        dwell: half-periods T̄, (B,).
        steady, state: means and end states of the same robots.
        resolution: must be the one of `state`'s mesh; by default the default of this batch.
    """
    chosen = resolution or Resolution.fitting(float(groups.omega_bar.abs().max()))
    edges = state.x.shape[0]
    swimmer = assemble(groups, edges=edges)
    fine = replace(chosen, edges=edges)
    # Two copies: as it is, and half a tail spacing further round.
    speed = torch.as_tensor(steady.omega_t).abs().nan_to_num(nan=1.0)
    spacing = math.pi / groups.N / speed
    later = segment(swimmer, state.restarted(), groups.omega_bar, spacing, fine)
    both = torch.arange(len(groups)).repeat(2)
    pair = swimmer.select(both)
    flips = _join(state.restarted(), later.restarted())
    T = torch.as_tensor(dwell, dtype=torch.float64)[both]
    omega = groups.omega_bar[both]
    changes: list[NDArray[np.float64]] = []
    even = all(catalogue()[name].symmetry == "even" for name in groups.effects)
    count = 1 + math.floor(MEMORY / float(dwell.min()))
    count += 0 if even else count % 2
    for _ in range(count):
        omega = -omega
        before = _poses(flips)
        flips = segment(pair, flips.flipped(), omega, T, fine)
        change = planar.between(before, _poses(flips))
        sense = torch.sign(omega).numpy()
        changes.append(np.where(sense[:, None] > 0, change, change * planar.MIRROR))
    used = changes[-_AVERAGED:] if even else changes[-1:]
    mean = np.mean(used, 0).reshape(2, len(groups), 3).mean(0)
    return _response(mean, dwell, groups, steady, flips.failed.reshape(2, -1).any(0).numpy())


def _response(
    change: NDArray[np.float64],
    dwell: NDArray[np.float64],
    groups: Groups,
    steady: Steady,
    failed: NDArray[np.bool_],
) -> SwitchResponse:
    sense = np.sign(groups.omega_bar.numpy())
    twist = np.stack([steady.v_z, steady.v_x * sense, steady.omega_yr * sense], -1)
    lag = planar.compose(change, planar.inverse(planar.arc(twist, dwell)))
    pair = planar.compose(change, change * planar.MIRROR)
    failed = failed | ~np.isfinite(lag).all(-1)
    lag = np.where(failed[:, None], np.nan, lag)
    speed = np.where(failed, np.nan, np.hypot(pair[:, 0], pair[:, 1]) / (2 * dwell))
    return SwitchResponse(dwell, speed, lag[:, 2], lag[:, 1], lag[:, 0], failed)


def _poses(state: State) -> NDArray[np.float64]:
    return state.pose[[X, Y, YAW]].T.numpy()


def _join(first: State, second: State) -> State:
    fields: dict[str, Any] = {
        name: torch.cat([value, getattr(second, name)], -1) if torch.is_tensor(value) else None
        for name, value in vars(first).items()
    }
    return State(**fields)
