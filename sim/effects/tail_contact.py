"""Tails that cannot pass through each other.

    f = F ln(1 + exp((2 r0 − d)/0.008 r0))   per length, where the axes of two tails are d apart

F grows with the size: F = 100 EI/l³ (1000^ε − 1)/999. At ε = 1 tails that touch stay 2 r0 apart to within 2 %
over the range of the shipped sweep. By Hertz (f = π/4 E* δ) rubber tails of l/r0 = 34 are twice as hard, and
those of l/r0 = 15 are a fifth as hard. At small ε tails overlap. Most of what contact does to the motion is
there long before tails are hard. On a linear scale all of it would be near zero. Left out: friction, and the
fluid between the tails, which slows their approach.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from common.arrays import Floats
from sim.model.effect import Effect
from sim.model.groups import Groups

_FIRM = 500.0  # EI/l³, force per length at an overlap of 2 % and ε = 1: five softness lengths, so 5 F
_BASE = 1000.0
_KEPT = 0.98  # gap that contact keeps


def _number(size: Floats, groups: Groups) -> Floats:
    return _FIRM * (_BASE**size - 1) / (_BASE - 1)


EFFECT = Effect(
    name="tail_contact",
    title="contact between tails",
    equation="f = F(ε) ln(1 + exp((2 r0 − d)/0.008 r0))",
    source="Tong, Choi, Joo and Jawed, Extreme Mech. Lett. 58, 101924 (2023)",
    unit="1: gaps kept to 2 %",
    bounds=(0.0, 1.2),
    typical=1.0,
    plausible=(0.6, 1.2),
    reach="nonlocal",
    number=_number,
)


def least_gap(size: ArrayLike) -> Floats:
    """Return the gap between tails down to which the model holds, by size of this effect: 1 without it, else 0.98.

    A row of the base model is valid while tails do not touch. With contact it is valid while the gap is kept.
    """
    return np.where(np.asarray(size, dtype=float) > 0, _KEPT, 1.0)
