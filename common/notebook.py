"""How objects show themselves: axes to draw on, and text, table and picture for a notebook."""

from __future__ import annotations

import base64
import html
import io
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:  # loaded when something is drawn
    from matplotlib.axes import Axes


def given_axes(ax: Axes | None) -> Axes:
    """Return the axes to draw on: those that were given, or those of a new figure."""
    if ax is not None:
        return ax
    from matplotlib import pyplot

    return pyplot.figure().add_subplot()


class Shown:
    """An object that a notebook shows as its text, or as its quantities, with its plot below where it has one."""

    def quantities(self) -> list[tuple[str, str]]:
        """List what a notebook tabulates below the first line of the text: names, and values with their units."""
        return []

    def _repr_html_(self) -> str:
        text, rows = repr(self), self.quantities()
        return as_html(text.partition("\n")[0] if rows else text, getattr(self, "plot", None), rows)


def picture(png: bytes, description: str) -> str:
    """Write a picture into HTML, with a description for people who cannot see it."""
    return f'<img alt="{html.escape(description)}" src="data:image/png;base64,{base64.b64encode(png).decode()}">'


def as_html(text: str, draw: Callable[[Axes], Any] | None = None, rows: Iterable[tuple[str, str]] = ()) -> str:
    """Write lines of text as HTML that keeps their layout, a table, and a picture that `draw` draws on axes."""
    words = f'<pre style="white-space: pre-wrap">{html.escape(text)}</pre>'
    cells = [f"<tr><td>{html.escape(name)}</td><td>{html.escape(value)}</td></tr>" for name, value in rows]
    words += f"<table>{''.join(cells)}</table>" if cells else ""
    if draw is None:
        return words
    from matplotlib.figure import Figure

    figure, store = Figure(figsize=(4.5, 4.5)), io.BytesIO()
    draw(figure.add_subplot())
    figure.savefig(store, format="png", dpi=90, bbox_inches="tight")
    return words + picture(store.getvalue(), text.partition("\n")[0])
