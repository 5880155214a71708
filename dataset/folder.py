"""The folder of a data set, on a disk or behind a URL that fsspec knows (s3://bucket/name, …).

A file appears whole or not at all: on a disk it is written under another name, synchronised and renamed; behind a
URL it is one upload. What a storage refuses (full, read-only, no rights) is a `StorageError` of one line.
"""

from __future__ import annotations

import fcntl
import json
import os
import socket
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from uuid import uuid4

from common.errors import InputError
from common.files import open_no_link

LOCK, UNFINISHED = ".lock", ".part-"


class StorageError(InputError):
    """The storage refuses an operation; the message is one line."""


class Folder:
    """Files in a folder and its sub-folders; names are relative, with "/"."""

    def __init__(self, address: str | Path):
        import fsspec

        text = str(address).removeprefix("file://").rstrip("/") or "/"
        self.local = "://" not in text
        self.address = os.path.abspath(text) if self.local else text  # it means the same on another machine
        try:
            self._files, self._root = fsspec.core.url_to_fs(self.address)
        except ImportError as missing:
            raise InputError(f"{address} needs a package: {missing}; pip install s3fs for s3://") from None
        except ValueError as unknown:
            raise InputError(f"{address}: {unknown}; give a folder or a URL that fsspec knows") from None

    def path(self, name: str) -> str:
        """Return a file's full address."""
        return f"{self.address}/{name}"

    def names(self, under: str = "") -> list[str]:
        """List files and folders, sorted, without the folder's name; none where it is missing."""
        with _refusals(f"read {self.path(under)}"), suppress(FileNotFoundError):
            self._files.invalidate_cache()
            paths = self._files.ls(f"{self._root}/{under}".rstrip("/"), detail=False)
            return sorted({str(path).rstrip("/").rsplit("/", 1)[-1] for path in paths})
        return []

    def read(self, name: str) -> bytes:
        """Read a file."""
        with _refusals(f"read {self.path(name)}"):
            return bytes(self._files.cat_file(f"{self._root}/{name}"))

    def write(self, name: str, data: bytes) -> None:
        """Write a file; it replaces one of its name."""
        with _refusals(f"write {self.path(name)}"):
            if not self.local:
                self._files.pipe_file(f"{self._root}/{name}", data)
                return
            path, part = Path(self.path(name)), Path(self.path(f"{UNFINISHED}{uuid4().hex}"))
            path.parent.mkdir(parents=True, exist_ok=True)
            try:
                with open(part, "xb") as file:  # "x" follows no link
                    file.write(data)
                    file.flush()
                    os.fsync(file.fileno())
                os.replace(part, path)
            finally:
                part.unlink(missing_ok=True)
            folder = os.open(path.parent, os.O_RDONLY)
            os.fsync(folder)  # of the renaming
            os.close(folder)

    def delete(self, name: str) -> None:
        """Remove a file, if it is there."""
        with _refusals(f"remove {self.path(name)}"), suppress(FileNotFoundError):
            self._files.rm_file(f"{self._root}/{name}")

    @contextmanager
    def locked(self, *, force: bool = False) -> Iterator[None]:
        """Hold the lock for as long as the block lasts: its holder is the only writer.

        On a disk the operating system holds the lock and releases it when the writer ends, however it ends; its
        file stays, so all writers lock the same one. Behind a URL the file is the lock, which stays if its writer
        is killed.

        Args:
            force: take over the lock of another writer behind a URL.

        Raises:
            InputError: another process writes there.
        """
        note = json.dumps({"host": socket.gethostname(), "pid": os.getpid(), "since": time.time()})
        if self.local:
            with _refusals(f"write {self.path(LOCK)}"):
                os.makedirs(self.address, exist_ok=True)
                with suppress(FileExistsError):
                    os.close(open_no_link(self.path(LOCK), new=True))
                file = os.fdopen(open_no_link(self.path(LOCK), new=False), "r+")
            with file:
                # A hard link would let a lock file be another file, which is emptied below.
                if os.fstat(file.fileno()).st_nlink > 1:
                    raise InputError(f"{self.path(LOCK)} is a link to another file; remove it")
                try:
                    fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
                except BlockingIOError:
                    raise self._busy(file.read(), "wait until it ends, or give another folder") from None
                with _refusals(f"write {self.path(LOCK)}"):
                    file.truncate(0)
                    file.write(note)
                    file.flush()
                yield
            return
        try:
            with _refusals(f"write {self.path(LOCK)}"):
                self._files.pipe_file(
                    f"{self._root}/{LOCK}", note.encode(), mode="overwrite" if force else "create"
                )
        except StorageError:
            # Stores differ in what they raise where a file exists, so the reason is looked up.
            if LOCK not in self.names():
                raise
            remedy = "wait until it ends, or take over with --force if it was killed"
            raise self._busy(self.read(LOCK).decode(errors="replace"), remedy) from None
        try:
            yield
        finally:
            with suppress(InputError):
                self.delete(LOCK)

    def _busy(self, note: str, remedy: str) -> InputError:
        owner = "another process"
        with suppress(ValueError, KeyError, TypeError):
            content = json.loads(note)
            minutes = max(0.0, time.time() - content["since"]) / 60
            owner = f"process {content['pid']} on {content['host']}, for {minutes:.0f} min"
        return InputError(f"{self.address} is being written by {owner}; {remedy}")


@contextmanager
def _refusals(attempt: str) -> Iterator[None]:
    """Turn a refusal of the storage, whatever its library raises, into one line."""
    try:
        yield
    except InputError:
        raise
    except Exception as refusal:
        reason = getattr(refusal, "strerror", None) or str(refusal) or type(refusal).__name__
        raise StorageError(f"cannot {attempt}: {reason}") from None
