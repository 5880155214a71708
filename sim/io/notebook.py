"""How objects show themselves: axes to draw on, and text with a picture for a notebook."""

from __future__ import annotations

import base64
import html
import io
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:  # loaded when something is drawn
    from matplotlib.axes import Axes


def given_axes(ax: Axes | None) -> Axes:
    """Return the axes to draw on: those that were given, or those of a new figure."""
    if ax is not None:
        return ax
    from matplotlib import pyplot

    return pyplot.figure().add_subplot()


def as_html(text: str, draw: Callable[[Axes], Any] | None = None, *, width: float = 4.5) -> str:
    """Write a text as HTML, with a picture below it.

    Args:
        text: lines; their layout is kept.
        draw: draws on axes.
        width: of the picture [inch]; its height is 4.5 inch.
    """
    words = f'<pre style="white-space: pre-wrap">{html.escape(text)}</pre>'
    return words + ("" if draw is None else _picture(draw, width, text.partition("\n")[0]))


def _picture(draw: Callable[[Axes], Any], width: float, description: str) -> str:
    from matplotlib.figure import Figure

    figure, store = Figure(figsize=(width, 4.5)), io.BytesIO()
    draw(figure.add_subplot())
    figure.savefig(store, format="png", dpi=90, bbox_inches="tight")
    data = base64.b64encode(store.getvalue()).decode()
    return f'<img alt="{html.escape(description)}" src="data:image/png;base64,{data}">'
