"""Inputs of a robot that can be swept, by the name of their option, and how a range is written.

SLOPE_INPUTS, groups of `sim.model.groups`, and SLOPE_OUTPUTS are the names in derivatives of the steady motion,
which `sim.motion.sensitivity` gives and data sets store; effects can be inputs, too. No numbers are computed here,
so that a command line can list its options at once.
"""

from __future__ import annotations

import math
from pathlib import Path

from sim.io.errors import InputError

SLOPE_INPUTS = ("C_t", "C_r", "C_yr", "l_over_R", "L_over_R", "l_over_r0", "omega_bar", "a_over_R")
SLOPE_OUTPUTS = ("omega_t_bar", "omega_h_bar", "omega_yr_bar", "v_x", "v_z", "R_yr_over_l", "theta_rad")
_EFFECTS = Path(__file__).parents[1] / "effects"
# Name of an input -> what it is.
SWEEPABLE = {
    **dict.fromkeys(SLOPE_INPUTS, "this dimensionless group"),
    **{file.stem: "the size of this effect" for file in sorted(_EFFECTS.glob("*.py")) if file.stem != "__init__"},
}


def read_range(name: str, text: str) -> tuple[float, float]:
    """Read LOW:HIGH.

    Raises:
        InputError: it is something else.
    """
    low, colon, high = text.partition(":")
    try:
        ends = float(low), float(high)
    except ValueError:
        ends = math.nan, math.nan
    if not colon or not all(map(math.isfinite, ends)):
        raise InputError(f"--{name} {text}; write two finite numbers as LOW:HIGH, such as 20:200")
    return ends
