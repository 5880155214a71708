"""The numbers of one robot: everything that its balance of forces depends on.

`Body` is the only list of these numbers. `sim.solve.assembly` fills it for a batch of robots as arrays, with
effects. The compiled loops get it as numbers, one robot at a time. Packing, unpacking and derivatives follow from
its fields and their shapes; `PLACES` tells where each is in a row of numbers.

Some effects reach further than one node of a straight, untwisted, elastic tail. Their numbers are in
`nonlocal_terms`, each under the name of its effect.

Drag on the head at low Reynolds number, with the velocity of its centre v_c and its spin ω_h about the axis (x
across, z along the axis), is

    F = −6π μ0 R C_t v_c − C_yr μ0 R L ω_h e_x,     M_z = −8π μ0 R³ C_r ω_h.

It is linear in velocity. So the drag on head and disc is a resistance matrix R times the generalized velocity
(v_x, v_z, ω_yr, ω_h, ω_t) of the disc centre J, which is L/2 behind the head's centre:
wrench (F_x, F_z, M_y, M_z) about J = −R (v_x, v_z, ω_yr, ω_h, ω_t). Left out: the head's end-over-end drag.
Source: Du, Miller, Jawed (arXiv 2103.05712), hydrodynamic model.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import accumulate, pairwise
from typing import Annotated, Any, NamedTuple, get_type_hints

import numpy as np

from sim.jit import formula


class Meaning(NamedTuple):
    """Unit, meaning and shape of an entry; μ0, l and EI/(μ0 l⁴) are 1 inside the simulator."""

    unit: str
    words: str
    shape: tuple[int, ...] = ()


class Body(NamedTuple):
    """One robot, or a batch of B robots while effects are applied; then every entry ends with (B,).

    Single numbers come first.
    """

    omega: Annotated[Any, Meaning("EI/(μ0 l⁴)", "ω̄, motor speed, tails relative to head")]
    offset: Annotated[Any, Meaning("l", "a/l, distance of the clamps from the axis")]
    head_radius: Annotated[Any, Meaning("l", "R/l")]
    head_length: Annotated[Any, Meaning("l", "L/l")]
    tail_radius: Annotated[Any, Meaning("l", "r0/l")]
    axial_stiffness: Annotated[Any, Meaning("EI/l²", "EA of a tail")]
    viscosity: Annotated[Any, Meaning("μ0", "viscosity of the fluid")]
    zeta_parallel: Annotated[Any, Meaning("μ0", "ζ∥, drag per length along a tail")]
    zeta_perp: Annotated[Any, Meaning("μ0", "ζ⊥, drag per length across a tail")]
    droop: Annotated[Any, Meaning("1/(μ0 l³)", "speed that the motor loses per torque")]
    resistance: Annotated[Any, Meaning("μ0, l", "R of head and disc about J", (4, 5))]
    tail_load: Annotated[Any, Meaning("EI/l³", "force per length on the tails along e_x, e_y, e_z", (3,))]
    nonlocal_terms: Annotated[Any, Meaning("", "numbers of the effects that reach further than one node", (-1,))]

    def plus(self, **parts: Any) -> Body:
        """Add `parts` to the fields of their names."""
        return self._replace(**{name: getattr(self, name) + value for name, value in parts.items()})

    def with_resistance(self, entries: Mapping[tuple[int, int], Any]) -> Body:
        """Add `entries` (row, column) to the resistance of head and disc."""
        resistance = self.resistance.astype(np.result_type(self.resistance, *entries.values()))
        for index, value in entries.items():
            resistance[index] = resistance[index] + value
        return self._replace(resistance=resistance)


def places(shapes: Sequence[tuple[int, ...]]) -> list[Any]:
    """Tell where entries of these shapes are in a row of numbers: an index of a single number, else a slice."""
    ends = accumulate(map(math.prod, shapes), initial=0)
    return [
        slice(start, None if -1 in shape else end) if shape else start
        for shape, (start, end) in zip(shapes, pairwise(ends), strict=True)
    ]


SHAPES = Body._make(hint.__metadata__[0].shape for hint in get_type_hints(Body, include_extras=True).values())
SINGLE = SHAPES.count(())
PLACES = Body._make(places(SHAPES))


@formula
def head_resistance(
    C_t: Any, C_r: Any, C_yr: Any, head_radius: Any, head_length: Any
) -> tuple[tuple[Any, ...], ...]:
    """Compute R of the head about J in the paper's model: four rows of five entries.

    Args:
        C_t, C_r, C_yr: drag, spin and side-force coefficients.
        head_radius, head_length: R/l and L/l.
    """
    lever = head_length / 2
    translation = 6 * math.pi * C_t * head_radius
    spin = 8 * math.pi * C_r * head_radius**3
    side = C_yr * head_radius * head_length
    none = 0.0 * translation
    return (
        (translation, none, translation * lever, side, none),
        (none, translation, none, none, none),
        (translation * lever, none, translation * lever**2, side * lever, none),
        (none, none, none, spin, none),
    )
