"""Self-contained pages: text, tables, commands and figures in one HTML file that opens anywhere.

Pages follow the reader's light or dark colours, and are readable from 390 pixels of width: figures that belong
together stand below each other there, and a wide table becomes a list. In texts and tables `words` between
backticks are set as code. The template is page.html.
"""

from __future__ import annotations

import html
import re
from collections.abc import Iterable, Sequence
from pathlib import Path
from urllib.parse import quote

from jinja2 import Template
from markupsafe import Markup, escape
from matplotlib.figure import Figure

from sim.io.files import write_text
from sim.io.notebook import picture
from sim.io.page_figures import figure_markup, variables

_TEMPLATE = Path(__file__).with_name("page.html")
_WRAPS = 18  # characters at which the first column of a table may wrap
_WIDE = 48  # characters of a table's row beyond which the table becomes a list on a narrow screen
_NUMBER, _TOGETHER = re.compile(r"(?<=\d) (?=[^\W\d]|[%°±])"), "\u00a0"


class Page:
    """A page built from top to bottom; all text is escaped."""

    def __init__(self, title: str, lead: str):
        self._title, self._lead = title, lead
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

    def steps(self, steps: Sequence[str], *, numbered: bool = False) -> None:
        """Add a list of sentences."""
        kind = "ol" if numbered else "ul"
        self._add(f"<{kind}>{{}}</{kind}>", _joined("<li>{}</li>", ((inline(step),) for step in steps)))

    def commands(self, lines: Sequence[str]) -> None:
        """Add commands to type, one a line."""
        self._add("<pre><code>{}</code></pre>", "\n".join(lines))

    def links(self, links: Sequence[tuple[str, str, str]]) -> None:
        """Add a list of links to files: path relative to the page, name, and what it is."""
        items = ((quote(path), name, inline(words)) for path, name, words in links)
        self._add("<ul>{}</ul>", _joined('<li><a href="{}">{}</a>: {}</li>', items))

    def link_line(self, words: str, links: Sequence[tuple[str, str]]) -> None:
        """Add a line of links to files behind some words: path relative to the page, and name."""
        anchors = ((quote(path), name) for path, name in links)
        self._add("<p>{}: {}</p>", inline(words), _joined('<a href="{}">{}</a>', anchors, ", "))

    def table(self, header: Sequence[str], rows: Sequence[Sequence[object]]) -> None:
        """Add a table; the first column is left-aligned."""
        self._add("{}", _table(list(map(inline, header)), [[inline(str(cell)) for cell in row] for row in rows]))

    def add(self, sections: str) -> None:
        """Add sections of HTML, each from its heading `<h2>` on; their plain tables become tables of the page."""
        for section in sections.split("<h2>")[1:]:
            heading, _, content = section.partition("</h2>")
            self.section(html.unescape(heading))
            self._add("{}", Markup(re.sub(r"<table>(.*?)</table>", _finished, content, flags=re.DOTALL)))

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
        content = {"title": self._title, "lead": inline(self._lead), "sections": self._sections, "footer": footer}
        write_text(path, template.render(content, light=variables(1), dark=variables(2)))


def _joined(markup: str, items: Iterable[Sequence[object]], between: str = "") -> Markup:
    """Fill markup with each of the items, and join the results."""
    return Markup(between).join(Markup(markup).format(*words) for words in items)


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
    for place, heading in enumerate(header):
        cells = [len(row[place].unescape()) for row in rows]
        cells = cells if place else [min(cell, _WRAPS) for cell in cells]
        width += 2 + max([*map(len, heading.split()), *cells], default=0)
    return width


def inline(words: str) -> Markup:
    """Escape words, and set what is between backticks as code."""
    return Markup(re.sub(r"`([^`]+)`", r"<code>\1</code>", str(escape(words))))
