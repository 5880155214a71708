"""What a lab can set in its next runs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from common.errors import InputError

LabSettings = Mapping[str, tuple[float, ...]]  # column of a table -> values


def read_lab_settings(entries: Sequence[str]) -> dict[str, tuple[float, ...]]:
    """Read settings from entries such as "l_cm=5,7,9", by the columns of a table."""
    settings: dict[str, tuple[float, ...]] = {}
    for entry in entries:
        name, _, values = entry.partition("=")
        try:
            settings[name] = tuple(float(v) for v in values.split(","))
        except ValueError:
            raise InputError(f"--own {entry!r}; write COLUMN=VALUE,VALUE,… such as l_cm=5,7,9") from None
    return settings
