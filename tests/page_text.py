"""What a reader sees of a page: its text, without style sheets and attributes, and where its links lead."""

from __future__ import annotations

import re
from html.parser import HTMLParser
from pathlib import Path

NOT_SEEN = {"style", "title", "defs"}


class PageText(HTMLParser):
    """The text of a page in `words`, its headings and its links."""

    def __init__(self, path: Path):
        super().__init__()
        self.words: list[str] = []
        self.headings: list[str] = []
        self.links: list[str] = []
        self._inside: list[str] = []
        self.feed(path.read_text())

    @property
    def text(self) -> str:
        """All words, with single blanks."""
        return re.sub(r"\s+", " ", " ".join(self.words))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag in NOT_SEEN or tag == "h2":
            self._inside.append(tag)
        self.links += [value for name, value in attrs if tag == "a" and name == "href" and value]

    def handle_endtag(self, tag: str) -> None:
        if self._inside and self._inside[-1] == tag:
            self._inside.pop()

    def handle_data(self, data: str) -> None:
        if not NOT_SEEN & set(self._inside):
            self.words.append(data)
        if "h2" in self._inside:
            self.headings.append(data)
