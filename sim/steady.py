"""Steady motion at constant motor speed: directly where that works, by time stepping where it does not.

The direct route (`sim.direct`) solves for the relative periodic orbit on which all tails move alike; it takes
well under a millisecond a robot and gives the error of its means. Straight tails at rest reach that orbit wherever
the robot turns slowly beside its disc (docs/branches.md). Where it may not (|ω_yr| > QUICK |ω_t|), the robot is
stepped in time from rest as well, and what that reaches is the answer; where Newton's method fails in the direct
route, stepping is the answer too. Such rows say so; their error is estimated from two meshes and steps.
"""

from __future__ import annotations

import numpy as np
import torch
from numpy.typing import NDArray

from sim import direct
from sim.motion import DIRECT, Steady
from sim.resolution import Resolution
from sim.robot import Groups
from sim.settling import settle

QUICK = 0.4  # ω_yr/ω_t from which straight tails may reach another motion
SAME = 0.02  # relative difference up to which a stepped motion counts as the direct one


def steady(groups: Groups) -> Steady:
    """Steady motion of a batch of robots of one N, as reached from rest; ω̄ may have either sign."""
    motion = orbits(groups)
    quick = np.flatnonzero(~motion.failed & (np.abs(motion.omega_yr) > QUICK * np.abs(motion.omega_t)))
    if len(quick):
        fastest = float(groups.omega_bar[torch.as_tensor(quick)].abs().max())
        reached = settle(_rows(groups, quick), resolution=Resolution.for_tracks(fastest))
        other = quick[_difference(motion.at(quick), reached) > SAME]
        note = "straight tails reach another motion than the one on which they move alike"
        motion = _with_stepped(motion, groups, other, np.full(len(groups), note))
    lost = np.flatnonzero(motion.failed & (motion.method == DIRECT))
    return _with_stepped(motion, groups, lost, motion.note)


def _with_stepped(motion: Steady, groups: Groups, rows: NDArray[np.int64], notes: NDArray[np.str_]) -> Steady:
    """This motion with `rows` stepped instead; notes (B,) say why."""
    if not len(rows):
        return motion
    return motion.with_rows(rows, stepped(_rows(groups, rows), notes[rows].tolist()))


def _rows(groups: Groups, rows: NDArray[np.int64]) -> Groups:
    return groups.select(torch.as_tensor(rows))


def orbits(groups: Groups, *, phases: int = direct.FEW) -> Steady:
    """The direct route alone, on `phases` phases to begin with; `failed` where it found no orbit."""
    found = direct.solve_all(direct.bodies(groups), groups.N, phases=phases)
    means = found.means.T
    solved = found.ended == direct.SOLVED
    return Steady(
        omega_t=means[0],
        omega_h=means[1],
        omega_yr=means[2],
        v_x=means[3],
        v_z=means[4],
        tail_gap=found.gap,
        error=found.error,
        converged=solved,
        failed=~solved,
        method=np.full(len(groups), DIRECT),
        note=np.array([direct.REASONS[k] for k in found.ended.tolist()]),
    )


def stepped(groups: Groups, notes: list[str]) -> Steady:
    """Time stepping from rest on two meshes and steps; their difference gives the error of the finer."""
    needed = Resolution.fitting(float(groups.omega_bar.abs().max()))
    coarse = settle(groups, resolution=needed)
    fine = settle(groups, resolution=Resolution(2 * needed.edges, 2 * needed.steps))
    fields = {**vars(fine), "error": _difference(coarse, fine) / 3}  # of second order
    fields["note"] = np.array([f"{a}; {b}" if b else a for a, b in zip(notes, fine.note.tolist(), strict=True)])
    return Steady(**fields)


def _difference(motion: Steady, other: Steady) -> NDArray[np.float64]:
    """Largest relative difference of the means; velocities relative to the speed."""
    speed = np.hypot(other.v_x, other.v_z)
    rates = [np.abs(getattr(motion, k) / getattr(other, k) - 1) for k in ("omega_t", "omega_h", "omega_yr")]
    velocities = [np.abs(getattr(motion, k) - getattr(other, k)) / speed for k in ("v_x", "v_z")]
    return np.asarray(np.max(rates + velocities, 0))
