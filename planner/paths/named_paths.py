"""The paths of a file by their names, of which one is chosen."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from typing import NamedTuple

from common.errors import InputError
from planner.paths.path import Path2D, arc_length
from planner.paths.units import NO_UNIT

_LISTED = 10  # names in a message


class NamedPaths(NamedTuple):
    """The paths of a file, one or more."""

    paths: Mapping[str, Path2D]  # as the file has them, not checked
    unit: float | None  # its size in m; None: the numbers have no unit
    no_unit: str = NO_UNIT  # what a message then asks for

    def chosen(self, source: object, shape: str | None, closed: bool | None) -> Path2D:
        """Return the path of a name, or the only one; its ends are joined if it is closed, or `closed` says so.

        Raises:
            InputError: there are several and none is chosen, or none has this name.
        """
        if shape is None and len(self.paths) > 1:
            raise InputError(f"{source} has {self._listed()}; choose one with --shape, or remove the others")
        name = next(iter(self.paths)) if shape is None else shape
        if name not in self.paths:
            advice = f"there are {self._listed()}" if len(self.paths) > 1 else "leave --shape out"
            raise InputError(f"{source} has no shape {name!r}; {advice}")
        return Path2D.of(self.paths[name].points, closed=self.paths[name].closed or closed)

    def _listed(self) -> str:
        """Count the paths, and list the names of all or of the longest ones."""
        names = list(self.paths)
        if len(names) > _LISTED:
            names.sort(key=lambda name: -arc_length(self.paths[name].points)[-1])
        longest = "the longest: " if len(names) > _LISTED else ""
        return f"{len(names)} paths ({longest}{', '.join(names[:_LISTED])})"


def with_own_names(paths: Iterable[tuple[str, Path2D]]) -> dict[str, Path2D]:
    """Name paths apart: a name that comes again is followed by a number."""
    named: dict[str, Path2D] = {}
    again: Counter[str] = Counter()
    for name, path in paths:
        label = name
        while label in named:
            again[name] += 1
            label = f"{name}/{again[name] + 1}"
        named[label] = path
    return named
