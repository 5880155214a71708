"""The numbers of one robot: everything that its balance of forces depends on.

`Body` is the only list of these numbers. `sim.solve.assembly` fills it for a batch of robots as arrays, with
effects. The compiled loops get it as numbers, one robot at a time. Packing, unpacking and derivatives follow from
its fields.

Some effects reach further than one node of a straight, untwisted, elastic tail. Their numbers are in
`nonlocal_terms`, each under the name of its effect.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, NamedTuple

import numpy as np


class Meaning(NamedTuple):
    """Unit and meaning of a number; μ0, l and EI/(μ0 l⁴) are 1 inside the simulator."""

    unit: str
    words: str


class Body(NamedTuple):
    """One robot, or a batch of B robots while effects are applied; then every entry ends with (B,)."""

    omega: Annotated[Any, Meaning("EI/(μ0 l⁴)", "ω̄, motor speed, tails relative to head")]
    offset: Annotated[Any, Meaning("l", "a/l, distance of the clamps from the axis")]
    head_radius: Annotated[Any, Meaning("l", "R/l")]
    head_length: Annotated[Any, Meaning("l", "L/l")]
    tail_radius: Annotated[Any, Meaning("l", "r0/l")]
    axial_stiffness: Annotated[Any, Meaning("EI/l²", "EA of a tail")]
    viscosity: Annotated[Any, Meaning("μ0", "viscosity of the fluid")]
    zeta_parallel: Annotated[Any, Meaning("μ0", "ζ∥, drag per length along a tail")]
    zeta_perp: Annotated[Any, Meaning("μ0", "ζ⊥, drag per length across a tail")]
    resistance: Annotated[Any, Meaning("μ0, l", "(4, 5), R of head and disc about J, see sim.mechanics.drag")]
    droop: Annotated[Any, Meaning("1/(μ0 l³)", "speed that the motor loses per torque")]
    tail_load: Annotated[Any, Meaning("EI/l³", "(3,), force per length on the tails along e_x, e_y, e_z")]
    nonlocal_terms: Annotated[Any, Meaning("", "numbers of the effects that reach further than one node")]

    def plus(self, **parts: Any) -> Body:
        """Add `parts` to the fields of their names."""
        return self._replace(**{name: getattr(self, name) + value for name, value in parts.items()})

    def with_resistance(self, entries: Mapping[tuple[int, int], Any]) -> Body:
        """Add `entries` (row, column) to the resistance of head and disc."""
        resistance = self.resistance.astype(np.result_type(self.resistance, *entries.values()))
        for place, value in entries.items():
            resistance[place] = resistance[place] + value
        return self._replace(resistance=resistance)
