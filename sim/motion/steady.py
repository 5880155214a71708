"""Steady motion at constant motor speed: solved for directly where that works, else by time stepping.

The direct solution (`sim.solve.refinement`) is the relative periodic orbit in which all tails move alike. It takes
about a millisecond a robot, states the error of its means, and how fast small perturbations grow
(`sim.motion.stability`). Straight tails at rest reach this orbit if the robot yaws slowly compared with the spin
of its disc (docs/results.md). If it yaws faster (|ω_yr| > QUICK |ω_t|), or if perturbations may grow, it
is stepped in time from rest as well. If stepping reaches another motion, that one is the answer. If Newton's
method does not converge, stepping gives the answer, too. Such rows say so. Their error is estimated from two
meshes and steps. Units: l, μ0 l⁴/EI.
"""

from __future__ import annotations

import numpy as np

from common.arrays import Floats, Integers, Words
from sim.effects import check_effects
from sim.effects.tail_contact import EFFECT as CONTACT
from sim.model.groups import Groups
from sim.motion.run import Resolution
from sim.motion.settling import TOO_FAST, settle
from sim.motion.stability import QUICK, growths
from sim.motion.steady_motion import DIRECT, Steady, joined
from sim.solve import assembly
from sim.solve.assembly import numbers
from sim.solve.grouping import by_kind, slices
from sim.solve.orbit import smallest_gaps
from sim.solve.refinement import PHASES, REASONS, SOLVED, difference, refined_orbits, stacked

GROWS = -0.02  # growth in a motor revolution from which small perturbations may take the tails to another motion
GROWS_IN_CONTACT = -0.12  # the same where tails touch: the mesh's error is larger
SAME = 0.02  # relative difference up to which a stepped motion counts as the direct one
_NEAR = 1.1  # gap from which tails cannot touch, given the error of the gap
_OTHER_MOTION = "straight tails reach another motion than the one in which they move alike"
_UNKNOWN = "straight tails may reach another motion than the one in which they move alike"


@np.errstate(all="ignore")  # robots that overflow are flagged
def steady(groups: Groups, *, stability: bool = True, phases: int = PHASES) -> Steady:
    """Simulate the steady motion of robots of one N, as reached from rest.

    Args:
        groups: B robots; ω̄ may have either sign.
        stability: whether to compute the growth of small perturbations of every robot, which adds a quarter to the
            time. If not, only robots whose tails push against each other get one.
        phases: number of phases to begin with. The error of the means is below PHASE_ERROR with any of them; with
            more to begin with it is far below that.

    Returns:
        Their mean motion, dimensionless (lengths in l, times in μ0 l⁴/EI), and how good it is.

    Raises:
        InputError: an unknown effect, or a size outside its bounds.

    Example:
        >>> from softflagella import load_robot
        >>> motion = steady(load_robot("paper-control").groups())
        >>> round(float(motion.omega_yr[0]), 3), motion.method[0] == "direct"
        (0.049, True)
    """
    check_effects(groups.effects)
    motion = orbits(groups, phases=phases, stability=stability)
    quick = np.abs(motion.omega_yr) > QUICK * np.abs(motion.omega_t)
    contact = groups.effects.get(CONTACT.name, np.zeros(len(groups))) != 0
    grows = motion.growth > np.where(contact, GROWS_IN_CONTACT, GROWS)
    doubtful = np.flatnonzero(~motion.failed & (quick | grows))
    if len(doubtful):
        reached = settle(groups.select(doubtful), resolution=Resolution.for_settling)
        unknown = reached.note == TOO_FAST
        changed = doubtful[(difference(motion.means[doubtful], reached.means) > SAME) | unknown]
        notes = np.where(np.isin(np.arange(len(groups)), doubtful[unknown]), _UNKNOWN, _OTHER_MOTION)
        motion = _with_stepped(motion, groups, changed, notes)
    lost = np.flatnonzero(motion.failed & (motion.method == DIRECT))
    return _with_stepped(motion, groups, lost, motion.note)


def _with_stepped(motion: Steady, groups: Groups, rows: Integers, notes: Words) -> Steady:
    """Step `rows` of this motion in time instead; notes (B,) say why."""
    if not len(rows):
        return motion
    return motion.with_rows(rows, stepped(groups.select(rows), notes[rows].tolist()))


def orbits(groups: Groups, *, phases: int = PHASES, stability: bool = False) -> Steady:
    """Solve directly; `failed` where there is no orbit.

    Args:
        groups: B robots of one N.
        phases: number of phases to begin with.
        stability: as for `steady`.
    """
    rows = numbers(groups)
    parts = [_at_once(rows[part], groups.N, phases, stability) for part in slices(len(rows))]
    return parts[0] if len(parts) == 1 else joined(parts)


def _at_once(rows: Floats, tails: int, phases: int, stability: bool) -> Steady:
    """Solve directly for as many robots as there is room for, from their numbers (B, K)."""
    orbits = refined_orbits(rows, tails, phases)
    solved = np.array([orbit.status == SOLVED for orbit in orbits], bool)
    gap, growth = np.full((2, len(rows)), np.nan)
    for robots in by_kind(np.flatnonzero(solved).tolist(), lambda i: orbits[i].x[2].shape):
        shapes, _ = stacked([orbits[i] for i in robots], 2)
        gap[robots] = smallest_gaps(rows[robots], shapes, tails)
    wanted = solved if stability else (rows[:, assembly.CONTACT] != 0) & (gap < _NEAR)
    growth[wanted] = growths(rows[wanted], tails, [orbits[i] for i in np.flatnonzero(wanted)])
    notes = [REASONS[orbit.status] or _growth_note(g) for orbit, g in zip(orbits, growth, strict=True)]
    omega_t, omega_h, omega_yr, v_x, v_z = np.array([orbit.means for orbit in orbits]).reshape(-1, 5).T
    return Steady(
        omega_t,
        omega_h,
        omega_yr,
        v_x,
        v_z,
        tail_gap=gap,
        error=np.array([orbit.error for orbit in orbits], float),
        converged=solved,
        failed=~solved,
        method=np.full(len(rows), DIRECT),
        growth=growth,
        note=np.array(notes, str),
    )


def _growth_note(growth: float) -> str:
    """Say that perturbations grow, if they do."""
    if not growth > 0:
        return ""
    return f"unstable: small perturbations grow by {100 * np.expm1(growth):.2g} % in a motor revolution"


def stepped(groups: Groups, notes: list[str]) -> Steady:
    """Time stepping from rest on two meshes and steps; their difference gives the error of the finer."""
    coarse = settle(groups)
    lasting = np.flatnonzero(~coarse.failed)
    fine = coarse
    if len(lasting):
        finer = settle(groups.select(lasting), resolution=lambda speed: Resolution.fitting(speed).finer(2))
        fine = coarse.with_rows(lasting, finer)
    fields = {**vars(fine), "error": difference(coarse.means, fine.means) / 3}  # of second order
    fields["note"] = np.array([f"{a}; {b}" if b else a for a, b in zip(notes, fine.note.tolist(), strict=True)])
    return Steady(**fields)
