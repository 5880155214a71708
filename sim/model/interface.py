"""Side force on the head from the viscosity profile near the air-fluid interface.

A head that spins at ω_h just under the surface meets more resistance below than above, where it is hardly wetted.
So it is pushed sideways. With a smoothed step in viscosity

    μ(y) = μ0 / (1 + exp(k (y − h)/R)),   y = R sin ϑ,

the traction on a wall element R dϑ dz is μ ω_h R dϑ dz along −e_ϑ. The sum over the wall is

    F_x = c μ0 R L ω_h,   c = ∫₀^2π sin ϑ / (1 + exp(k (sin ϑ − h/R))) dϑ,   F_y = 0.

c = −1.4026 for the paper's profile (h = 0.7 R, k = 20; the paper prints −1.403). The limit of a sharp step is
−2 √(1 − (h/R)²) = −1.4283. The true profile is not known, so in the model the coefficient C_yr replaces −c:
F_x = −C_yr μ0 R L ω_h.

Left out: the flow that the profile itself would cause. The profile is an assumption, not a solution.
Source: Du, Miller, Jawed (arXiv 2103.05712), the head's force model.
"""

from __future__ import annotations

import numpy as np
from scipy.integrate import quad
from scipy.special import expit

PAPER_DEPTH_OVER_R = 0.7
PAPER_STEEPNESS = 20.0


def side_force_coefficient(depth_over_R: float = PAPER_DEPTH_OVER_R, steepness: float = PAPER_STEEPNESS) -> float:
    """Coefficient c of F_x = c μ0 R L ω_h, dimensionless.

    Args:
        depth_over_R: h/R, height of the viscosity step above the head's axis, in head radii.
        steepness: k, sharpness of the step, dimensionless.

    Returns:
        c, negative for a head whose upper part is out of the fluid; absolute error below 1e-10.
    """

    def traction(angle: float) -> float:
        height = np.sin(angle)
        return float(height * expit(-steepness * (height - depth_over_R)))

    # Symmetric about ϑ = π/2: integrate half the wall, with the step as a break point.
    step = np.arcsin(np.clip(depth_over_R, -1.0, 1.0))
    half, _ = quad(traction, -np.pi / 2, np.pi / 2, points=[step], limit=200, epsabs=1e-12)
    return 2.0 * half
