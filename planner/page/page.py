"""Write the page that plans: markup, style, the planner, and its data in one file without connections."""

from __future__ import annotations

import base64
import hashlib
import html
import json
from typing import Any

from planner.page.bundle import FOLDER, joined
from planner.page.table_data import packed_bytes

_VIEW = FOLDER / "view"


def page_text(title: str, footer: str, data: dict[str, Any], generator: str) -> str:
    """Put the page together.

    Args:
        title: of the page.
        footer: what it is made of.
        data: what the page begins with; JSON.
        generator: the program and its version.
    """
    style = (_VIEW / "page.css").read_text()
    script = _closed(joined("view/main.js"))
    parts = {
        "@POLICY@": _policy(script, style),
        "@GENERATOR@": html.escape(generator),
        "@TITLE@": html.escape(title),
        "@STYLE@": style,
        "@FOOTER@": html.escape(footer),
        "@DATA@": _closed(json.dumps(data, sort_keys=True, separators=(",", ":"), allow_nan=False)),
        "@PLANNER@": packed_bytes(joined("worker.js").encode()),
        "@PAGE@": script,
    }
    text = (_VIEW / "page.html").read_text()
    pieces: list[str] = []
    while text:  # a part is not searched for the marks of others
        marks = [(text.index(mark), mark) for mark in parts if mark in text]
        if not marks:
            break
        at, mark = min(marks)
        pieces += [text[:at], parts[mark]]
        text = text[at + len(mark) :]
    return "".join([*pieces, text])


def _closed(script: str) -> str:
    """Write a script so that the page's markup does not end it."""
    return script.replace("</", "<\\/").replace("<!--", "<\\!--")


def _policy(script: str, style: str) -> str:
    """Allow this script, this style and a worker from a text of the page, and no connection."""
    return (
        f"default-src 'none'; script-src {_digest(script)} blob:; worker-src blob:; style-src {_digest(style)}; "
        "base-uri 'none'; form-action 'none'"
    )


def _digest(text: str) -> str:
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"
