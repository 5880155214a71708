"""Why a robot is outside a look-up table, in words."""

from __future__ import annotations

from sim.arrays import Floats
from surrogate.table.compiled_query import MOTION, REASON, STRANGE

_REASONS = (  # by the numbers of `surrogate.table.compiled_query`
    "",
    "none with as many tails were learned",
    "its tails or its motor were not learned, or no motion was found",
    "its tails move as none of the learned ones do",
    "it yaws nearly as fast as its tails turn, and may have several motions",
    "no robot has such numbers",
)
_AGAINST = "a couple turns it against its tails, and such robots were learned with one tail only"


def reason_of(answer: Floats, tails: float) -> str:
    """Say why a robot with N tails is outside, from the compiled loop's answer (ANSWERS,); empty if it is not."""
    number = int(answer[REASON])
    against = number == STRANGE and tails > 1 and answer[MOTION + 2] < 0
    return _AGAINST if against else _REASONS[number]
