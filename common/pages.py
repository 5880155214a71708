"""Self-contained pages: text, tables, commands and figures in one HTML file that opens anywhere.

Pages follow the reader's light or dark colours, and are readable from 390 pixels of width: figures that belong
together stand below each other there, and a wide table becomes a list. In texts and tables `words` between
backticks are set as code. The template is page.html.

A figure is drawn with the colours of `PALETTE`, on nothing. It is SVG, in which each of these colours becomes a
variable of the page's style sheet, with a value for light pages and one for dark pages. Other colours stay as they
are. Text stays text in the reader's own font, so it can be found and read aloud. Where SVG would be large, the
figure is PNG. Draw figures about 4.3 inches wide with text of 9 points: they are readable on a telephone.
"""

from __future__ import annotations

import html
import io
import re
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any
from urllib.parse import quote

import matplotlib as mpl
from jinja2 import Template
from markupsafe import Markup, escape
from matplotlib.figure import Figure

from common.files import write_text
from common.notebook import picture

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
_TEMPLATE = Path(__file__).with_name("page.html")
_WRAPS = 18  # characters at which the first column of a table may wrap
_WIDE = 48  # characters of a table's row beyond which the table becomes a list on a narrow screen
_NUMBER, _TOGETHER = re.compile(r"(?<=\d) (?=[^\W\d]|[%°±])"), "\u00a0"


class Page:
    """A page built from top to bottom; all text is escaped."""

    def __init__(self, title: str, lead: str, *, folded: bool = False):
        """Begin a page; `folded`: a reader opens the sections that have a heading."""
        self._title, self._lead, self._folded = title, lead, folded
        self._sections: list[tuple[str, list[Markup]]] = [("", [])]  # heading, parts; the first has no heading
        self._figures = 0

    def _add(self, markup: str, *words: object) -> None:
        """Add a part: markup that is filled with words, which are escaped, or with markup."""
        self._sections[-1][1].append(Markup(markup).format(*words))

    def section(self, heading: str) -> None:
        """Begin a section."""
        self._sections.append((heading, []))

    def text(self, words: str, *, tone: str = "") -> None:
        """Add a paragraph; tone "good" or "bad" colours it."""
        self._add('<p class="{}">{}</p>', tone, inline(words))

    def commands(self, lines: Sequence[str]) -> None:
        """Add commands to type, one a line."""
        self._add("<pre><code>{}</code></pre>", "\n".join(lines))

    def links(self, links: Sequence[tuple[str, str, str]]) -> None:
        """Add a list of links to files: path relative to the page, name, and what it is."""
        items = ((quote(path), name, inline(words)) for path, name, words in links)
        self._add("<ul>{}</ul>", _joined('<li><a href="{}">{}</a>: {}</li>', items))

    def table(self, header: Sequence[str], rows: Sequence[Sequence[object]]) -> None:
        """Add a table; the first column is left-aligned."""
        self._add("{}", _table(list(map(inline, header)), [[inline(str(cell)) for cell in row] for row in rows]))

    def add(self, sections: str) -> None:
        """Add sections of HTML, each from its heading `<h2>` on; their plain tables become tables of the page."""
        opening, *others = re.sub(r"<table>(.*?)</table>", _finished, sections, flags=re.DOTALL).split("<h2>")
        self._add("{}", Markup(opening))
        for section in others:
            heading, _, content = section.partition("</h2>")
            self.section(html.unescape(heading))
            self._add("{}", Markup(content))

    def figure(self, figure: Figure, description: str) -> None:
        """Add a figure, with a description for people who cannot see it."""
        self.figures([(figure, description, "")])

    def figures(self, figures: Sequence[tuple[Figure, str, str]]) -> None:
        """Add figures beside each other, or below each other on a narrow screen.

        Args:
            figures: each with its description and a caption.
        """
        self._add("{}", figures_markup(figures, self._figures + 1))
        self._figures += len(figures)

    def picture(self, png: bytes, description: str) -> None:
        """Add a picture, with a description for people who cannot see it."""
        self._add("{}", Markup(picture(png, description)))

    def write(self, path: str | Path, footer: str) -> None:
        """Write the page completely or not at all."""
        template = Template(_TEMPLATE.read_text(encoding="utf-8"), autoescape=True)
        content = {"title": self._title, "lead": inline(self._lead), "sections": self._sections, "footer": footer,
                   "folded": self._folded}  # fmt: skip
        write_text(path, template.render(content, light=variables(1), dark=variables(2)))


def _joined(markup: str, items: Iterable[Sequence[object]]) -> Markup:
    """Fill markup with each of the items, and join the results."""
    return Markup("").join(Markup(markup).format(*words) for words in items)


def figures_markup(figures: Sequence[tuple[Figure, str, str]], first: int) -> Markup:
    """Write figures beside each other, see `Page.figures`; `first` is the number of the first one on its page."""
    written = []
    for number, (figure, description, caption) in enumerate(figures, first):
        below = Markup("<figcaption>{}</figcaption>").format(inline(caption)) if caption else ""
        written.append((Markup(figure_markup(figure, description, number=number)), below))
    return Markup('<div class="figures">{}</div>').format(_joined("<figure>{}{}</figure>", written))


def _finished(table: re.Match[str]) -> str:
    """Write a table of the page from a plain one, whose first row has the headings."""
    header, *rows = (
        [Markup(" ".join(cell.split())) for cell in re.findall(r"<t[hd]>(.*?)</t[hd]>", row, re.DOTALL)]
        for row in re.findall(r"<tr>(.*?)</tr>", table[1], re.DOTALL)
    )
    return _table(header, rows)


def _table(header: Sequence[Markup], rows: Sequence[Sequence[Markup]]) -> Markup:
    """Write a table from cells of HTML; a number and its unit stay on one line."""
    names = [heading.striptags() for heading in header]
    lines = [_joined("<th>{}</th>", ((heading,) for heading in header))]
    for row in rows:
        cells = (Markup(_NUMBER.sub(_TOGETHER, str(cell))) for cell in row)
        lines.append(_joined('<td data-column="{}">{}</td>', zip(names, cells, strict=True)))
    kind = Markup(' class="cards"') if _row_width(header, rows) > _WIDE else ""
    body = _joined("<tr>{}</tr>", ((line,) for line in lines))
    return Markup('<div class="wide"><table{}>{}</table></div>').format(kind, body)


def _row_width(header: Sequence[Markup], rows: Sequence[Sequence[Markup]]) -> int:
    """Estimate the width of a table in characters; headings and the first column wrap between words."""
    width = 0
    for index, heading in enumerate(header):
        cells = [len(row[index].unescape()) for row in rows]
        cells = cells if index else [min(cell, _WRAPS) for cell in cells]
        width += 2 + max([*map(len, heading.split()), *cells], default=0)
    return width


def inline(words: str) -> Markup:
    """Escape words, and set what is between backticks as code."""
    return Markup(re.sub(r"`([^`]+)`", r"<code>\1</code>", str(escape(words))))


def variables(index: int) -> str:
    """Write the palette as variables of a style sheet; `index` 1: of light pages, 2: of dark pages."""
    return " ".join(f"--{entry[0]}: {entry[index]};" for entry in PALETTE.values())


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
