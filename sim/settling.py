"""Settling: time stepping from rest until the motion is steady.

Robots start from rest with straight tails and are stepped in time (`sim.stepper`). From time SETTLED on,
means over whole revolutions of the disc are compared with those of the revolutions before; a row is
converged when all of them agree to DRIFT, and given up, flagged, at LONGEST. Every row is averaged over
at least one whole revolution: with N = 2 a fraction of a revolution biases ω_yr.
A row whose Newton iteration fails is tried once more with half the step.

This is the reference for the direct route (`sim.direct`), and finds the branch that straight tails reach from
rest, whether or not the tails move alike on it.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from sim.balance import Swimmer, assemble
from sim.contact import tail_gap
from sim.motion import STEPPING, Steady
from sim.resolution import Resolution, time_step
from sim.robot import Groups
from sim.stepper import PHASE, SURGE, SWAY, YAW, State, at_rest, step

Floats = NDArray[np.float64]

SETTLED = 1.5  # time units before the first mean
LONGEST = 12.0  # give up then, or as soon after as one mean over whole revolutions is known
DRIFT = 2e-4  # relative change between consecutive means that counts as converged
_WINDOW = 0.5  # shortest averaging time
_MEANS = [PHASE, YAW, SWAY, SURGE]
_GAP_SHAPES = 8  # shapes over the last revolution in which the gap between tails is measured


def settle(
    groups: Groups,
    *,
    resolution: Resolution | None = None,
    progress: Callable[[int], object] | None = None,
) -> tuple[Steady, State]:
    """Step a batch of robots of one N from rest until their motion is steady.

    Args:
        groups: the robots; ω̄ may have either sign.
        resolution: mesh and step; by default what the largest |ω̄| of the batch needs.
        progress: called with the number of rows that have just ended.

    Returns:
        The means, and the states in which the rows ended (in the order of the rows).
    """
    chosen = resolution or Resolution.fitting(float(groups.omega_bar.abs().max()))
    result, state = _run(groups, chosen, progress)
    again = np.flatnonzero(result.failed)
    if len(again):
        redone, redone_state = _run(groups.select(torch.as_tensor(again)), chosen.refined(), None)
        result = result.with_rows(again, redone)
        _replace(state, torch.as_tensor(again), redone_state)
    return result, state


def _replace(state: State, lanes: Tensor, other: State) -> None:
    for name, value in vars(other).items():
        if torch.is_tensor(value):
            getattr(state, name)[..., lanes] = value


def _run(groups: Groups, resolution: Resolution, progress: Callable[[int], object] | None) -> tuple[Steady, State]:
    swimmer = assemble(groups, edges=resolution.edges)
    gain = swimmer.gain
    omega = groups.omega_bar
    dt = time_step(omega, resolution)
    rows = torch.arange(len(groups), device=omega.device)
    state = at_rest(swimmer)
    history = _History(state, groups.N, resolution.steps)
    ended: list[tuple[Tensor, State, Tensor, Tensor, Tensor, Tensor]] = []
    check_every = max(8, resolution.steps // 2)
    count = 0
    while len(rows):
        state = step(swimmer, state, omega, dt)
        history.append(state)
        count += 1
        if count % check_every:
            continue
        means, drift, known = history.means(omega)
        converged = known & (drift < DRIFT) & ~state.failed
        over = (state.time > LONGEST) & known | (state.time > 8 * LONGEST)
        done = converged | over | state.failed
        if not bool(done.any()):
            continue
        lanes = torch.nonzero(done).squeeze(1)
        gap = history.smallest_gap(swimmer, lanes)
        ended.append((rows[lanes], state.select(lanes), means[:, lanes], drift[lanes], converged[lanes], gap))
        if progress is not None:
            progress(len(lanes))
        rest = torch.nonzero(~done).squeeze(1)
        rows, omega, dt = rows[rest], omega[rest], dt[rest]
        swimmer, state = swimmer.select(rest), state.select(rest)
        history.keep(rest)
    order = torch.argsort(torch.cat([e[0] for e in ended]))
    final = _concatenate([e[1] for e in ended], order)
    means = torch.cat([e[2] for e in ended], -1)[:, order]
    drift = torch.cat([e[3] for e in ended])[order]
    settled = torch.cat([e[4] for e in ended])[order]
    gaps = torch.cat([e[5] for e in ended])[order]
    return _steady(groups, gain, final, means, drift.numpy(), settled.numpy(), gaps.numpy()), final


def _steady(
    groups: Groups,
    gain: Tensor,
    final: State,
    means: Tensor,
    drift: Floats,
    converged: NDArray[np.bool_],
    gap: Floats,
) -> Steady:
    failed = final.failed.numpy()
    values = torch.where(final.failed, torch.nan, means).numpy()
    notes = np.where(converged, "", [f"still drifting by {d:.1e} a revolution" for d in drift])
    return Steady(
        omega_t=values[0],
        omega_h=(values[0] - groups.omega_bar.numpy()) / gain.numpy(),
        omega_yr=values[1],
        v_x=values[2],
        v_z=values[3],
        tail_gap=gap,
        error=np.full(len(groups), np.nan),
        converged=converged,
        failed=failed,
        method=np.full(len(groups), STEPPING),
        note=np.where(failed, "Newton's method did not converge in a time step", notes),
    )


def _concatenate(states: list[State], order: Tensor) -> State:
    return State(
        **{name: torch.cat([getattr(s, name) for s in states], -1)[..., order] for name in vars(states[0])}
    )


class _History:
    """Pose against time of the rows still running, for means over whole revolutions."""

    def __init__(self, start: State, tails: int, steps: int):
        self._tails = tails
        self._stride = max(1, steps // _GAP_SHAPES)
        self._time = [start.time]
        self._pose = [start.pose]
        self._shapes = [start.x]

    def append(self, state: State) -> None:
        self._time.append(state.time)
        self._pose.append(state.pose)
        if len(self._time) % self._stride == 0:
            self._shapes = [*self._shapes[-_GAP_SHAPES + 1 :], state.x]

    def keep(self, lanes: Tensor) -> None:
        self._time = [t[lanes] for t in self._time]
        self._pose = [p[:, lanes] for p in self._pose]
        self._shapes = [x[..., lanes] for x in self._shapes]

    def means(self, omega: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Rates (4, B) over the last whole revolutions, their drift (B,), and where they are known (B,).

        The drift compares the last window with the one before it; where one revolution outlasts the
        transient, with the same window an N-th of a revolution earlier, scaled up to a whole window.
        """
        time, pose = torch.stack(self._time), torch.stack(self._pose)  # (K, B), (K, 6, B)
        phase = pose[:, PHASE] * torch.sign(omega)
        turn = 2 * math.pi
        speed = (phase[-1] / time[-1]).clamp(min=1e-6)
        window = turn * torch.ceil(_WINDOW * speed / turn).clamp(min=1)
        shift = torch.where(window / speed > SETTLED, window / self._tails, window)
        table = torch.cat([time.unsqueeze(1), pose[:, _MEANS]], 1)  # (K, 5, B)
        end = phase[-1]
        marks = (end, end - window, end - shift, end - shift - window)
        ends = [_at_phase(phase, table, mark) for mark in marks]
        latest = _rates(ends[1], ends[0])
        before = _rates(ends[3], ends[2])
        velocity = torch.hypot(latest[2], latest[3])
        scale = torch.stack([omega.abs(), latest[1].abs(), velocity, velocity])
        drift = ((latest - before).abs() / scale).amax(0) * (window / shift)
        return latest, drift, (marks[3] >= 0) & (ends[3][0] >= SETTLED)

    def smallest_gap(self, swimmer: Swimmer, lanes: Tensor) -> Tensor:
        """Smallest gap between tails over the shapes of the last revolution, (K,)."""
        part = swimmer.select(lanes)
        return torch.stack([tail_gap(part, x[..., lanes]) for x in self._shapes]).amin(0)


def _rates(start: Tensor, end: Tensor) -> Tensor:
    difference = end - start
    return difference[1:] / difference[0]


def _at_phase(phase: Tensor, table: Tensor, mark: Tensor) -> Tensor:
    """Rows of `table` (K, C, B) at the time when the phase (K, B) passes `mark` (B,): cubic Lagrange."""
    first = ((phase <= mark).sum(0) - 2).clamp(0, phase.shape[0] - 4)
    places = first + torch.arange(4, device=phase.device).unsqueeze(1)  # (4, B)
    at = phase.gather(0, places)
    values = table.gather(0, places.unsqueeze(1).expand(4, table.shape[1], -1))
    result = torch.zeros_like(values[0])
    for i in range(4):
        others = [j for j in range(4) if j != i]
        weight = torch.stack([(mark - at[j]) / (at[i] - at[j]) for j in others]).prod(0)
        result = result + weight * values[i]
    return result
