"""Linear theory of nearly straight tails: the limit of the simulator for small deflections.

A tail at distance a from the axis, turning steadily at ω_t, with w = x + iy in the frame of the disc:

    w'''' = −i S w,   S = ζ⊥ ω_t l⁴/EI,   w(0) = a, w'(0) = 0, w''(l) = w'''(l) = 0

    thrust = (ζ⊥ − ζ∥) ω_t ∫ Im(w* w') ds,   torque = ζ⊥ ω_t ∫ |w|² ds

Balance of the robot: the torque of N tails is equal to that of the head, 8π C_r R³ |ω_h|. The thrust is equal to
the drag of head and tails along the axis. The head's side force is balanced by the drag of head and straight tails
across the axis. Left out: the side force of the tails, and bending by sway and yaw.
Units: l, μ0 l⁴/EI, EI/l². Source: Wiggins and Goldstein (1998) for the operator; the drag is that of
`sim.mechanics.drag`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq

from sim.mechanics.drag import tail_coefficients
from sim.model.groups import Groups

_POINTS = 400


@dataclass(frozen=True)
class LinearMotion:
    """One robot in linear theory; thrust [EI/l²] and torque [EI/l] are those of all tails."""

    omega_t: float
    omega_yr: float
    v_x: float  # of the head's centre
    v_z: float
    thrust: float
    torque: float


def linear_filament(S: float) -> tuple[float, float, float]:
    """Compute thrust/[(ζ⊥ − ζ∥) ω_t a²], torque/[ζ⊥ ω_t a² l] and tip offset/a of one tail at a drag number S."""
    if abs(S) < 1e-9:
        return 0.0, 1.0, 1.0
    roots = (-1j * S) ** 0.25 * np.array([1, 1j, -1, -1j])
    ends = np.exp(roots)
    rows = [np.ones(4), roots, roots**2 * ends, roots**3 * ends]
    amplitude = np.linalg.solve(np.array(rows), np.array([1, 0, 0, 0]))
    arc = np.linspace(0, 1, _POINTS + 1)
    waves = np.exp(np.outer(arc, roots))
    w, slope = waves @ amplitude, waves @ (roots * amplitude)
    thrust = np.trapezoid((w.conj() * slope).imag, arc)
    return abs(float(thrust)), float(np.trapezoid(np.abs(w) ** 2, arc)), float(abs(w[-1]))


def linear_motion(groups: Groups) -> LinearMotion:
    """Apply linear theory to the one robot in `groups` (effects are left out)."""
    parallel, perp = (c.item() for c in tail_coefficients(groups.l_over_r0))
    R, omega, tails = 1 / groups.l_over_R.item(), groups.omega_bar.item(), groups.N
    length, a = groups.L_over_R.item() * R, groups.a_over_R.item() * R
    spin_drag = 8 * math.pi * groups.C_r.item() * R**3
    speed = abs(omega)

    def torque(omega_t: float) -> float:
        return tails * perp * omega_t * a**2 * linear_filament(perp * omega_t)[1]

    omega_t = float(brentq(lambda w: torque(w) - spin_drag * (speed - w), 0.0, speed))
    thrust = tails * (perp - parallel) * omega_t * a**2 * linear_filament(perp * omega_t)[0]
    drag = 6 * math.pi * groups.C_t.item() * R
    surge = thrust / (drag + tails * parallel)
    lever = length / 2
    # Across the axis, about J: head at +L/2, straight tails from 0 to −l.
    across = np.array(
        [[drag + tails * perp, drag * lever - tails * perp / 2],
         [drag * lever - tails * perp / 2, drag * lever**2 + tails * perp / 3]]
    )  # fmt: skip
    push = groups.C_yr.item() * R * length * (speed - omega_t)
    sway, yaw = np.linalg.solve(across, push * np.array([1, lever]))
    sense = math.copysign(1.0, omega)
    return LinearMotion(
        omega_t=sense * omega_t,
        omega_yr=sense * float(yaw),
        v_x=sense * float(sway + yaw * lever),
        v_z=surge,
        thrust=thrust,
        torque=sense * torque(omega_t),
    )
