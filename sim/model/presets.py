"""The paper's robots by name, and the numbers of its control example.

Source: Du, Miller, Jawed (arXiv 2103.05712). The paper has two sets of coefficients, one in its section on control
and one fitted to its experiments. Both are here.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

from sim.model.robot import Robot


class ControlExample(NamedTuple):
    """Groups of the paper's control example. The sizes of some effects are relative to it."""

    l_over_R: float = 6.875
    L_over_R: float = 3.75
    l_over_r0: float = 34.375
    omega_bar: float = 10.0


CONTROL = ControlExample()

_MEASURED_SPEED = 143.66 * 2 * math.pi / 60  # rad/s
_FITTED = {"C_t": 4.0, "C_r": 2.06, "C_yr": 6.0}


def _paper(name: str, **changes: object) -> Robot:
    base = Robot(
        name=name,
        tails=2,
        tail_length=0.11,
        tail_radius=3.2e-3,
        youngs_modulus=1.2e6,
        head_radius=0.016,
        head_length=0.06,
        viscosity=1.49,
        motor_speed=1.0,
        C_t=3.0,
        C_r=2.8,
        C_yr=2.0,
    )
    return replace(base, **changes)  # type: ignore[arg-type]


PRESETS: dict[str, Robot] = {
    # Control section: N = 2, ω̄ = ±10, C = (3.0, 2.8, 2.0).
    "paper-control": _paper("paper-control").with_motor(CONTROL.omega_bar),
    # The same robot with four tails, for the triangle of its first figure (N = 4, l = 11 cm). The paper does not
    # give the motor speed there. In the model tails stay apart at ω̄ = 10 and touch at the measured 143.66 rpm.
    "paper-triangle": _paper("paper-triangle", tails=4).with_motor(CONTROL.omega_bar),
    # Its one measured point: N = 4, l = 11 cm, 143.66 rpm.
    "paper-measured": _paper("paper-measured", tails=4, motor_speed=_MEASURED_SPEED, **_FITTED),
}

# Motion of paper-control by another program for the same equations: 32 edges, converged in the step.
INDEPENDENT = {
    "omega_t_bar": 7.589,
    "omega_h_bar": -2.411,
    "omega_yr_bar": 0.0490,
    "v_x": 0.0425,
    "v_z": 0.0180,
    "R_yr_over_l": 0.9415,
    "theta_deg": 67.1,
}
