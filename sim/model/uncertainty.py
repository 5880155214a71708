"""How well the numbers of a robot are known: one standard deviation for each of them.

A robot.toml may state them; where it does not, `DEFAULTS` hold. They are what a careful lab can expect of a
bending test, a viscometer, a caliper and a ruler. A number with σ = 0 is taken to be exact.
"""

from __future__ import annotations

import math

from common.errors import InputError
from common.units import Sigma, parse_sigma, to_si

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


def sigma_text(sigma: Sigma) -> str:
    """Write the entry that `read_sigma` reads back."""
    return f'"{100 * sigma.size:.12g} %"' if sigma.relative else repr(sigma.size)
