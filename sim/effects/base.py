"""The contract of an effect: something physical that the base model leaves out.

An effect is one file in this folder with one instance of `Effect` named EFFECT. The folder finds its own
members (`sim.effects`); the simulator, sweep columns, calibration candidates, the documentation table and
one parametrised test read that list, so adding an effect is adding its file. An effect

1. has one size ε per robot, whose `null` makes the model *exactly* the base model;
2. declares its equation, source, unit of ε, bounds, its symmetry under ω → −ω ("even": left and right
   turns stay mirror images; "odd": they do not), whether it only dissipates, the covariate that a table
   must have to reveal it (None: the ordinary columns do), the effect that it needs beside it to be seen, if
   any, and a `typical` size for tests and scores;
3. says in `coefficients` how it changes those of the base model. The hook gets the size and the robots, broadcast
   over the batch (B,); it must be pure and differentiable in the size.

Hooks are applied in the order of the names. What an effect cannot say through `sim.coefficients` is a new entry
there, with its part in `sim.instant`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from torch import Tensor

if TYPE_CHECKING:
    from sim.coefficients import Coefficients
    from sim.robot import Groups


@dataclass(frozen=True)
class Effect:
    """Declaration of an effect; subclasses override hooks. Sizes ε are dimensionless."""

    name: str  # column name and identifier, e.g. "end_over_end_drag"
    title: str  # what a person calls it
    equation: str
    source: str
    unit: str
    null: float
    bounds: tuple[float, float]
    typical: float
    symmetry: Literal["even", "odd"]
    dissipative: bool
    covariate: str | None = None
    beside: str = ""  # the effect without which this one shows nothing

    def coefficients(self, size: Tensor, groups: Groups, base: Coefficients) -> Coefficients:
        """Drag and motor: the changed coefficients of the balance."""
        return base
