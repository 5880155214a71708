"""Self-contained pages: text, tables and pictures in one HTML file that opens anywhere."""

from __future__ import annotations

import base64
import html
import io
from collections.abc import Sequence
from pathlib import Path

from matplotlib.figure import Figure

from sim.io.files import write_text

_STYLE = """
:root { color-scheme: light; --ink: #1c2733; --soft: #5b6a78; --line: #dde3e9; --accent: #2a7fba; }
body { font: 16px/1.55 system-ui, sans-serif; color: var(--ink); margin: 0; background: #f6f8fa; }
main { max-width: 1080px; margin: 0 auto; padding: 32px 24px 64px; }
h1 { font-size: 30px; margin: 0 0 4px; } h2 { font-size: 21px; margin: 0 0 8px; }
p { margin: 8px 0; max-width: 76ch; } .lead { color: var(--soft); font-size: 18px; }
section { background: #fff; border: 1px solid var(--line); border-radius: 10px; padding: 20px 24px;
  margin: 20px 0; } img { max-width: 100%; height: auto; display: block; margin: 12px auto; }
table { border-collapse: collapse; margin: 12px 0; font-size: 14px; } td, th { text-align: right;
  padding: 4px 12px; border-bottom: 1px solid var(--line); white-space: nowrap; } td:first-child, th:first-child {
  text-align: left; white-space: normal; } .wide { overflow-x: auto; } .good { color: #1c7c43; }
.bad { color: #b3391f; }
footer { color: var(--soft); font-size: 13px; overflow-wrap: anywhere; } code { font-size: 14px; }
"""


class Page:
    """A page built from top to bottom; all text is escaped."""

    def __init__(self, title: str, lead: str):
        self._title = html.escape(title)
        self._parts = [f"<h1>{self._title}</h1>", f'<p class="lead">{html.escape(lead)}</p>']
        self._open = False

    def section(self, heading: str) -> None:
        """Begin a section."""
        self._parts.append(("</section>" if self._open else "") + f"<section><h2>{html.escape(heading)}</h2>")
        self._open = True

    def text(self, words: str, *, tone: str = "") -> None:
        """Add a paragraph; tone "good" or "bad" colours it."""
        self._parts.append(f'<p class="{tone}">{html.escape(words)}</p>')

    def table(self, header: Sequence[str], rows: Sequence[Sequence[object]]) -> None:
        """Add a table; the first column is left-aligned."""
        head = "".join(f"<th>{html.escape(h)}</th>" for h in header)
        body = "".join("<tr>" + "".join(f"<td>{html.escape(str(c))}</td>" for c in row) + "</tr>" for row in rows)
        self._parts.append(f'<div class="wide"><table><tr>{head}</tr>{body}</table></div>')

    def figure(self, figure: Figure, description: str) -> None:
        """Add a picture, with a description for people who cannot see it."""
        store = io.BytesIO()
        figure.savefig(store, format="png", dpi=110, bbox_inches="tight")
        data = base64.b64encode(store.getvalue()).decode()
        self._parts.append(f'<img alt="{html.escape(description)}" src="data:image/png;base64,{data}">')

    def write(self, path: str | Path, footer: str) -> None:
        """Write the page completely or not at all."""
        end = "</section>" if self._open else ""
        body = "\n".join(self._parts)
        write_text(
            path,
            f'<!doctype html><html lang="en"><head><meta charset="utf-8"><title>{self._title}</title>'
            '<meta name="viewport" content="width=device-width, initial-scale=1">'
            f"<style>{_STYLE}</style></head><body><main>{body}{end}"
            f"<footer><p>{html.escape(footer)}</p></footer></main></body></html>\n",
        )
