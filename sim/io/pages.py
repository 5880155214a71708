"""Self-contained pages: text, tables, commands and figures in one HTML file that opens anywhere.

Pages follow the reader's light or dark colours, and are readable from 390 pixels of width: figures that belong
together stand below each other there, and a wide table becomes a list. In texts and tables `words` between
backticks are set as code.
"""

from __future__ import annotations

import base64
import html
import re
from collections.abc import Sequence
from pathlib import Path
from urllib.parse import quote

from matplotlib.figure import Figure

from sim.io.files import write_text
from sim.io.page_figures import figure_markup, variables

_WRAPS = 18  # characters at which the first column of a table may wrap
_WIDE = 48  # characters of a table's row beyond which the table becomes a list on a narrow screen
_NUMBER, _TOGETHER = re.compile(r"(?<=\d) (?=[^\W\d]|[%°±])"), "\u00a0"
_LONG = 5  # sections beyond which a page begins with a list of them
_STYLE = f"""
:root {{ color-scheme: light dark; --page: #f6f8fa; --card: #fff; --good: #1c7c43; --bad: #b3391f;
  {variables(1)} }}
@media (prefers-color-scheme: dark) {{ :root {{ --page: #10161c; --card: #182028; --good: #6fce94;
  --bad: #ff9580; {variables(2)} }} }}
* {{ box-sizing: border-box; }}
body {{ font: 16px/1.55 system-ui, sans-serif; color: var(--ink); margin: 0; background: var(--page); }}
main {{ max-width: 1080px; margin: 0 auto; padding: 32px 24px 64px; }}
h1 {{ font-size: 30px; line-height: 1.25; margin: 0 0 8px; overflow-wrap: anywhere; }}
h2 {{ font-size: 21px; margin: 0 0 8px; }}
p, li {{ max-width: 76ch; overflow-wrap: break-word; }} p {{ margin: 8px 0; }}
ul, ol {{ margin: 8px 0; padding-left: 24px; }} li {{ margin: 4px 0; }}
.lead {{ color: var(--soft); font-size: 18px; }} .good {{ color: var(--good); }} .bad {{ color: var(--bad); }}
a {{ color: var(--blue); }} nav {{ margin: 12px 0; }} nav a {{ margin-right: 16px; display: inline-block; }}
section {{ background: var(--card); border: 1px solid var(--line); border-radius: 10px; padding: 20px 24px;
  margin: 20px 0; scroll-margin-top: 8px; }}
pre {{ background: var(--page); border: 1px solid var(--line); border-radius: 6px; padding: 10px 14px;
  overflow-x: auto; margin: 10px 0; font-size: 14px; }}
code {{ font-family: ui-monospace, monospace; font-size: .9em; overflow-wrap: anywhere; }}
pre code {{ font-size: 14px; white-space: pre-wrap; overflow-wrap: break-word; }}
.figures {{ display: flex; flex-wrap: wrap; gap: 12px 28px; justify-content: center; margin: 12px 0; }}
figure {{ margin: 0; max-width: 100%; }} figcaption {{ color: var(--soft); font-size: 14px; max-width: 420px;
  text-align: center; margin: 2px auto 0; }}
svg * {{ stroke-linejoin: round; stroke-linecap: butt; }}
svg {{ display: block; max-width: 100%; height: auto; margin: 0 auto; }}
img {{ display: block; max-width: 100%; height: auto; margin: 0 auto; background: #fff; border-radius: 6px; }}
table {{ border-collapse: collapse; margin: 12px 0; font-size: 14px; }}
td, th {{ text-align: right; padding: 4px 12px; border-bottom: 1px solid var(--line); vertical-align: top; }}
td:first-child, th:first-child {{ text-align: left; padding-left: 0; }} th {{ vertical-align: bottom; }}
.wide {{ overflow-x: auto; }}
footer {{ color: var(--soft); font-size: 13px; overflow-wrap: anywhere; }}
@media (max-width: 640px) {{
  main {{ padding: 20px 12px 40px; }} section {{ padding: 16px 14px; }} h1 {{ font-size: 25px; }}
  td, th {{ padding: 4px 0 4px 12px; }}
  .cards tr:first-child {{ display: none; }} .cards, .cards tbody {{ display: block; }}
  .cards tr {{ display: block; border-bottom: 1px solid var(--line); padding: 8px 0; }}
  .cards td {{ display: flex; justify-content: space-between; gap: 16px; border: 0; padding: 1px 0; }}
  .cards td::before {{ content: attr(data-column); color: var(--soft); text-align: left; }}
  .cards td:first-child {{ display: block; font-weight: 600; }} .cards td:first-child::before {{ content: none; }}
  .cards td:empty {{ display: none; }}
}}
"""


