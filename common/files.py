"""Write files completely or not at all, one alone or several together.

A regular file is written in a new folder of its own, which others cannot write, and moved when it is complete.
So an error or an interruption leaves either the old file or the new one. A device, a pipe or the standard output
is written into when the content is complete. What a command reads is not written over (`kept`).
"""

from __future__ import annotations

import errno
import os
import re
import shutil
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import IO, TYPE_CHECKING, Any

from common.errors import InputError

if TYPE_CHECKING:
    from pandas import DataFrame

_DESCRIPTOR = re.compile(r"/(?:dev|proc/self)/(?:stdout|stderr|fd/(\d+))")
_MISSING = {"nan", "None", "NaT", "<NA>"}  # values that are no words
_QUOTED = re.compile('[,"\r\n]')
_kept: set[Path] = set()


@contextmanager
def kept(files: Iterable[Path]) -> Iterator[None]:
    """Refuse in a block to write over files."""
    before = set(_kept)
    _kept.update(files)
    try:
        yield
    finally:
        _kept.intersection_update(before)


def refuse_kept(folder: str | Path, names: Iterable[str]) -> None:
    """Refuse a folder into which files with these names are to be written, where one of them is `kept`.

    Raises:
        InputError: it is.
    """
    for name in names:
        if (target := Path(folder, name).resolve()) in _kept:
            raise InputError(
                f"{target} is an input and would be written over; give another place for what is written"
            )


def refuse_unwritable(folder: str | Path) -> None:
    """Refuse a folder, which need not be there, if no files can be written into it; nothing is made.

    Raises:
        InputError: it, or a folder around it, is a file, or may not be written.
    """
    target = Path(folder)
    with refusals(target):
        there = next(path for path in (target, *target.absolute().parents) if path.exists())
        if not there.is_dir():
            raise InputError(f"cannot make {folder}: {there} is a file; give a folder")
        if not os.access(there, os.W_OK | os.X_OK):
            raise InputError(f"cannot write into {there}: no permission; give another folder")


def refuse_folder(path: str | Path) -> None:
    """Refuse a folder where a file is to be written."""
    if Path(path).is_dir():
        raise InputError(f"{path} is a folder; give the name of a file")


@contextmanager
def whole_file(path: str | Path) -> Iterator[Path]:
    """Yield the path of a temporary file; it becomes `path` when the block succeeds, and is removed otherwise.

    Raises:
        InputError: the file cannot be written.
    """
    target = Path(path)
    refuse_folder(target)
    if is_stream(target):
        with TemporaryDirectory() as folder:
            part = Path(folder, target.name)
            yield part
            _write_into(target, part)
        return
    if target.is_symlink() and target.lstat().st_uid != os.geteuid():
        raise InputError(f"{target} is a symbolic link of another user; remove it, or give another name")
    target = target.resolve()  # a link of one's own stays, and what it points to is written
    refuse_kept(target.parent, [target.name])
    make_folder(target.parent)
    with refusals(target), TemporaryDirectory(dir=target.parent, prefix=".part-") as folder:
        part = Path(folder, target.name)
        yield part
        os.replace(part, target)


@contextmanager
def files_together(folder: str | Path, names: Sequence[str]) -> Iterator[Path]:
    """Yield a temporary folder; when the block succeeds, its files appear in `folder`, all or none.

    Args:
        folder: it is made if it is missing.
        names: all that such a folder may hold, files in folders of it among them. What the block does not write
            is removed, since an older file would belong to something else.

    Raises:
        InputError: the files cannot be written.
    """
    target = Path(folder)
    make_folder(target)
    refuse_kept(target, names)
    for name in names:
        if (target / name).exists() and not (target / name).is_file():
            raise InputError(f"{target / name} is not a regular file; remove it, or give another folder")
    with refusals(target), TemporaryDirectory(dir=target, prefix=".part-") as temporary:
        new, old = Path(temporary, "new"), Path(temporary, "old")
        new.mkdir()
        old.mkdir()
        yield new
        moved: list[tuple[Path, Path]] = []  # from, to
        try:
            for name in names:
                for source, place in ((target / name, old / name), (new / name, target / name)):
                    if source.exists():
                        place.parent.mkdir(parents=True, exist_ok=True)
                        os.replace(source, place)
                        moved.append((source, place))
        except BaseException:
            for source, place in reversed(moved):
                os.replace(place, source)
            raise


