"""Resistive force theory: the fluid's loads on tails and head at low Reynolds number.

Tails (per node, Voronoi length l_k, unit tangent t, velocity v in the lab):

    q = −l_k [ζ⊥ v + (ζ∥ − ζ⊥) (t·v) t],   ζ∥ = 2π μ0/(ln(l/r0) − ½),   ζ⊥ = 4π μ0/(ln(l/r0) + ½).

Head (velocity of its centre v_c, spin ω_h about the axis; x across, z along the axis):

    F = −6π μ0 R C_t v_c − C_yr μ0 R L ω_h e_x,     M_z = −8π μ0 R³ C_r ω_h.

Both are linear in velocity. The loads on head and disc are a resistance matrix R times the generalized velocity
(v_x, v_z, ω_yr, ω_h, ω_t) of the disc centre J, which is L/2 behind the head's centre:
wrench (F_x, F_z, M_y, M_z) about J = −R (v_x, v_z, ω_yr, ω_h, ω_t).

Units: length l, time μ0 l⁴/EI, force EI/l² (so μ0 = 1). Validity: slender tails (l/r0 ≳ 10), no
inertia. Left out here: interactions between tails, head and surface; the head's end-over-end drag.
Source: Du, Miller, Jawed (arXiv 2103.05712), hydrodynamic model; Gray and Hancock (1955).
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from sim.jit import formula
from sim.linear.vectors import Matrix, Vector, dot, minus, outer, plus, plus_identity, times


@formula
def tail_coefficients(l_over_r0: Any) -> tuple[Any, Any]:
    """Compute the drag coefficients per length (ζ∥, ζ⊥) in units of μ0."""
    log_slenderness = np.log(l_over_r0)
    return 2 * math.pi / (log_slenderness - 0.5), 4 * math.pi / (log_slenderness + 0.5)


@formula
def head_resistance(
    C_t: Any, C_r: Any, C_yr: Any, head_radius: Any, head_length: Any
) -> tuple[tuple[Any, ...], ...]:
    """Compute R of the head about J in the paper's model: four rows of five entries.

    Args:
        C_t, C_r, C_yr: drag, spin and side-force coefficients.
        head_radius, head_length: R/l and L/l.
    """
    lever = head_length / 2
    translation = 6 * math.pi * C_t * head_radius
    spin = 8 * math.pi * C_r * head_radius**3
    side = C_yr * head_radius * head_length
    none = 0.0 * translation
    return (
        (translation, none, translation * lever, side, none),
        (none, translation, none, none, none),
        (translation * lever, none, translation * lever**2, side * lever, none),
        (none, none, none, spin, none),
    )


@formula
def node_drag(tangent: Vector, velocity: Vector, perp: Any, excess: Any) -> Vector:
    """Compute q = −[perp v + excess (t·v) t], with perp = l_k ζ⊥ and excess = l_k (ζ∥ − ζ⊥)."""
    return times(-1, plus(times(perp, velocity), times(excess * dot(tangent, velocity), tangent)))


@formula
def node_resistance(tangent: Vector, perp: Any, excess: Any) -> Matrix:
    """Compute −∂q/∂v = perp I + excess t⊗t."""
    return plus_identity(outer(times(excess, tangent), tangent), perp)


@formula
def drag_by_tangents(tangent: Vector, spread: Any, velocity: Vector, excess: Any) -> Matrix:
    """Compute −∂q/∂S for a node tangent t = S/|S| (S: sum of the adjacent edge tangents, |S| = spread).

    excess/|S| [t⊗v + (t·v) I] (I − t⊗t).
    """
    along = dot(tangent, velocity)
    scale = excess / spread
    tilt = outer(times(scale, tangent), minus(velocity, times(2 * along, tangent)))
    return plus_identity(tilt, scale * along)
