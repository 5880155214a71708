"""A motor that slows down under load.

    ω_t − ω_h = ω − ε T/(μ0 l³),   T = 8π C_r μ R³ |ω_h| the torque that the motor carries

The paper's motor holds its set speed. A direct-current motor on a fixed voltage loses speed in proportion to its
torque. Then |ω_h| + |ω_t| is less than the set speed |ω|. The torque is that of the head. It changes with all
effects that change the head's spin drag. Left out: slip, which is proportional to the speed, not to the torque.
"""

from __future__ import annotations

from common.arrays import Floats
from sim.model.body import Body
from sim.model.effect import Effect
from sim.model.groups import Groups


def _adds(size: Floats, groups: Groups, body: Body) -> Body:
    return body.plus(droop=size)


EFFECT = Effect(
    name="motor_droop",
    title="droop of the motor under load",
    equation="ω_t − ω_h = ω − ε T/(μ0 l³)",
    source="torque-speed line of a direct-current motor on fixed voltage",
    unit="1/(μ0 l³)",
    bounds=(0.0, 20.0),
    typical=0.5,
    plausible=(0.0, 5.0),
    dissipative=True,
    similar=False,  # the motor's loss of speed per torque is its own
    adds=_adds,
)
