"""Why a robot is outside a look-up table, as numbers and in words."""

from __future__ import annotations

MAX_YAW_SHARE = 0.6  # |ω_yr/ω_t| from which a robot may have several motions
INSIDE, NOT_LEARNED, NO_MOTION, NOVEL, FAST_YAW, NO_RESPONSE = range(6)
_REASONS = (
    "",
    "none with as many tails were learned",
    "its tails or its motor were not learned, or no motion was found",
    "its tails move as none of the learned ones do",
    "it yaws nearly as fast as its tails turn, and may have several motions",
    "its head has no side force as it spins, and no flip of such a robot was learned",
)
_AGAINST = "a couple turns it against its tails, and such robots were learned with one tail only"


def reason_of(outside: int, tails: float, yaw_rate: float) -> str:
    """Say why a robot with N tails is outside; empty if it is not. The yaw rate is that for a positive motor."""
    return _AGAINST if outside == NOVEL and tails > 1 and yaw_rate < 0 else _REASONS[outside]
