"""Side force on the head from the viscosity profile near the air-fluid interface.

A head that spins at ω_h just under the surface meets more resistance below than above, where it is hardly wetted.
So it is pushed sideways. With a smoothed step in viscosity

    μ(y) = μ0 / (1 + exp(k (y − h)/R)),   y = R sin ϑ,

the traction on a wall element R dϑ dz is μ ω_h R dϑ dz along −e_ϑ. The integral over the wall is

    F_x = c μ0 R L ω_h,   c = ∫₀^2π sin ϑ / (1 + exp(k (sin ϑ − h/R))) dϑ,   F_y = 0.

In the model the coefficient C_yr replaces −c, because the true profile is unknown: F_x = −C_yr μ0 R L ω_h.
Source: Du, Miller, Jawed (arXiv 2103.05712), the head's force model, which prints c = −1.403.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import expit

DEPTH_OVER_R, STEEPNESS = 0.7, 20.0  # the paper's h/R and k


def side_force_coefficient(steepness: float) -> float:
    """Return c of a viscosity step of some steepness k at the paper's depth."""

    def traction(angle: float) -> float:
        height = np.sin(angle)
        return float(height * expit(-steepness * (height - DEPTH_OVER_R)))

    # Symmetric about ϑ = π/2: half the wall, with the step as a break point.
    half, _ = quad(traction, -np.pi / 2, np.pi / 2, points=[np.arcsin(DEPTH_OVER_R)], limit=200, epsabs=1e-12)
    return 2.0 * half


def test_the_coefficient_of_the_paper_s_profile() -> None:
    assert side_force_coefficient(STEEPNESS) == pytest.approx(-1.4026, abs=1e-4)


def test_a_sharp_step() -> None:
    assert side_force_coefficient(5000.0) == pytest.approx(-2 * math.sqrt(1 - DEPTH_OVER_R**2), rel=1e-3)
