"""Paths from files: CSV tables, and SVG drawings (`planner.paths.svg_drawing`)."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from planner.paths.path import Path2D
from planner.paths.svg_drawing import read_svg
from sim.io.errors import InputError
from sim.io.tables import read_table


@dataclass(frozen=True)
class Drawing:
    """A path, and the size of its unit in metres if the file has physical units."""

    path: Path2D
    unit: float | None


def read_path(source: str | Path, *, closed: bool | None = None, shape: str | None = None) -> Drawing:
    """Read a path from a table with columns x, y, or from an SVG file.

    Args:
        source: the file.
        closed: join the end to the start; by default as in the file.
        shape: name of the path, for an SVG with several; without it the error message lists the names.

    Raises:
        InputError: the file has no path, or several and none is chosen.

    Example:
        >>> import tempfile
        >>> from softflagella import read_path
        >>> with tempfile.NamedTemporaryFile("w", suffix=".svg") as file:
        ...     _ = file.write('<svg><path d="M 0 0 h 3 v -4" transform="scale(2)"/></svg>')
        ...     file.flush()
        ...     read_path(file.name).path.points.tolist()
        [[0.0, 0.0], [6.0, 0.0], [6.0, 8.0]]
    """
    if Path(source).suffix.lower() == ".svg":
        return Drawing(*read_svg(Path(source), closed, shape))
    if shape is not None:
        raise InputError(f"{source} is no SVG, so it has no shape {shape!r}; leave --shape out")
    return Drawing(Path2D.of(_read_columns(Path(source)), closed=closed), None)


def _read_columns(path: Path) -> Any:
    """Read columns x and y (n, 2), split at commas, semicolons, tabs or spaces; without a header the first two."""
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except (OSError, UnicodeDecodeError):
        lines = []
    first = next((line for line in lines if line.strip()), "")
    mark = next((mark for mark in ";\t," if mark in first), None)
    names = [word.strip().strip('"').lower() for word in first.split(mark)]
    if not first:
        read_table(path)  # says what is wrong with the file
    rows = [line.split(mark) for line in lines if line.strip()]
    header = not all(map(_is_number, names))
    if header and not {"x", "y"} <= set(names):
        raise InputError(f"{path} has columns {', '.join(names)}; give x and y")
    places = (names.index("x"), names.index("y")) if header else (0, 1)
    rows = rows[1:] if header else rows
    if not rows:
        raise InputError(f"{path} has no rows; give at least two points")
    decimal = mark == ";" and not any("." in word for row in rows for word in row)
    try:
        return [[float(row[i].strip().replace(",", ".") if decimal else row[i]) for i in places] for row in rows]
    except (ValueError, IndexError):
        raise InputError(f"{path} has a row whose x or y is no number; correct the file") from None


def _is_number(word: str) -> bool:
    try:
        float(word.replace(",", "."))
    except ValueError:
        return False
    return True
