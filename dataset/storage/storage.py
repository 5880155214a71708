"""The storage of a data set: a folder on a disk, or behind a URL that fsspec knows (s3://bucket/name, …).

A file appears whole or not at all. On a disk it is written under another name, synchronised and renamed; behind
a URL the upload is complete when the file is closed. Every refusal of the storage (full, read-only, no rights)
becomes one line.
"""

from __future__ import annotations

import hashlib
import os
import re
from abc import ABC, abstractmethod
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO, Any
from uuid import uuid4

import pyarrow as pa

from sim.io.errors import InputError
from sim.io.files import open_no_link

_URL = re.compile(r"^[a-zA-Z][a-zA-Z0-9+.-]+://")


class StorageError(InputError):
    """The storage refuses an operation; the message is one line."""


class Sink:
    """A file that is being written; knows the digest and size of what has been written."""

    def __init__(self, file: IO[bytes]):
        self._file, self._sha, self.size, self.closed = file, hashlib.sha256(), 0, False

    def write(self, data: Any) -> int:
        """Write bytes."""
        view = memoryview(data)
        self._sha.update(view)
        self._file.write(view)
        self.size += view.nbytes
        return view.nbytes

    def flush(self) -> None:
        """Pass on what is buffered."""
        self._file.flush()

    def tell(self) -> int:
        """Count the bytes so far."""
        return self.size

    def close(self) -> None:
        """Do nothing: the storage closes the file, not the writer of Parquet."""

    @property
    def sha256(self) -> str:
        """Digest of what has been written."""
        return self._sha.hexdigest()


class Storage(ABC):
    """A folder with files in it and in its sub-folders; names are relative, with "/"."""

    def __init__(self, address: str):
        self.address = address  # absolute: it means the same on another machine

    @abstractmethod
    def names(self, folder: str = "") -> list[str]:
        """List files and folders in a sub-folder, sorted, without the folder's name; none where it is missing."""

    @abstractmethod
    def size(self, name: str) -> int | None:
        """Return the bytes of a file; None where it is missing."""

    @abstractmethod
    def read(self, name: str) -> pa.Buffer:
        """Read a file."""

    @abstractmethod
    def writer(self, name: str) -> Any:
        """Open a context with a `Sink`; the file appears when the context ends without an exception."""

    @abstractmethod
    def move(self, source: str, target: str) -> None:
        """Give a file another name."""

    @abstractmethod
    def delete(self, name: str) -> None:
        """Remove a file, if it is there."""

    def write(self, name: str, text: str) -> None:
        """Write a text file."""
        with self.writer(name) as sink:
            sink.write(text.encode())

    def path(self, name: str) -> str:
        """Return a file's full address, for messages."""
        return f"{self.address}/{name}" if name else self.address


def open_storage(address: str | Path | Storage) -> Storage:
    """Open the storage at a path or URL."""
    if isinstance(address, Storage):
        return address
    text = str(address)
    if text.startswith("file://"):
        text = text[len("file://") :]
    return RemoteStorage(text.rstrip("/")) if _URL.match(text) else LocalStorage(os.path.abspath(text))


class LocalStorage(Storage):
    """A folder on a disk that all workers see."""

    def names(self, folder: str = "") -> list[str]:
        path = Path(self.address, folder)
        if path.exists() and not path.is_dir():
            raise InputError(f"{path} is a file; give a folder for the data set")
        with _refusals(f"read {path}"):
            return sorted(entry.name for entry in path.iterdir()) if path.exists() else []

    def size(self, name: str) -> int | None:
        try:
            return os.stat(self.path(name)).st_size
        except (FileNotFoundError, NotADirectoryError):
            return None

    def read(self, name: str) -> pa.Buffer:
        with _refusals(f"read {self.path(name)}"):
            if not self.size(name):
                return pa.py_buffer(b"")
            return pa.memory_map(self.path(name)).read_buffer()

    @contextmanager
    def writer(self, name: str) -> Iterator[Sink]:
        path = Path(self.path(name))
        part = path.with_name(f".{path.name}.{uuid4().hex}")
        with _refusals(f"write {path}"):
            path.parent.mkdir(parents=True, exist_ok=True)
            try:
                with open(open_no_link(part, new=True), "wb", buffering=0) as file:
                    sink = Sink(_Unbuffered(file))  # type: ignore[arg-type]
                    yield sink
                    os.fsync(file.fileno())
                os.replace(part, path)
                _sync_folder(path.parent)
            finally:
                with suppress(OSError):
                    part.unlink(missing_ok=True)

    def move(self, source: str, target: str) -> None:
        before, after = Path(self.path(source)), Path(self.path(target))
        with _refusals(f"write {after}"):
            after.parent.mkdir(parents=True, exist_ok=True)
            os.replace(before, after)
            _sync_folder(after.parent)

    def delete(self, name: str) -> None:
        with _refusals(f"remove {self.path(name)}"):
            path = Path(self.path(name))
            if path.is_dir():
                path.rmdir()
            else:
                path.unlink(missing_ok=True)


