"""A refusal of the core arrives as one of Python."""

from __future__ import annotations

from sim.io.errors import InputError
from tests.planner.page.page_core import answer


def test_a_refusal_is_an_input_error_with_its_message() -> None:
    refusal = answer("path.js", "pathOf", [])
    assert isinstance(refusal, InputError)
    assert str(refusal).startswith("the path is empty")