def open_no_link(path: str | Path, *, new: bool) -> int:
    """Open a file in a folder that others can write, for reading and writing; return its descriptor.

    Args:
        new: make the file.

    Raises:
        InputError: the file is a symbolic link.
        FileExistsError: the file is there, and should be new.
        OSError: it cannot be opened.
    """
    try:
        return os.open(path, os.O_RDWR | os.O_NOFOLLOW | (os.O_CREAT | os.O_EXCL if new else 0), 0o666)
    except OSError as refusal:
        if refusal.errno == errno.ELOOP:
            raise InputError(f"{path} is a symbolic link; remove it") from None
        raise


def make_folder(folder: str | Path) -> None:
    """Make a folder and those around it.

    Raises:
        InputError: it cannot be made.
    """
    try:
        Path(folder).mkdir(parents=True, exist_ok=True)
    except OSError as blocked:
        raise InputError(f"cannot make the folder {folder}: {blocked.strerror}") from None


def write_csv(columns: Mapping[Any, Any] | DataFrame, path: str | Path, *, digits: int = 8) -> None:
    """Write columns as CSV with so many digits, completely or not at all; no text becomes a formula."""
    write_text(path, "".join(csv_lines(columns, digits=digits)))


def csv_lines(columns: Mapping[Any, Any] | DataFrame, *, digits: int = 8) -> Iterator[str]:
    """Yield the lines of columns as CSV, the names first; what is missing is left empty."""
    import numpy as np  # a text needs none

    from common.number_words import safe_text

    def word(value: object) -> str:
        text = str(safe_text(value))
        if text in _MISSING and not isinstance(value, str):
            return ""
        return '"' + text.replace('"', '""') + '"' if _QUOTED.search(text) else text

    number, forms, cells = f"%.{digits}g", [], []
    for _, values in columns.items():
        kind = (array := np.asarray(values)).dtype.kind
        gaps = kind == "f" and bool(np.isnan(array).any())
        forms.append(number if kind == "f" and not gaps else "%s")
        if gaps:
            cells.append(["" if value != value else number % value for value in array.tolist()])
        elif kind in "fiub":
            cells.append(array.tolist())
        else:  # dates without the time of day where all are midnight
            cells.append(list(map(word, values.astype(str) if kind in "mM" else values)))
    yield ",".join(map(word, columns)) + "\n"
    form = ",".join(forms) + "\n"
    yield from (form % row for row in zip(*cells, strict=True))


def write_text(path: str | Path, text: str) -> None:
    """Write a text file completely or not at all."""
    with whole_file(path) as part:
        part.write_text(text, encoding="utf-8")


def is_stream(path: Path) -> bool:
    """Whether a path exists, but is no regular file that could be replaced."""
    return bool(_DESCRIPTOR.fullmatch(str(path))) or (path.exists() and not path.is_file())


def _write_into(target: Path, part: Path) -> None:
    """Copy a complete file into a device, a pipe, or an open file of this process."""
    with refusals(target), open(part, "rb") as source, _opened(target) as sink:
        shutil.copyfileobj(source, sink)


def _opened(target: Path) -> IO[bytes]:
    """Open a stream for writing; an open file of this process goes on where it is."""
    match = _DESCRIPTOR.fullmatch(str(target))
    if match is None:
        return open(target, "wb")
    sys.stdout.flush()
    number = int(match[1]) if match[1] else 2 if str(target).endswith("stderr") else 1
    return os.fdopen(os.dup(number), "wb")


@contextmanager
def refusals(target: Path) -> Iterator[None]:
    """Turn what the operating system refuses into one line; the end of a pipe is no error of the file."""
    try:
        yield
    except (BrokenPipeError, FileNotFoundError):
        raise
    except OSError as refusal:
        raise InputError(f"cannot write {target}: {refusal.strerror or refusal}") from None
