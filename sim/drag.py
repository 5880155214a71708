"""Resistive force theory: the fluid's loads on tails and head at low Reynolds number.

Tails (per node, Voronoi length l_k, unit tangent t, velocity v in the lab):

    q = −l_k [ζ⊥ v + (ζ∥ − ζ⊥) (t·v) t],   ζ∥ = 2π μ0/(ln(l/r0) − ½),   ζ⊥ = 4π μ0/(ln(l/r0) + ½).

Head (velocity of its centre v_c, spin ω_h about the axis; x across, z along the axis):

    F = −6π μ0 R C_t v_c − C_yr μ0 R L ω_h e_x,     M_z = −8π μ0 R³ C_r ω_h.

Both are linear in velocity. The head's load is written as a resistance in the generalized velocity
u = (v_x, v_z, ω_yr, ω_h) of the disc centre J, which lies L/2 behind the head's centre:
wrench (F_x, F_z, M_y, M_z) about J = −R_h u.

Units: length l, time μ0 l⁴/EI, force EI/l² (so μ0 = 1). Validity: slender tails (l/r0 ≳ 10), no
inertia. Left out here: interactions between tails, head and surface; the head's end-over-end drag.
Source: Du, Miller, Jawed (arXiv 2103.05712), hydrodynamic model; Gray and Hancock (1955).
"""

from __future__ import annotations

import math

import torch
from torch import Tensor

SMALLEST_SLENDERNESS = math.exp(0.5)  # ln(l/r0) = 1/2: ζ∥ diverges


def tail_coefficients(l_over_r0: Tensor) -> tuple[Tensor, Tensor]:
    """Drag coefficients per length (ζ∥, ζ⊥) in units of μ0; same shape as `l_over_r0`."""
    log_slenderness = torch.log(l_over_r0)
    return 2 * math.pi / (log_slenderness - 0.5), 4 * math.pi / (log_slenderness + 0.5)


def head_resistance(C_t: Tensor, C_r: Tensor, C_yr: Tensor, head_radius: Tensor, head_length: Tensor) -> Tensor:
    """Resistance matrix R_h of the head about the disc centre J.

    Args:
        C_t, C_r, C_yr: drag, spin and side-force coefficients, shape (B,).
        head_radius, head_length: R/l and L/l, shape (B,).

    Returns:
        (4, 4, B): rows (F_x, F_z, M_y, M_z), columns (v_x, v_z, ω_yr, ω_h); the wrench is −R_h u.
    """
    lever = head_length / 2
    translation = 6 * math.pi * C_t * head_radius
    spin = 8 * math.pi * C_r * head_radius**3
    side = C_yr * head_radius * head_length
    none = torch.zeros_like(translation)
    return torch.stack(
        [
            torch.stack([translation, none, translation * lever, side]),
            torch.stack([none, translation, none, none]),
            torch.stack([translation * lever, none, translation * lever**2, side * lever]),
            torch.stack([none, none, none, spin]),
        ]
    )
