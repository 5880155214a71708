"""The digest is that of hashlib."""

from __future__ import annotations

from hashlib import sha256

from tests.planner.page.page_core import answers

TEXTS = ["", "abc", "ümlaut ∞ 🐟", *("x" * length for length in (54, 55, 56, 63, 64, 65, 119, 120, 1000))]


def test_digests() -> None:
    found = answers([("sha256.js", "sha256", text) for text in TEXTS])
    assert found == [sha256(text.encode()).hexdigest() for text in TEXTS]
