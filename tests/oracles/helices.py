"""A rigid helix that turns in a viscous fluid: where resistive force theory fails, and what it leaves out.

A helix of radius R, pitch λ, axial length L and wire radius a turns about its axis at Ω, or moves along it at U.
With the pitch angle ψ, tan ψ = 2πR/λ, and the contour length L/cos ψ,

    thrust/(μΩR²) = (ζ⊥ − ζ∥) sin ψ cos ψ × length/R,
    torque/(μΩR³) = (ζ⊥ cos²ψ + ζ∥ sin²ψ) × length/R,    drag/(μUR) = (ζ⊥ sin²ψ + ζ∥ cos²ψ) × length/R,

with ζ∥ = 2π/(ln(2λ/a) − ½), ζ⊥ = 4π/(ln(2λ/a) + ½) after Gray and Hancock. They leave out the flow that one part
of the wire makes at another part: the Stokeslets of `sim.mechanics.flow`, spread over √e a, which is slender-body
theory (Keller and Rubinow 1976). Rodenborn et al. (2013) measured such helices.
"""

from __future__ import annotations

import numpy as np

from sim.arrays import Floats
from sim.compiling import compiled
from sim.mechanics.stokeslets import stokeslets

RADIUS, LENGTH, WIRE = 6.3, 130.0, 0.397  # mm, of Rodenborn et al. (2013)
PIECES = 480


def resistive(pitch: Floats) -> Floats:
    """Compute thrust, torque, drag of helices of pitch λ/R (m,), (m, 3), by resistive force theory."""
    angle = np.arctan(2 * np.pi / pitch)
    length, log = LENGTH / RADIUS / np.cos(angle), np.log(2 * pitch * RADIUS / WIRE)
    parallel, perp = 2 * np.pi / (log - 0.5), 4 * np.pi / (log + 0.5)
    s, c = np.sin(angle), np.cos(angle)
    forces = [(perp - parallel) * s * c, perp * c**2 + parallel * s**2, perp * s**2 + parallel * c**2]
    return np.stack(forces, 1) * length[:, None]


def with_flow(pitch: Floats, *, pieces: int = PIECES) -> Floats:
    """Compute the same with the flow of every segment of the wire at every other."""
    return np.array([_forces(float(p), pieces) for p in pitch])


def _forces(pitch: float, pieces: int) -> Floats:
    along = np.linspace(0.0, LENGTH / RADIUS, pieces + 1)
    nodes = _helix(along, pitch)
    middles = _helix((along[1:] + along[:-1]) / 2, pitch)
    spread = np.sqrt(np.e) * WIRE / RADIUS
    matrix = _mobility(nodes, middles, spread)
    spin = np.stack([-middles[:, 1], middles[:, 0], np.zeros(pieces)], 1)
    push = np.zeros_like(spin)
    push[:, 2] = 1.0
    turning, moving = (np.linalg.solve(matrix, v.reshape(-1)).reshape(-1, 3) for v in (spin, push))
    torque = (middles[:, 0] * turning[:, 1] - middles[:, 1] * turning[:, 0]).sum()
    return np.array([abs(turning[:, 2].sum()), torque, moving[:, 2].sum()])


def _helix(along: Floats, pitch: float) -> Floats:
    phase = 2 * np.pi * along / pitch
    return np.stack([np.cos(phase), np.sin(phase), along], 1)


@compiled
def _mobility(nodes: Floats, at: Floats, spread: float) -> Floats:
    """Compute the velocity at the middles of segments per force on each, (3 m, 3 m)."""
    m = len(at)
    matrix = np.empty((3 * m, 3 * m))
    for j in range(m):
        start, end = (nodes[j, 0], nodes[j, 1], nodes[j, 2]), (nodes[j + 1, 0], nodes[j + 1, 1], nodes[j + 1, 2])
        for i in range(m):
            place = (at[i, 0], at[i, 1], at[i, 2])
            for k, force in enumerate(((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))):
                velocity = stokeslets(place, start, end, force, spread)
                for c in range(3):
                    matrix[3 * i + c, 3 * j + k] = velocity[c]
    return matrix
