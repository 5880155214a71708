"""Old names find the new attribute, and the warning points at the line that uses the old one."""

from __future__ import annotations

import copy
from types import SimpleNamespace
from typing import Any

import pytest

from sim.io.deprecated import old_attributes


class Thing:
    __getattr__ = old_attributes({"length": "part.size", "twice": "part.double()"})

    def __init__(self) -> None:
        self.part = SimpleNamespace(size=3, double=lambda: 6)


def test_an_old_name_finds_the_new_attribute_and_warns_where_it_is_used() -> None:
    thing: Any = Thing()
    with pytest.warns(DeprecationWarning, match=r"Thing\.length is deprecated; use Thing\.part\.size") as caught:
        assert thing.length == 3
    assert caught[0].filename == __file__
    with pytest.warns(DeprecationWarning, match=r"use Thing\.part\.double\(\)"):
        assert thing.twice == 6
    with pytest.raises(AttributeError, match="'Thing' object has no attribute 'width'"):
        thing.width  # noqa: B018
    assert copy.deepcopy(thing).part.size == 3
