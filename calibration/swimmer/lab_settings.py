"""What a lab can set in its next runs: numbers of tails, tail lengths and motor speeds.

Without a word from the lab, it is the table's range of lengths, its numbers of tails and one more, and its fastest
speed and slower ones. A lab says what it has as "N=2,3,4", "l_cm=5,7,9" and "omega_rpm=60,120".
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from calibration.swimmer.measured_table import Measurements
from sim.arrays import Floats
from sim.io.errors import InputError
from sim.model.groups import MOST_TAILS

SETTINGS = ("N", "l_cm", "omega_rpm")
_LENGTHS = 6
_SPEEDS = (0.4, 0.7, 1.0)  # of the fastest

Owned = Mapping[str, tuple[float, ...]]


def owned(entries: Sequence[str]) -> dict[str, tuple[float, ...]]:
    """Read the settings that a lab has, by the columns of a table.

    Args:
        entries: "COLUMN=VALUE,VALUE,…" each.

    Raises:
        InputError: a column or a value that cannot be set.
    """
    found: dict[str, tuple[float, ...]] = {}
    for entry in entries:
        name, _, values = entry.partition("=")
        try:
            found[name] = tuple(float(v) for v in values.split(","))
        except ValueError:
            raise InputError(f"--own {entry!r}; write COLUMN=VALUE,VALUE,… such as l_cm=5,7,9") from None
    check_owned(found)
    return found


def check_owned(own: Owned) -> None:
    """Refuse settings that no run can have.

    Raises:
        InputError: see `owned`.
    """
    for name, values in own.items():
        if name not in SETTINGS:
            raise InputError(f"settings of the next runs: {name!r} is none of {', '.join(SETTINGS)}")
        for value in values:
            if not (math.isfinite(value) and value > 0):
                raise InputError(f"settings of the next runs: {name} = {value:g}; it must be positive")
            if name == "N" and not (value == int(value) and value <= MOST_TAILS):
                raise InputError(
                    f"settings of the next runs: N = {value:g}; the number of tails is an integer from 1 to "
                    f"{MOST_TAILS}"
                )


def possible_settings(runs: Measurements, own: Owned) -> Floats:
    """List N, l_cm and omega_rpm of every run that can be made next, (m, 3); both directions."""
    cm, rpm = 100 * runs.length, np.abs(runs.omega).max() * 30 / math.pi
    default = {
        "N": np.arange(runs.tails.min(), runs.tails.max() + 2),
        "l_cm": np.unique(np.linspace(cm.min(), cm.max(), _LENGTHS).round(1)),
        "omega_rpm": (rpm * np.array(_SPEEDS)).round(1),
    }
    tails, lengths, speeds = (np.unique(own.get(name, default[name])).astype(float) for name in SETTINGS)
    return np.array([(n, a, w) for n in tails for a in lengths for w in (*speeds, *-speeds)])
