"""The mean wrench of the tails on the disc: what the table learns, and the numbers that it depends on.

Head, disc and motor enter the balance of forces by algebra (`surrogate.wrench.heads`). What must be simulated is
the mean wrench of one tail over a turn. In the units of the simulator it depends on

    S = ζ⊥ ω_t              drag number: drag over bending stiffness
    a, r0                   where the tail is clamped, and how thick it is
    m = √(v_x² + ω_yr²)/(a ω_t)    sideways motion of the tail over the speed of its clamp
    β = atan2(v_x, ω_yr)    about which point the tail turns
    v_z/(a ω_t)             forward motion

The network sees m as the deflection δ = m a S/(S + 12) that this motion makes. With three or more tails the
velocities hardly change over a turn, and the wrench of one tail does not depend on N. With one or two tails they
do. So N = 1 and N = 2 have networks of their own. That of N = 2 has one more input: the head's spin drag over that
of the tails.

A single tail pushes the robot from side to side in each turn, and how far it goes depends on all drag of the head.
So the network of N = 1 sees S, a, r0 and the whole resistance of the head (HEAD_INPUTS). These determine the
motion, and the network must not see it: from the drag of the head and the velocities it would learn that
forces are in balance, and a query could not tell the true motion from others.

The network gives six numbers y, near (0, 1, 0, 1, 0, 0):

    F_x = N ζ⊥ (ω_yr/2 − v_x + m a ω_t y_0)
    F_z = N (−ζ∥ v_z + (ζ⊥ − ζ∥) ω_t a² T(S) (y_1 + m² y_4))
    M_y = N ζ⊥ (v_x/2 − ω_yr/3 + m a ω_t y_2)
    M_z = −N ζ⊥ ω_t a² Q(S) (y_3 + m² y_5)

The terms without y are the drag of straight tails. T and Q are simple fits to thrust and torque in linear theory
(`sim.reference.linear_theory`). The network learns what is left.

Frame: body axes at the centre J of the disc, motor positive; a reversed motor mirrors the motion. Left out:
effects on the tails themselves. Units: l, μ0 l⁴/EI, EI/l². Source: the paper's model (arXiv 2103.05712).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from sim.arrays import Flags, Floats, Integers
from sim.compiling import formula

INPUTS = ("ln S", "ln a", "ln 1/r0", "asinh δ", "β", "asinh v_z", "ln spin drag of head over tails")
HEAD_INPUTS = (
    "ln sway drag", "ln surge drag", "ln drag against turning", "ln L", "coupling of sway and turn",
    "ln side force", "spin drag of the disc over that of the head", "yaw couple of the tails' spin", "ln gain",
)  # fmt: skip
SINGLE_INPUTS = ("ln S", "ln a", "ln 1/r0", "ln spin drag of head over tails", *HEAD_INPUTS)
SMOOTHNESS = (0.7, 1.3, 8.0, 2.0, 4.0, 4.0, 5.0)  # over how many standard deviations the wrench changes
SINGLE_SMOOTHNESS = (0.7, 1.3, 8.0, 5.0) + (3.0,) * len(HEAD_INPUTS)
TYPICAL = ((0.0, 1.0, 0.0, 0.9, 0.2, 0.0), (0.04, 0.4, 0.03, 0.1, 0.3, 0.05))  # mean and spread of y
SOFT = 12.0  # S from which a tail bends with the flow while it turns
SMALL_DEFLECTION, SMALL_SURGE = 0.05, 0.05  # below, an input is linear; above, logarithmic
TINY = 1e-30
THRUST, THRUST_SOFT, THRUST_POWER = 0.125, 8.0, 1.35  # of T
TORQUE_SOFT, TORQUE_POWER = 6.0, -0.125  # of Q


class Tails(NamedTuple):
    """The tails of M robots; each (M,) where nothing else is said."""

    zeta_perp: Floats
    zeta_parallel: Floats
    offset: Floats  # a
    radius: Floats  # r0
    number: Floats  # N
    head_spin_drag: Floats  # moment on the head per ω_h
    head: Floats  # (M, 9) HEAD_INPUTS; drag over that of the tails

    def at(self, rows: Integers | Flags | slice) -> Tails:
        """Return the tails of the robots at indices, flags or a slice (M',)."""
        return Tails(*[part[rows] for part in self])


TAIL_NUMBERS = len(Tails._fields) - 1 + len(HEAD_INPUTS)  # of a robot


@np.errstate(all="ignore")  # a robot that cannot be has no motion, and is refused for that
def head_inputs(resistance: Floats, length: Floats, gain: Floats, across: Floats, offset: Floats) -> Floats:
    """Return HEAD_INPUTS, (M, 9).

    Args:
        resistance: of head and disc, (M, 4, 5).
        length: L, (M,).
        gain: ∂ω_t/∂ω_h, (M,).
        across: N ζ⊥, (M,).
        offset: a, (M,).
    """
    sway, surge, turn, spin = (resistance[:, i, i] for i in range(4))
    coupling, side, disc, couple = (resistance[:, i, j] for i, j in ((0, 2), (0, 3), (3, 4), (2, 4)))
    return np.stack(
        inputs_of_head(sway, surge, turn, spin, coupling, side, disc, couple, length, gain, across, offset), -1
    )


@formula
def inputs_of_head(
    sway: Any, surge: Any, turn: Any, spin: Any, coupling: Any, side: Any, disc: Any, couple: Any,
    length: Any, gain: Any, across: Any, offset: Any,
) -> tuple[Any, ...]:  # fmt: skip
    """Return HEAD_INPUTS.

    Args:
        sway, surge, turn, spin: the diagonal of the resistance of head and disc.
        coupling, side, disc, couple: its entries for sway and turn, sway and ω_h, spin and ω_t, turn and ω_t.
        length, gain, across, offset: L, ∂ω_t/∂ω_h, N ζ⊥ and a.
    """
    return (
        np.log(sway / across),
        np.log(surge / across),
        np.log(turn / across),
        np.log(length),
        coupling / np.sqrt(sway * turn),
        np.log(side / across),
        disc / spin,
        couple / (across * offset**2),
        np.log(gain),
    )


@formula
def linear_thrust(S: Any) -> Any:
    """Return T: thrust/[(ζ⊥ − ζ∥) ω_t a²] of a tail in linear theory, roughly."""
    return THRUST * S / (1 + (S / THRUST_SOFT) ** THRUST_POWER)


@formula
def linear_torque(S: Any) -> Any:
    """Return Q: torque/[ζ⊥ ω_t a²] of a tail in linear theory, roughly."""
    return (1 + (S / TORQUE_SOFT) ** 2) ** TORQUE_POWER


@formula
def inputs_of_tail(
    perp: Any, offset: Any, radius: Any, number: Any, spin_drag: Any, motion: Any, beta: Any
) -> tuple[Any, ...]:
    """Return INPUTS.

    Args:
        perp, offset, radius, number, spin_drag: ζ⊥, a, r0, N and the moment on the head per ω_h.
        motion: (v_x of J, v_z, ω_yr, ω_h, ω_t), for a positive motor.
        beta: the angle β.
    """
    v_x, v_z, yaw, spin = motion[0], motion[1], motion[2], motion[4]
    drag_number = perp * spin
    deflection = np.sqrt(v_x**2 + yaw**2 + TINY) / spin * drag_number / (drag_number + SOFT)
    return (
        np.log(drag_number),
        np.log(offset),
        -np.log(radius),
        np.arcsinh(deflection / SMALL_DEFLECTION),
        beta,
        np.arcsinh(v_z / (offset * spin) / SMALL_SURGE),
        np.log(spin_drag / (number * perp * offset**2)),
    )


@formula
def inputs_of_single(perp: Any, offset: Any, radius: Any, spin_drag: Any, spin: Any) -> tuple[Any, ...]:
    """Return the SINGLE_INPUTS before those of the head.

    Args:
        perp, offset, radius, spin_drag: ζ⊥, a, r0 and the moment on the head per ω_h.
        spin: ω_t.
    """
    return np.log(perp * spin), np.log(offset), -np.log(radius), np.log(spin_drag / (perp * offset**2))


@formula
def wrench_terms(perp: Any, parallel: Any, offset: Any, number: Any, motion: Any) -> tuple[Any, ...]:
    """Return the terms of the tails' wrench.

    Returns:
        F_x, F_z and M_y of straight tails; then what y multiplies: the side force (F_x and M_y), thrust and torque
        at small m, and m².
    """
    v_x, v_z, yaw, spin = motion[0], motion[1], motion[2], motion[4]
    across = number * perp
    sideways = np.sqrt(v_x**2 + yaw**2 + TINY)
    couple = number * spin * offset**2
    return (
        across * (yaw / 2 - v_x),
        -number * parallel * v_z,
        across * (v_x / 2 - yaw / 3),
        across * sideways,
        (perp - parallel) * couple * linear_thrust(perp * spin),
        -perp * couple * linear_torque(perp * spin),
        (sideways / (offset * spin)) ** 2,
    )


def tail_inputs(tails: Tails, motion: Floats) -> Floats:
    """Return INPUTS, (M, 7), for motions (v_x of J, v_z, ω_yr, ω_h, ω_t), (M, 5), of a positive motor."""
    perp, _, offset, radius, number, spin_drag, _ = tails
    beta = np.arctan2(motion[:, 0], motion[:, 2])
    return np.stack(inputs_of_tail(perp, offset, radius, number, spin_drag, motion.T, beta), -1)


def single_inputs(tails: Tails, motion: Floats) -> Floats:
    """Return SINGLE_INPUTS, (M, 13), of robots with one tail."""
    own = inputs_of_single(tails.zeta_perp, tails.offset, tails.radius, tails.head_spin_drag, motion[:, 4])
    return np.concatenate([np.stack(own, -1), tails.head], -1)


def network_inputs(tails: Tails, motion: Floats, count: int) -> Floats:
    """Return the inputs of a network of the wrench that has so many: SINGLE_INPUTS or INPUTS, (M, F)."""
    return single_inputs(tails, motion) if count == len(SINGLE_INPUTS) else tail_inputs(tails, motion)


def straight_wrench(tails: Tails, motion: Floats) -> Floats:
    """Return (F_x, F_z, M_y, M_z) about J of straight tails at zero spin, (M, 4)."""
    side, along, turn, *_ = _terms(tails, motion)
    return np.stack([side, along, turn, np.zeros(len(side))], -1)


def wrench_slopes(tails: Tails, motion: Floats) -> Floats:
    """Return ∂(wrench)/∂y at a motion, (M, 4, 6)."""
    _, _, _, force, thrust, torque, squared = _terms(tails, motion)
    none = np.zeros(len(force))
    rows = [
        [force, none, none, none, none, none],
        [none, thrust, none, none, thrust * squared, none],
        [none, none, force, none, none, none],
        [none, none, none, torque, none, torque * squared],
    ]
    return np.stack([np.stack(row, -1) for row in rows], -2)


def _terms(tails: Tails, motion: Floats) -> tuple[Floats, ...]:
    terms: tuple[Floats, ...] = wrench_terms(
        tails.zeta_perp, tails.zeta_parallel, tails.offset, tails.number, motion.T
    )
    return terms
