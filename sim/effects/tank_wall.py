"""The wall of a tank that is not much wider than the head.

    F = −6π μ0 R C_t v × 1/(1 − 2.104 x + 2.089 x³ − 0.948 x⁵),   x = d/D

Walls hold the fluid back. So a body of diameter d has more drag in a vessel of diameter D than far from walls. The
correction is that of a sphere on the axis of a tube (Faxén, Haberman). It can be found only from runs in several
tanks: in one tank, a larger C_t does the same.
"""

from __future__ import annotations

import numpy as np

from common.arrays import Floats
from sim.model.body import Body, head_resistance
from sim.model.effect import Driver, Effect
from sim.model.groups import Groups


def _adds(size: Floats, groups: Groups, body: Body) -> Body:
    factor = 1 / (1 - 2.104 * size + 2.089 * size**3 - 0.948 * size**5)
    more = head_resistance(groups.C_t * (factor - 1), 0.0, 0.0, body.head_radius, body.head_length)
    return body.plus(resistance=np.array(more))


EFFECT = Effect(
    name="tank_wall",
    title="wall of the tank",
    equation="F = −6π μ0 R C_t v/(1 − 2.104 ε + 2.089 ε³ − 0.948 ε⁵)",
    source="Faxén (1922); Haberman and Sayre (1958)",
    unit="d/D",
    bounds=(0.0, 0.7),
    typical=0.1,
    dissipative=True,
    drivers=(
        Driver(
            "wall_of_the_tank",
            "wall of the tank",
            "head_over_tank",
            "of the correction for a sphere",
            (0.0, 2.0),
            1.0,
            (0.3, 1.5),
        ),
    ),
    adds=_adds,
)
