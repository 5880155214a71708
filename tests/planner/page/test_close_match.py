"""The nearest word is that of difflib."""

from __future__ import annotations

import difflib

from tests.planner.page.page_core import answers

KNOWN = [
    "count",
    "length",
    "radius",
    "youngs_modulus",
    "disc_offset",
    "viscosity",
    "speed",
    "C_t",
    "C_r",
    "C_yr",
    "",
]
WORDS = ["cuont", "lenght", "radus", "diameter", "young_modulus", "offset", "viscos", "C_x", "C", "sped", "",
         "zzz", "radius", "modulus", "C_y"]  # fmt: skip


def test_nearest_words() -> None:
    found = answers([("close_match.js", "closeMatch", word, KNOWN) for word in WORDS])
    assert found == [next(iter(difflib.get_close_matches(word, KNOWN, 1)), None) for word in WORDS]
