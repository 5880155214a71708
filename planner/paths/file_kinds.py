"""Kinds of files that are neither tables nor drawings; they are in planner/page/file_kinds.js."""

from __future__ import annotations

import re
from pathlib import Path

from planner.paths.shared_names import shared_names
from sim.io.errors import InputError

_HEAD = 4096  # bytes that tell


def refuse_other_kinds(path: Path) -> None:
    """Refuse a file that is neither a table nor a drawing; a pipe is not looked into.

    Raises:
        InputError: it is of another kind, by its content or its ending.
    """
    if not path.is_file():
        return
    with path.open("rb") as file:
        head = file.read(_HEAD).decode("latin-1").removeprefix("\xef\xbb\xbf").lstrip()
    kinds, ending = shared_names("file_kinds.js"), path.suffix.lower().removeprefix(".")
    by_content = [kind for kind, (_, start) in kinds.items() if re.match(start, head, re.IGNORECASE)]
    by_ending = [kind for kind, (endings, _) in kinds.items() if ending in endings.split()]
    for kind in [*by_content, *by_ending][:1]:
        raise InputError(
            f"{path}: {kind} is not read; give a table with columns x and y, such as CSV, or an SVG drawing"
        )
