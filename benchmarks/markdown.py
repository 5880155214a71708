"""Tables as Markdown, so that they can be put into a page."""

from __future__ import annotations


def heading(*columns: str) -> str:
    """Return the first two lines of a table."""
    return f"{row(*columns)}\n|{'---|' * len(columns)}"


def row(*cells: object) -> str:
    """Return one line of a table."""
    return f"| {' | '.join(map(str, cells))} |"