class Page:
    """A page built from top to bottom; all text is escaped."""

    def __init__(self, title: str, lead: str):
        self._title = html.escape(title)
        self._lead = inline(lead)
        self._parts: list[str] = []
        self._sections: list[str] = []
        self._figures = 0

    def section(self, heading: str) -> None:
        """Begin a section."""
        end = "</section>" if self._sections else ""
        self._sections.append(html.escape(heading))
        self._parts.append(f'{end}<section id="section-{len(self._sections)}"><h2>{self._sections[-1]}</h2>')

    def text(self, words: str, *, tone: str = "") -> None:
        """Add a paragraph; tone "good" or "bad" colours it."""
        self._parts.append(f'<p class="{tone}">{inline(words)}</p>')

    def steps(self, steps: Sequence[str], *, numbered: bool = False) -> None:
        """Add a list of sentences."""
        kind = "ol" if numbered else "ul"
        self._parts.append(f"<{kind}>" + "".join(f"<li>{inline(step)}</li>" for step in steps) + f"</{kind}>")

    def commands(self, lines: Sequence[str]) -> None:
        """Add commands to type, one a line."""
        self._parts.append(f"<pre><code>{html.escape(chr(10).join(lines))}</code></pre>")

    def links(self, links: Sequence[tuple[str, str, str]]) -> None:
        """Add a list of links to files: path relative to the page, name, and what it is."""
        items = (
            f'<li><a href="{html.escape(quote(path))}">{html.escape(name)}</a>: {inline(words)}</li>'
            for path, name, words in links
        )
        self._parts.append(f"<ul>{''.join(items)}</ul>")

    def link_line(self, words: str, links: Sequence[tuple[str, str]]) -> None:
        """Add a line of links to files behind some words: path relative to the page, and name."""
        anchors = (f'<a href="{html.escape(quote(path))}">{html.escape(name)}</a>' for path, name in links)
        self._parts.append(f"<p>{inline(words)}: {', '.join(anchors)}</p>")

    def table(self, header: Sequence[str], rows: Sequence[Sequence[object]]) -> None:
        """Add a table; the first column is left-aligned."""
        self._parts.append(
            _table(list(map(inline, header)), [[inline(str(cell)) for cell in row] for row in rows])
        )

    def add(self, sections: str) -> None:
        """Add sections of HTML, each from its heading `<h2>` on; their plain tables become tables of the page."""
        for section in sections.split("<h2>")[1:]:
            heading, _, content = section.partition("</h2>")
            self.section(html.unescape(heading))
            self._parts.append(re.sub(r"<table>(.*?)</table>", _finished, content, flags=re.DOTALL))

    def figure(self, figure: Figure, description: str) -> None:
        """Add a figure, with a description for people who cannot see it."""
        self.figures([(figure, description, "")])

    def figures(self, figures: Sequence[tuple[Figure, str, str]]) -> None:
        """Add figures beside each other, or below each other on a narrow screen.

        Args:
            figures: each with its description and a caption.
        """
        self._parts.append(figures_markup(figures, self._figures + 1))
        self._figures += len(figures)

    def picture(self, png: bytes, description: str) -> None:
        """Add a picture, with a description for people who cannot see it."""
        source = f"data:image/png;base64,{base64.b64encode(png).decode()}"
        self._parts.append(f'<img src="{source}" alt="{html.escape(description)}">')

    def write(self, path: str | Path, footer: str) -> None:
        """Write the page completely or not at all."""
        end = "</section>" if self._sections else ""
        contents = ""
        if len(self._sections) > _LONG:
            places = (f'<a href="#section-{n}">{heading}</a>' for n, heading in enumerate(self._sections, 1))
            contents = f"<nav>{' '.join(places)}</nav>"
        body = "\n".join((f"<h1>{self._title}</h1>", f'<p class="lead">{self._lead}</p>', contents, *self._parts))
        write_text(
            path,
            f'<!doctype html><html lang="en"><head><meta charset="utf-8"><title>{self._title}</title>'
            '<meta name="viewport" content="width=device-width, initial-scale=1">'
            f"<style>{_STYLE}</style></head><body><main>{body}{end}"
            f"<footer><p>{html.escape(footer)}</p></footer></main></body></html>\n",
        )


def figures_markup(figures: Sequence[tuple[Figure, str, str]], first: int) -> str:
    """Write figures beside each other, see `Page.figures`; `first` is the number of the first one on its page."""
    written = []
    for number, (figure, description, caption) in enumerate(figures, first):
        below = f"<figcaption>{inline(caption)}</figcaption>" if caption else ""
        written.append(f"<figure>{figure_markup(figure, description, number=number)}{below}</figure>")
    return f'<div class="figures">{"".join(written)}</div>'


def _finished(table: re.Match[str]) -> str:
    """Write a table of the page from a plain one, whose first row has the headings."""
    header, *rows = (
        [" ".join(cell.split()) for cell in re.findall(r"<t[hd]>(.*?)</t[hd]>", row, re.DOTALL)]
        for row in re.findall(r"<tr>(.*?)</tr>", table[1], re.DOTALL)
    )
    return _table(header, rows)


def _table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Write a table from cells of HTML; a number and its unit stay on one line."""
    head = "".join(f"<th>{heading}</th>" for heading in header)
    names = [html.escape(html.unescape(re.sub("<.*?>", "", heading))) for heading in header]
    body = "".join(
        "<tr>"
        + "".join(
            f'<td data-column="{name}">{_NUMBER.sub(_TOGETHER, cell)}</td>'
            for name, cell in zip(names, row, strict=True)
        )
        + "</tr>"
        for row in rows
    )
    kind = ' class="cards"' if _row_width(header, rows) > _WIDE else ""
    return f'<div class="wide"><table{kind}><tr>{head}</tr>{body}</table></div>'


def _row_width(header: Sequence[str], rows: Sequence[Sequence[str]]) -> int:
    """Estimate the width of a table in characters; headings and the first column wrap between words."""
    width = 0
    for place, heading in enumerate(header):
        cells = [len(html.unescape(row[place])) for row in rows]
        cells = cells if place else [min(cell, _WRAPS) for cell in cells]
        width += 2 + max([*map(len, heading.split()), *cells], default=0)
    return width


def inline(words: str) -> str:
    """Escape words, and set what is between backticks as code."""
    return re.sub(r"`([^`]+)`", r"<code>\1</code>", html.escape(words))
