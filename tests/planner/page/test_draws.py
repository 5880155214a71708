"""Random numbers are Python's."""

from __future__ import annotations

from planner.draws import normals
from tests.planner.page.page_core import answers, check_near


def test_the_same_numbers_are_drawn() -> None:
    cases = [(0, 0, 200_000), (1, 5, 1000), (12345, 2**20, 1000), (2**32 - 1, 0, 1000), (2**40, 7, 10)]
    for found, case in zip(answers([("draws.js", "normals", *case) for case in cases]), cases, strict=True):
        check_near(found, normals(*case), 5e-15)
