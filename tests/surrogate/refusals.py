"""Refusals of files: one plain line that begins with the path."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from sim.io.errors import InputError
from surrogate.table.model_file import load

NO_PYTHON = re.compile(r"Error|Exception|Traceback|object|__|<class")


def refusal(path: Path, read: Callable[[Path], Any] = load) -> str:
    """Return the one plain line with which a file is refused."""
    with pytest.raises(InputError) as caught:
        read(path)
    words = str(caught.value)
    assert len(words.splitlines()) == 1
    assert words.startswith(str(path))
    assert not NO_PYTHON.search(words.removeprefix(str(path))), words
    return words
