"""How well the numbers of a robot are known: one standard deviation for each of them.

A robot.toml may state them; where it does not, `DEFAULTS` hold. They are what a careful lab can expect of a
bending test, a viscometer, a caliper and a ruler. A number with σ = 0 is taken to be exact.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from common.errors import InputError
from common.units import to_si


class Sigma(NamedTuple):
    """One standard deviation of a number: in its own unit, or as a share of it."""

    size: float  # one standard deviation
    relative: bool  # a share of the number

    def of(self, value: float) -> float:
        """Compute σ in the unit of `value`."""
        return self.size * abs(value) if self.relative else self.size


DEFAULTS = {
    "youngs_modulus": Sigma(0.10, True),
    "viscosity": Sigma(0.05, True),
    "tail_radius": Sigma(0.02, True),
    "tail_length": Sigma(1e-3, False),  # m: the same for all tails, as a clamp or a ruler makes it
    "head_radius": Sigma(0.01, True),
    "head_length": Sigma(0.01, True),
    "disc_offset": Sigma(0.05, True),
}
_LARGEST = 0.5  # share of the number itself


def read_sigma(given: object, value: float, entry: str, suffix: str = "") -> Sigma:
    """Read σ from an entry of a robot.toml: a number in the unit of its key, or a text like "10 %".

    Args:
        given: the number or text.
        value: what it belongs to.
        entry: its place, for messages.
        suffix: unit of the key; none where it has that of `value`.

    Raises:
        InputError: neither of them, below 0, or more than half of the number.
    """
    sigma = parse_sigma(given, entry)
    if suffix and not sigma.relative:
        sigma = Sigma(float(to_si(sigma.size, suffix)), False)
    if not (math.isfinite(sigma.size) and 0 <= sigma.of(value) <= _LARGEST * abs(value)):
        raise InputError(f"{entry} = {given!r}; a standard deviation lies from 0 to half of the number itself")
    return sigma


def parse_sigma(given: object, entry: str) -> Sigma:
    """Read σ from a number, or a text like "10 %", whatever it belongs to; `entry` names its place."""
    try:
        if isinstance(given, str) and given.strip().endswith("%"):
            return Sigma(float(given.strip()[:-1]) / 100, True)
        if isinstance(given, int | float) and not isinstance(given, bool):
            return Sigma(float(given), False)
        raise ValueError
    except (ValueError, OverflowError):
        raise InputError(f'{entry} = {given!r}; give a number in its unit, or a text like "10 %"') from None


def sigma_text(sigma: Sigma) -> str:
    """Write the entry that `read_sigma` reads back."""
    return f'"{100 * sigma.size:.12g} %"' if sigma.relative else repr(sigma.size)
