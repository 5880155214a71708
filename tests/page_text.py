"""What a reader sees of a page: its text, without style sheets and attributes, and where its links lead."""

from __future__ import annotations

import re
from html import unescape
from pathlib import Path

_TAG = re.compile(r"<[^>]*>")


class PageText:
    """The text of a page in `words`, one for each piece between tags, its headings and its links."""

    def __init__(self, path: Path):
        html = path.read_text()
        seen = re.sub(r"<(style|title|defs)\b[^>]*(?<!/)>.*?</\1>", "", html, flags=re.DOTALL)
        self.words = [unescape(word) for word in _TAG.split(seen)]
        self.text = re.sub(r"\s+", " ", " ".join(self.words))
        self.headings = [unescape(_TAG.sub("", h)) for h in re.findall(r"<h2\b[^>]*>(.*?)</h2>", seen, re.DOTALL)]
        self.links = [unescape(link) for link in re.findall(r'<a\b[^>]*\bhref="([^"]+)"', html)]
