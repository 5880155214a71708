"""Old names: they keep working for one release, with a warning that says what to use instead."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from operator import attrgetter
from typing import Any
from warnings import warn


def warn_deprecated(old: str, new: str, *, callers: int) -> None:
    """Warn that a name is old.

    Args:
        callers: how many functions lie between this call and the code that uses the old name.
    """
    warn(f"{old} is deprecated; use {new}", DeprecationWarning, stacklevel=callers + 2)


def old_attributes(paths: Mapping[str, str]) -> Callable[[Any, str], Any]:
    """Make a `__getattr__` that finds attributes of a class by their old names, with a warning.

    Args:
        paths: old name -> path to the new one, such as "declared.reference" or "drawn.polyline()".
    """

    def find(holder: object, name: str) -> Any:
        owner = type(holder).__name__
        if name not in paths:  # dunder methods of copying among them
            raise AttributeError(f"{owner!r} object has no attribute {name!r}")
        path = paths[name]
        warn_deprecated(f"{owner}.{name}", f"{owner}.{path}", callers=1)
        value = attrgetter(path.removesuffix("()"))(holder)
        return value() if path.endswith("()") else value

    return find
