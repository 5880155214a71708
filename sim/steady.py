"""Steady motion at constant motor speed: directly where that works, by time stepping where it does not.

The direct route (`sim.direct`) solves for the relative periodic orbit on which all tails move alike; it takes
well under a millisecond a robot and gives the error of its means. Where Newton's method fails there, the robot is
stepped in time from rest (`sim.settling`), on two meshes and steps, and the row says so.
"""

from __future__ import annotations

import numpy as np
import torch

from sim import direct
from sim.motion import DIRECT, Steady
from sim.resolution import Resolution
from sim.robot import Groups
from sim.settling import settle


def steady(groups: Groups) -> Steady:
    """Steady motion of a batch of robots of one N; ω̄ may have either sign."""
    motion = orbits(groups)
    rest = np.flatnonzero(motion.failed)
    if len(rest):
        motion = motion.with_rows(rest, stepped(groups.select(torch.as_tensor(rest)), motion.note[rest]))
    return motion


def orbits(groups: Groups) -> Steady:
    """The direct route alone; `failed` where it found no orbit."""
    found = direct.solve_all(direct.bodies(groups), groups.N)
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


def stepped(groups: Groups, notes: np.ndarray) -> Steady:
    """Time stepping from rest on two meshes and steps; their difference gives the error of the finer."""
    needed = Resolution.fitting(float(groups.omega_bar.abs().max()))
    coarse = settle(groups, resolution=needed)
    fine = settle(groups, resolution=Resolution(2 * needed.edges, 2 * needed.steps))
    speed = np.hypot(fine.v_x, fine.v_z)
    relative = [np.abs(getattr(coarse, k) / getattr(fine, k) - 1) for k in ("omega_t", "omega_h", "omega_yr")]
    relative += [np.abs(getattr(coarse, k) - getattr(fine, k)) / speed for k in ("v_x", "v_z")]
    fields = {**vars(fine), "error": np.max(relative, 0) / 3}  # of second order
    fields["note"] = np.array([f"{a}; {b}" if b else str(a) for a, b in zip(notes, fine.note, strict=True)])
    return Steady(**fields)
