"""What the core answers and refuses is what Python does."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import is_dataclass
from itertools import starmap
from typing import Any

import numpy as np
import pytest

from sim.io.errors import InputError
from tests.planner.page.page_core import answers, check_near


def refusal_of(function: Callable[..., object], *given: Any, **options: Any) -> str:
    """Return the message with which Python refuses."""
    with pytest.raises(InputError) as refusal:
        function(*given, **options)
    return str(refusal.value)


def without_digits(message: object) -> str:
    """Leave numbers out of a message."""
    return re.sub(r"\d", "#", str(message))


def check_alike(found: Any, wanted: Any, allowed: float) -> None:
    """Assert that numbers are alike relative to the largest one of each column, the last axis."""
    columns = np.asarray(wanted, dtype=float).reshape(-1, np.shape(wanted)[-1])
    sizes = np.abs(columns).max(0)
    sizes[sizes == 0] = 1.0
    check_near(np.reshape(found, columns.shape) / sizes, columns / sizes, allowed)


def check_same(found: Any, wanted: Any, allowed: float = 0.0) -> None:
    """Assert that an answer of the core is that of Python; of an object, all that the core has of it."""
    if hasattr(wanted, "_asdict") or is_dataclass(wanted):
        assert found
        for name, part in found.items():
            check_same(part, getattr(wanted, re.sub(r"([A-Z])", r"_\1", name).lower()), allowed)
    elif isinstance(wanted, dict):
        assert set(wanted) <= set(found)
        for name, part in wanted.items():
            check_same(found[name], part, allowed)
    elif isinstance(wanted, list | tuple) and not all(isinstance(part, int | float) for part in wanted):
        assert len(found) == len(wanted)
        for one, other in zip(found, wanted, strict=True):
            check_same(one, other, allowed)
    elif wanted is None or isinstance(wanted, str | bool):
        assert found == wanted
    else:
        check_near(found, wanted, allowed)


def check_parity(
    file: str,
    name: str,
    function: Callable[..., Any],
    cases: Sequence[tuple[Any, ...]],
    allowed: float = 0.0,
    words: Callable[[object], str] = str,
) -> int:
    """Assert that a function of the core answers and refuses as Python's does; return the number of refusals.

    Args:
        file: the core's file.
        name: of the core's function.
        function: Python's.
        cases: arguments of both.
        allowed: difference of numbers.
        words: what must be equal of two refusals.
    """
    found = answers([(file, name, *case) for case in cases])
    for one, case, (wanted, refusal) in zip(found, cases, starmap(_outcome(function), cases), strict=True):
        try:
            if refusal is not None:
                assert isinstance(one, InputError), one
                assert words(one) == words(refusal)
            else:
                assert not isinstance(one, InputError), one
                check_same(one, wanted, allowed)
        except (AssertionError, AttributeError, TypeError, ValueError) as apart:
            raise AssertionError(f"{file}, {name}{str(case)[:300]}: {apart}") from apart
    return sum(isinstance(one, InputError) for one in found)


def _outcome(function: Callable[..., Any]) -> Callable[..., tuple[Any, InputError | None]]:
    def outcome(*case: Any) -> tuple[Any, InputError | None]:
        try:
            return function(*case), None
        except InputError as refusal:
            return None, refusal

    return outcome


def check_header(found: str, wanted: str, allowed: float) -> None:
    """Assert that two headers in C differ by rounding alone; the last bits of products are the processor's."""
    number = re.compile(r"(?<![\w.])-?\d+\.?\d*(?:e[-+]?\d+)?(?![\w.])")
    assert number.sub("#", found).splitlines() == number.sub("#", wanted).splitlines()
    numbers = (np.array([float(word) for word in number.findall(text)]) for text in (found, wanted))
    np.testing.assert_allclose(*numbers, rtol=allowed, atol=allowed)
    assert "@" not in found
