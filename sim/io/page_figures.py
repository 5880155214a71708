"""Figures inside a page: SVG whose colours follow the page, light or dark, or PNG where SVG would be large.

A figure is drawn with the colours of `PALETTE`, on nothing. Each of them becomes a variable of the page's style
sheet, which has a value for light pages and one for dark pages. Other colours stay as they are. Text stays text in
the reader's own font, so it can be found and read aloud. Draw figures about 4.3 inches wide with text of 9 points:
they are readable on a telephone.
"""

from __future__ import annotations

import html
import io
import re
from typing import Any

import matplotlib as mpl
from matplotlib.figure import Figure

from sim.io.notebook import picture

INK, SOFT, PALE, GRID = "#1c2733", "#5b6a78", "#b8c2cc", "#dde3e9"
BLUE, ORANGE, GREEN, VIOLET, RED = "#2a7fba", "#e08a1e", "#3d9a5f", "#8a4fa3", "#c8452f"
# Colour of a figure -> variable of the page, its value on light pages, its value on dark pages
PALETTE = {
    INK: ("ink", "#1c2733", "#dde5ec"),
    SOFT: ("soft", "#5b6a78", "#9aa9b7"),
    PALE: ("pale", "#b8c2cc", "#56646f"),
    GRID: ("line", "#dde3e9", "#333e49"),
    BLUE: ("blue", "#2a7fba", "#58a9e0"),
    ORANGE: ("orange", "#d07c12", "#eda545"),
    GREEN: ("green", "#3d9a5f", "#5fbf82"),
    VIOLET: ("violet", "#8a4fa3", "#bb8ad0"),
    RED: ("red", "#c8452f", "#ee7c66"),
}
_DRAWN_AS = {  # colours of drawings that have other readers as well
    "#000000": INK, "#1a1a1a": INK, "#222222": INK, "#b0b0b0": PALE, "#9aa3ab": SOFT, "#dfe9f1": GRID,
    "#2a6fa8": BLUE, "#2a7f4f": GREEN, "#8a4fa8": VIOLET,
}  # fmt: skip
_LARGEST = 600_000  # characters of an SVG
_SETTINGS: dict[Any, Any] = {"svg.fonttype": "none", "svg.hashsalt": "page"}


def variables(place: int) -> str:
    """Write the palette as variables of a style sheet; `place` 1: of light pages, 2: of dark pages."""
    return " ".join(f"--{entry[0]}: {entry[place]};" for entry in PALETTE.values())


def figure_markup(figure: Figure, description: str, *, number: int) -> str:
    """Write a figure as a picture of a page.

    Args:
        description: for people who cannot see it.
        number: of the figure on its page.
    """
    with mpl.rc_context(_SETTINGS):
        store = io.StringIO()
        figure.savefig(store, format="svg", bbox_inches="tight", transparent=True, metadata={"Date": None})
        svg = store.getvalue()
    if len(svg) <= _LARGEST:
        return _themed(svg, html.escape(description), number)
    png = io.BytesIO()
    figure.savefig(png, format="png", dpi=110, bbox_inches="tight")
    return picture(png.getvalue(), description)


def _themed(svg: str, words: str, number: int) -> str:
    """Take the drawing out of an SVG file, let its colours follow the page and its width the column."""
    found = re.search(r'<svg[^>]*?\bviewBox="([^"]+)"[^>]*>', svg)
    assert found, "matplotlib writes a viewBox"
    width = float(found[1].split()[2])
    body = re.sub(r"<metadata>.*?</metadata>", "", svg[found.end() :], flags=re.DOTALL)
    body = re.sub(r"<!--.*?-->|<style.*?</style>", "", body, flags=re.DOTALL)
    body = re.sub(r'<g id="[^"]*">', "<g>", body)
    body = re.sub(r'\bid="', f'id="f{number}-', body)  # names are unique on the page
    body = re.sub(r'(\bhref="|url\()#', rf"\1#f{number}-", body.replace("xlink:href", "href"))
    body = re.sub(r"'DejaVu Sans'[^;\"]*", "system-ui, sans-serif", body)
    for colour, like in _DRAWN_AS.items():
        body = body.replace(colour, like)
    for colour, (name, *_) in PALETTE.items():
        body = body.replace(colour, f"var(--{name})")
    body = re.sub(r"\n\s*", "\n", body)
    # Elements without a colour of their own are black in SVG: here they have the colour of the text.
    return (
        f'<svg role="img" aria-label="{words}" viewBox="{found[1]}" fill="currentColor" '
        f'style="width: {width * 4 / 3:.0f}px">{body.strip()}'
    )
