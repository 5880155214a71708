"""What the core answers and refuses is what Python does."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from sim.io.errors import InputError
from tests.planner.page.page_core import check_near


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


def check_header(found: str, wanted: str, allowed: float) -> None:
    """Assert that two headers in C differ by rounding alone; the last bits of products are the processor's."""
    number = re.compile(r"(?<![\w.])-?\d+\.?\d*(?:e[-+]?\d+)?(?![\w.])")
    assert number.sub("#", found).splitlines() == number.sub("#", wanted).splitlines()
    numbers = (np.array([float(word) for word in number.findall(text)]) for text in (found, wanted))
    np.testing.assert_allclose(*numbers, rtol=allowed, atol=allowed)
    assert "@" not in found
