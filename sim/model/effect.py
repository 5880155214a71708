"""The contract of an effect: something physical that the base model leaves out.

An effect is one file in `sim/effects` with one instance of `Effect` named EFFECT. The folder finds its own
members; the simulator, sweep columns, calibration candidates, the table in the docs and the tests read that list.
So adding an effect is adding its file. An effect

1. has one size ε per robot. At its `null` the model is exactly the base model;
2. declares its equation, source, unit of ε, bounds, a `typical` size for tests and scores, its symmetry under
   ω → −ω ("even": left and right turns stay mirror images; "odd": they do not), whether it only dissipates,
   whether it keeps dynamic similarity, the sizes that are plausible by its source (outside, a claim is "in form
   like" the effect), what drives it from run to run, and the effect that it needs beside it to be seen, if any.
   An effect with a second number (exponent, time) has it as another effect beside it, with a `grid`;
3. acts in one of three ways, by a function that is analytic in ε and the groups (`sim.linear.complex_step`):
   - `adds` returns the body with terms added, which must not depend on what is there already;
   - `scales` returns factors on drag, which multiply;
   - a non-local effect (`reach`) has a number of its own in `Body.nonlocal_terms`, from `number`, and its formula
     in `sim.mechanics` is called where the balance is summed up (`sim.solve.residual`).

Terms are added first, then the factors multiply. So the order of the effects does not matter.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Literal, NamedTuple

from common.arrays import Floats
from sim.model.body import Body
from sim.model.groups import Groups


class Factors(NamedTuple):
    """What an effect multiplies, each (B,) or 1."""

    viscosity: Floats | float = 1.0  # everything that drags, and the flow that a force makes
    drag: Floats | float = 1.0  # drag of head, disc and tails
    tail_drag: Floats | float = 1.0  # drag of the tails alone


@dataclass(frozen=True)
class Driver:
    """A noted quantity that makes an effect differ from run to run: size = null + ε × quantity."""

    name: str  # of the candidate in a calibration
    title: str  # in words
    column: str  # of the noted quantity, see `calibration.swimmer.measured_table`
    unit: str  # of ε
    bounds: tuple[float, float]  # of its size
    typical: float  # a size that is often met
    plausible: tuple[float, float]  # sizes that its source allows


def _no_term(size: Floats, groups: Groups, body: Body) -> Body:
    return body


def _no_factor(size: Floats, groups: Groups) -> Factors:
    return Factors()


def _size(size: Floats, groups: Groups) -> Floats:
    return size


@dataclass(frozen=True)
class Effect:
    """Declaration of an effect, with one of the three ways to act. Sizes ε are dimensionless.

    Example:
        >>> from softflagella import effects
        >>> sorted(name for name, effect in effects().items() if effect.symmetry == "odd")
        ['left_right_bias', 'natural_curvature', 'natural_twist']
    """

    name: str  # column name and identifier, e.g. "end_over_end_drag"
    title: str  # what a person calls it
    equation: str  # as text, with the size ε
    source: str  # author and year, or where it follows from
    bounds: tuple[float, float]  # least and largest size
    typical: float  # a size that is often met
    unit: str = "1"  # of the size ε
    null: float = 0.0  # size at which the base model comes back exactly
    symmetry: Literal["even", "odd"] = "even"  # whether a reversed motor mirrors the motion ("even")
    dissipative: bool = False  # it can only take energy out
    similar: bool = True  # the motion at viscosity f and speed ω is that at viscosity 1 and speed f ω
    reach: Literal["local", "nonlocal"] = "local"  # whether it couples nodes of the tails
    is_drag: bool = False  # of a non-local effect: its number grows with drag
    drivers: tuple[Driver, ...] = ()  # if any, the effect is seen through them alone
    plausible: tuple[float, float] | None = None  # sizes that its source allows; None: all within the bounds
    beside: str = ""  # the effect without which this one shows nothing
    grid: tuple[float, ...] = ()  # sizes at which a calibration looks for `beside`, whose second number this is
    adds: Callable[[Floats, Groups, Body], Body] = field(default=_no_term, compare=False, repr=False)  # its terms
    scales: Callable[[Floats, Groups], Factors] = field(default=_no_factor, compare=False, repr=False)  # factors
    number: Callable[[Floats, Groups], Floats] = field(default=_size, compare=False, repr=False)  # if nonlocal

    @property
    def term(self) -> str:
        """Name of the effect whose term it is; a non-local effect has this name in `Body.nonlocal_terms`."""
        return self.name
