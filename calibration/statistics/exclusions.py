"""Excluded rows of a table: which reasons there were, for how many rows each, and whether too many are missing.

A reader of tables and the search for outliers say for each row why it was not used, as in "row 7: omega_h_rpm = 3
has the wrong sign for its omega_rpm". Here these lines are grouped by reason, without what is particular to a row.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

MANY = 0.2  # share of the rows; if more are excluded, the rest may not be a fair sample
_ROW = re.compile(r"row (\d+)(?: \(line \d+\))?: (.*)", re.DOTALL)
# A value (" = 3"), the row that was copied, the size of a deviation.
_PARTICULAR = re.compile(r" = .*?(?= is | has )| \(row \d+\)$|(?<= is )\d+ (?=standard deviations )", re.DOTALL)
_LISTED = 3  # rows of a reason


def summary_of_excluded(excluded: Sequence[str], total: int) -> list[str]:
    """Group lines such as "row 7: …" by their reason, the most frequent first; other lines follow as they are.

    Args:
        total: rows of the table.
    """
    rows: dict[str, list[tuple[str, str]]] = {}
    others = []
    for line in excluded:
        match = _ROW.fullmatch(line)
        if match:
            rows.setdefault(_PARTICULAR.sub("", match[2]), []).append((match[1], line))
        else:
            others.append(line)
    groups = sorted(rows.items(), key=lambda group: -len(group[1]))
    return [_words(reason, members, total) for reason, members in groups] + others


def _words(reason: str, members: list[tuple[str, str]], total: int) -> str:
    if len(members) == 1:
        return members[0][1]
    numbers = ", ".join(number for number, _ in members[:_LISTED])
    more = f" and {len(members) - _LISTED} more" if len(members) > _LISTED else ""
    return f"{len(members)} of {total} rows (rows {numbers}{more}): {reason}"


def count_of_rows(excluded: Sequence[str]) -> int:
    """Count the rows among excluded rows and columns."""
    return sum(_ROW.fullmatch(line) is not None for line in excluded)


def caveat_of_excluded(excluded: Sequence[str], total: int) -> tuple[str, ...]:
    """Warn where many of the `total` rows are excluded."""
    count = count_of_rows(excluded)
    if count <= MANY * total:
        return ()
    return (
        f"{count} of {total} rows ({100 * count / total:.0f} %) were excluded: see why, and whether the rest is a "
        "fair sample of the runs",
    )
