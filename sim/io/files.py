"""Write files completely or not at all.

A file is written under another name in the same folder. When it is complete, it is renamed. So an error or an
interruption leaves either the old file or the new one.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from sim.io.errors import InputError

if TYPE_CHECKING:
    from pandas import DataFrame


@contextmanager
def whole_file(path: str | Path) -> Iterator[Path]:
    """Yield a temporary path; move it to `path` when the block succeeds, remove it otherwise."""
    target = Path(path)
    if target.is_dir():
        raise InputError(f"{target} is a folder; give the name of a file")
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
    except (FileExistsError, NotADirectoryError, PermissionError) as blocked:
        raise InputError(f"cannot make the folder {target.parent}: {blocked.strerror}") from None
    part = target.with_name(f".{target.name}.part{os.getpid()}")
    try:
        yield part
        os.replace(part, target)
    finally:
        part.unlink(missing_ok=True)


def write_csv(table: DataFrame, path: str | Path, *, digits: int = 8) -> None:
    """Write a table as CSV with so many digits, completely or not at all."""
    with whole_file(path) as part:
        table.to_csv(part, index=False, float_format=f"%.{digits}g")


def write_text(path: str | Path, text: str) -> None:
    """Write a text file completely or not at all."""
    with whole_file(path) as part:
        part.write_text(text)
