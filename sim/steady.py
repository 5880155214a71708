"""Steady motion: what a robot does at constant motor speed once its transient has died.

Robots start from rest with straight tails and are stepped in time (`sim.stepper`). From time SETTLED on,
means over whole revolutions of the disc are compared with those of the revolutions before; a row is
converged when all of them agree to DRIFT, and given up, flagged, at LONGEST. Every row is averaged over
at least one whole revolution: with N = 2 a fraction of a revolution biases ω_yr.

    means:  ω_t, ω_h = ω_t − ω, ω_yr, v_x, v_z (of the head's centre, body frame)
    R_yr = √(v_x² + v_z²)/|ω_yr|,   θ = atan2(|v_x|, v_z)

R_yr and θ belong to the tracked point; any other point of the axis follows from (v_x, v_z, ω_yr).

Resolution. At the control robot 12 edges and 24 steps a revolution miss ω_yr by 1 %; high ω̄ needs more, so
the default resolution follows ω̄ (`Resolution.fitting`). A row whose Newton iteration fails is tried once
more with half the step.

Left out: a direct solution for the periodic orbit; which of several branches a row is on (it is the one that
straight tails reach from rest).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from sim.balance import Swimmer, assemble
from sim.contact import tail_gap
from sim.robot import Groups
from sim.stepper import PHASE, SURGE, SWAY, YAW, State, at_rest, step

SETTLED = 1.5  # time units before the first mean
LONGEST = 12.0  # give up then, or as soon after as one mean over whole revolutions is known
DRIFT = 2e-4  # relative change between consecutive means that counts as converged
_WINDOW = 0.5  # shortest averaging time
_LONGEST_STEP = 0.04
STEADY_COLUMNS = (
    "omega_t_bar", "omega_h_bar", "omega_yr_bar", "v_x", "v_z",
    "R_yr_over_l", "theta_deg", "converged", "tail_gap",
)  # fmt: skip
_MEANS = [PHASE, YAW, SWAY, SURGE]
_GAP_SHAPES = 8  # shapes over the last revolution in which the gap between tails is measured


@dataclass(frozen=True)
class Resolution:
    """Edges a tail and time steps a motor revolution."""

    edges: int
    steps: int

    @staticmethod
    def fitting(omega_bar: float) -> Resolution:
        """The default for motor speeds up to |omega_bar|: within 1 % of the limit up to ω̄ = 110."""
        speed = abs(omega_bar)
        if speed < 20:
            return Resolution(16, 24)
        if speed < 60:
            return Resolution(16, 36)
        return Resolution(20, 48)

    def refined(self) -> Resolution:
        """The same mesh with half the step."""
        return Resolution(self.edges, 2 * self.steps)


@dataclass(frozen=True)
class Steady:
    """Mean motion of B robots; all (B,), dimensionless; NaN where `failed`."""

    omega_t: Tensor
    omega_h: Tensor
    omega_yr: Tensor
    v_x: Tensor
    v_z: Tensor
    converged: Tensor  # means of consecutive revolutions agree
    failed: Tensor  # Newton failed
    drift: Tensor  # the largest relative change between the last two means
    time: Tensor  # time at which the row ended
    tail_gap: Tensor  # smallest distance between tails over 2 r0; below 1 they touch

    @property
    def turn_radius(self) -> Tensor:
        """R_yr/l of the head's centre."""
        return torch.hypot(self.v_x, self.v_z) / self.omega_yr.abs()

    @property
    def slip_angle(self) -> Tensor:
        """θ [rad], between the axis and the tangent of the path."""
        return torch.atan2(self.v_x.abs(), self.v_z)

    def columns(self) -> dict[str, np.ndarray]:
        """Columns of the command `python -m sim steady`."""
        values = (
            self.omega_t, self.omega_h, self.omega_yr, self.v_x, self.v_z,
            self.turn_radius, torch.rad2deg(self.slip_angle), self.converged, self.tail_gap,
        )  # fmt: skip
        return {name: value.numpy() for name, value in zip(STEADY_COLUMNS, values, strict=True)}


def time_step(omega: Tensor, resolution: Resolution) -> Tensor:
    """dt for motor speeds (B,): a share of a motor revolution, but never longer than the tails' memory."""
    return (2 * math.pi / (resolution.steps * omega.abs())).clamp(max=_LONGEST_STEP)


def steady(
    groups: Groups,
    *,
    resolution: Resolution | None = None,
    progress: Callable[[int], object] | None = None,
) -> tuple[Steady, State]:
    """Steady motion of a batch of robots of one N.

    Args:
        groups: the robots; ω̄ may have either sign.
        resolution: mesh and step; by default what the largest |ω̄| of the batch needs.
        progress: called with the number of rows that have just ended.

    Returns:
        The means, and the states in which the rows ended (in the order of the rows).
    """
    chosen = resolution or Resolution.fitting(float(groups.omega_bar.abs().max()))
    result, state = _run(groups, chosen, progress)
    again = torch.nonzero(result.failed).squeeze(1)
    if len(again):
        redone, redone_state = _run(groups.select(again), chosen.refined(), None)
        _replace(vars(result), again, vars(redone))
        _replace(vars(state), again, vars(redone_state))
    return result, state


def _replace(into: dict[str, object], lanes: Tensor, values: dict[str, object]) -> None:
    for name, value in values.items():
        target = into[name]
        if torch.is_tensor(value) and torch.is_tensor(target):
            target[..., lanes] = value


def _run(groups: Groups, resolution: Resolution, progress: Callable[[int], object] | None) -> tuple[Steady, State]:
    swimmer = assemble(groups, edges=resolution.edges)
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
    failed = final.failed
    means = torch.where(failed, torch.nan, means)
    return (
        Steady(
            omega_t=means[0],
            omega_h=means[0] - groups.omega_bar,
            omega_yr=means[1],
            v_x=means[2],
            v_z=means[3],
            converged=torch.cat([e[4] for e in ended])[order],
            failed=failed.clone(),
            drift=torch.cat([e[3] for e in ended])[order],
            time=final.time.clone(),
            tail_gap=torch.cat([e[5] for e in ended])[order],
        ),
        final,
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
