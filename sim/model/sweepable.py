"""Inputs of a robot that can be swept, by the name of their option, and how a range is written.

No numbers are computed here, so that a command line can list its options at once.
"""

from __future__ import annotations

import math
from pathlib import Path

from sim.io.errors import InputError
from sim.model.slopes import SLOPE_INPUTS

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
