"""Discrete elastic rod with material frames: bending, stretching and twisting, natural curvature and twist.

Each edge carries a reference frame (d1, d2, t) and a twist angle θ; its material frame is
m1 = cos θ d1 + sin θ d2, m2 = −sin θ d1 + cos θ d2. Reference frames are carried in time by parallel
transport from an earlier configuration, so θ alone counts twist. At the node between edges e and f:

    κ1 = ½ κb·(m2_e + m2_f),   κ2 = −½ κb·(m1_e + m1_f),   κb = 2 t_e × t_f / (1 + t_e·t_f)
    τ  = θ_f − θ_e + (angle from the transported d1_e to d1_f about t_f)

    E_s = ½ EA Σ (|e|/h − 1)² h
    E_b = ½ EI Σ (|κb|² − 2 κ·κ⁰ + |κ⁰|²) / l_k       (isotropic: |κ| = |κb|)
    E_t = ½ GJ Σ (τ − τ⁰)² / l_k,   GJ/EI = 2/3 for an incompressible rod (G = E/3)

Without load, the paper's tails are straight and untwisted. Then the twist of a rod with a free end relaxes to zero
for any shape and makes no force. So `sim.mechanics.rod` (no frames, analytic stiffness) is the same rod; tests
show both. This module is the reference for it, and it has natural curvature κ⁰ and twist τ⁰. Forces and stiffness
come from automatic differentiation of the energy. It has no batches and is not used in time steps.

Units: EI = 1, l = 1. Source: Bergou et al. (2008, 2010); Jawed et al. (2018); the paper's eqs. 1-3.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

TWIST_STIFFNESS = 2 / 3  # GJ/EI for ν = ½


def transport(vector: Tensor, start: Tensor, end: Tensor) -> Tensor:
    """Transport vectors (..., 3) in parallel from unit tangents `start` to `end`."""
    axis = torch.linalg.cross(start, end)
    cosine = (start * end).sum(-1, keepdim=True)
    along = (axis * vector).sum(-1, keepdim=True) / (1 + cosine)
    return cosine * vector + torch.linalg.cross(axis, vector) + along * axis


def signed_angle(start: Tensor, end: Tensor, axis: Tensor) -> Tensor:
    """Compute the angle [rad] from `start` to `end` about unit `axis`, in (−π, π]."""
    return torch.atan2((torch.linalg.cross(start, end) * axis).sum(-1), (start * end).sum(-1))


@dataclass(frozen=True)
class Frames:
    """Reference frames of m edges at some configuration: tangents and first directors, (m, 3) each."""

    tangent: Tensor
    director: Tensor

    @staticmethod
    def along(tangent: Tensor, first: Tensor) -> Frames:
        """Make frames without twist: `first` (3,) carried along the edges by parallel transport."""
        directors = [first]
        for k in range(1, len(tangent)):
            directors.append(transport(directors[-1], tangent[k - 1], tangent[k]))
        return Frames(tangent, torch.stack(directors))

    def carried(self, tangent: Tensor) -> Tensor:
        """Carry directors to new tangents (m, 3): parallel transport in time."""
        return transport(self.director, self.tangent, tangent)


@dataclass(frozen=True)
class FramedRod:
    """Material of a rod whose nodes join edge k − 1 to edge k; arrays over the K joints."""

    axial_stiffness: float
    voronoi: Tensor  # (K,) l_k
    natural_curvature: Tensor  # (K, 2)
    natural_twist: Tensor  # (K,)
    twist_stiffness: float = TWIST_STIFFNESS

    def joint_energy(self, before: Tensor, after: Tensor, d_before: Tensor, d_after: Tensor,
                     theta_before: Tensor, theta_after: Tensor) -> Tensor:  # fmt: skip
        """Compute the bending and twisting energy of K joints: tangents and directors (K, 3), angles (K,)."""
        cosine = (before * after).sum(-1)
        binormal = 2 * torch.linalg.cross(before, after) / (1 + cosine).unsqueeze(-1)
        m1 = _turned(d_before, before, theta_before) + _turned(d_after, after, theta_after)
        m2 = torch.linalg.cross(before, _turned(d_before, before, theta_before)) + torch.linalg.cross(
            after, _turned(d_after, after, theta_after)
        )
        curvature = torch.stack([(binormal * m2).sum(-1), -(binormal * m1).sum(-1)], -1) / 2
        natural = self.natural_curvature
        square = (binormal**2).sum(-1) - 2 * (curvature * natural).sum(-1) + (natural**2).sum(-1)
        reference = signed_angle(transport(d_before, before, after), d_after, after)
        twist = theta_after - theta_before + reference - self.natural_twist
        return (0.5 * (square + self.twist_stiffness * twist**2) / self.voronoi).sum()

    def clamped_energy(self, nodes: Tensor, theta: Tensor, root: Frames, frames: Frames) -> Tensor:
        """Compute the energy of a rod clamped at node 0 along `root` (one frame, angle 0) with a free end.

        Args:
            nodes: (n + 1, 3).
            theta: twist angle of each edge, (n,).
            root: frame of the clamp, (1, 3).
            frames: reference frames of the edges at an earlier configuration.
        """
        edge = nodes[1:] - nodes[:-1]
        length = edge.norm(dim=-1)
        tangent = edge / length.unsqueeze(-1)
        director = frames.carried(tangent)
        zero = theta.new_zeros(1)
        joints = self.joint_energy(
            torch.cat([root.tangent, tangent[:-1]]),
            tangent,
            torch.cat([root.director, director[:-1]]),
            director,
            torch.cat([zero, theta[:-1]]),
            theta,
        )
        return joints + _stretching(length, self.axial_stiffness)

    def ring_energy(self, nodes: Tensor, theta: Tensor, frames: Frames) -> Tensor:
        """Compute the energy of a closed ring: nodes (n, 3), joint k between edges k − 1 and k, joint 0 welded."""
        edge = torch.roll(nodes, -1, 0) - nodes
        length = edge.norm(dim=-1)
        tangent = edge / length.unsqueeze(-1)
        director = frames.carried(tangent)
        joints = self.joint_energy(
            torch.roll(tangent, 1, 0), tangent, torch.roll(director, 1, 0), director, torch.roll(theta, 1), theta
        )
        return joints + _stretching(length, self.axial_stiffness)


def _turned(director: Tensor, tangent: Tensor, theta: Tensor) -> Tensor:
    """Turn the director: m1 = cos θ d1 + sin θ t × d1."""
    c, s = torch.cos(theta).unsqueeze(-1), torch.sin(theta).unsqueeze(-1)
    return c * director + s * torch.linalg.cross(tangent, director)


def _stretching(length: Tensor, axial_stiffness: float) -> Tensor:
    n = len(length)
    return 0.5 * axial_stiffness * ((length * n - 1) ** 2).sum() / n
