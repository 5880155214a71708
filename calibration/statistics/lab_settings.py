"""What a lab can set in its next runs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from common.errors import InputError

LabSettings = Mapping[str, tuple[float, ...]]  # column of a table -> values
_OF_A_RANGE = 6  # values, by equal factors where both ends are positive


def read_lab_settings(entries: Sequence[str]) -> dict[str, tuple[float, ...]]:
    """Read settings from entries such as "l_cm=5,7,9" or "l_cm=5..9", by the columns of a table."""
    settings: dict[str, tuple[float, ...]] = {}
    for entry in entries:
        name, _, values = entry.partition("=")
        try:
            settings[name] = tuple(value for part in values.split(",") for value in _values(part))
        except ValueError:
            raise InputError(
                f"--own {entry!r}; write COLUMN=VALUE,VALUE,… such as l_cm=5,7,9, or a range, l_cm=5..9"
            ) from None
    return settings


def _values(part: str) -> list[float]:
    """Read a value, or values of a range."""
    ends = [float(end) for end in part.split("..")]
    if len(ends) == 1:
        return ends
    low, high = sorted(ends)
    spaced = np.geomspace if low > 0 else np.linspace
    return [float(f"{value:.3g}") for value in spaced(low, high, _OF_A_RANGE)]