class _Unbuffered:
    """An unbuffered file whose `write` writes everything, or raises."""

    def __init__(self, file: Any):
        self._file = file

    def write(self, view: memoryview) -> None:
        """Write all of it."""
        remaining = view.cast("B")
        while len(remaining):
            remaining = remaining[self._file.write(remaining) :]

    def flush(self) -> None:
        """Do nothing: nothing is buffered."""


class _Refusing:
    """A file behind a URL whose errors become one line."""

    def __init__(self, file: Any, attempt: str):
        self._file, self._attempt = file, attempt

    def write(self, view: memoryview) -> None:
        """Write all of it."""
        with _refusals(self._attempt, Exception):
            self._file.write(view)

    def flush(self) -> None:
        """Do nothing: the upload decides when."""


class RemoteStorage(Storage):
    """A folder behind a URL."""

    def __init__(self, address: str):
        super().__init__(address)
        try:
            import fsspec

            self._files, self._root = fsspec.core.url_to_fs(address)
        except ImportError as missing:
            raise InputError(f"{address} needs a package: {missing}; pip install s3fs for s3://") from None
        except ValueError as unknown:
            raise InputError(f"{address}: {unknown}; give a folder or a URL that fsspec knows") from None

    def __reduce__(self) -> tuple[Any, ...]:
        return (RemoteStorage, (self.address,))

    def _path(self, name: str) -> str:
        return f"{self._root}/{name}" if name else self._root

    def names(self, folder: str = "") -> list[str]:
        with _refusals(f"read {self.path(folder)}", Exception):
            self._files.invalidate_cache()
            try:
                paths = self._files.ls(self._path(folder), detail=False)
            except FileNotFoundError:
                return []
            return sorted({str(path).rstrip("/").rsplit("/", 1)[-1] for path in paths})

    def size(self, name: str) -> int | None:
        with _refusals(f"read {self.path(name)}", Exception):
            self._files.invalidate_cache()
            try:
                return int(self._files.info(self._path(name))["size"])
            except FileNotFoundError:
                return None

    def read(self, name: str) -> pa.Buffer:
        with _refusals(f"read {self.path(name)}", Exception):
            return pa.py_buffer(self._files.cat_file(self._path(name)))

    @contextmanager
    def writer(self, name: str) -> Iterator[Sink]:
        attempt = f"write {self.path(name)}"
        with _refusals(attempt, Exception):
            file = self._files.open(self._path(name), "wb", autocommit=False)
        try:
            yield Sink(_Refusing(file, attempt))  # type: ignore[arg-type]
        except BaseException:
            with suppress(Exception):
                file.discard()
            with suppress(AttributeError):
                file.closed = True  # or it would be completed when it is collected
            raise
        with _refusals(attempt, Exception):
            file.close()
            file.commit()

    def create(self, name: str, text: str) -> bool:
        """Write a file unless it exists; return False where it does."""
        with _refusals(f"write {self.path(name)}", Exception):
            if self.size(name) is not None:
                return False
            try:
                self._files.pipe_file(self._path(name), text.encode(), mode="create")
            except FileExistsError:
                return False
            return True

    def move(self, source: str, target: str) -> None:
        with _refusals(f"write {self.path(target)}", Exception):
            self._files.mv(self._path(source), self._path(target))

    def delete(self, name: str) -> None:
        with _refusals(f"remove {self.path(name)}", Exception), suppress(FileNotFoundError):
            self._files.rm_file(self._path(name))


@contextmanager
def _refusals(attempt: str, kinds: type[Exception] = OSError) -> Iterator[None]:
    """Turn a refusal of the storage into one line."""
    try:
        yield
    except InputError:
        raise
    except kinds as refusal:
        reason = getattr(refusal, "strerror", None) or str(refusal) or type(refusal).__name__
        raise StorageError(f"cannot {attempt}: {reason}") from None


def _sync_folder(path: Path) -> None:
    """Make renames in a folder durable."""
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
