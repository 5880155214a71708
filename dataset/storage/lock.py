"""Lock a data set: one writer a folder, and a note that says who writes and since when.

On a disk the operating system holds the lock and releases it when the writer ends, however it ends. Behind a URL
the lock is a file, which stays if its writer is killed; `force` takes it over.
"""

from __future__ import annotations

import fcntl
import json
import os
import socket
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from typing import IO

from dataset.storage.storage import LocalStorage, RemoteStorage, Storage, StorageError
from sim.io.errors import InputError
from sim.io.files import open_no_link

LOCK = ".lock"


@contextmanager
def locked(storage: Storage, *, force: bool = False) -> Iterator[None]:
    """Hold the lock of a storage for as long as the block lasts: its holder is the only writer.

    Args:
        force: take over the lock file of another writer behind a URL.

    Raises:
        InputError: another process writes there.
    """
    if isinstance(storage, RemoteStorage):
        with _lock_remote(storage, force):
            yield
    else:
        assert isinstance(storage, LocalStorage)
        with _lock_folder(storage):
            yield


def _note() -> str:
    return json.dumps({"host": socket.gethostname(), "pid": os.getpid(), "since": time.time()})


def _refusal(storage: Storage, note: str, remedy: str) -> InputError:
    try:
        content = json.loads(note)
        minutes = max(0.0, time.time() - content["since"]) / 60
        owner = f"process {content['pid']} on {content['host']}, for {minutes:.0f} min"
    except (ValueError, KeyError, TypeError):
        owner = "another process"
    return InputError(f"{storage.address} is being written by {owner}; {remedy}")


@contextmanager
def _lock_folder(storage: LocalStorage) -> Iterator[None]:
    try:
        os.makedirs(storage.address, exist_ok=True)
        file = _acquired(storage)
    except OSError as refusal:
        raise StorageError(f"cannot write {storage.path(LOCK)}: {refusal.strerror or refusal}") from None
    try:
        yield
    finally:
        with suppress(OSError):
            os.unlink(storage.path(LOCK))
        file.close()


def _acquired(storage: LocalStorage) -> IO[str]:
    """Make the lock file, lock it, and write who holds it; one that nobody holds is removed, not written into."""
    path = storage.path(LOCK)
    while True:
        file, is_new = _opened(path)
        with ExitStack() as closing:
            closing.callback(file.close)
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                raise _refusal(storage, file.read(), "wait until it ends, or give another folder") from None
            with suppress(FileNotFoundError):  # its owner removed it after we had opened and before we locked it
                if os.path.samestat(os.fstat(file.fileno()), os.lstat(path)):
                    if is_new:
                        file.write(_note())
                        file.flush()
                        closing.pop_all()
                        return file
                    os.unlink(path)


def _opened(path: str) -> tuple[IO[str], bool]:
    """Open the lock file, and tell whether it is new."""
    while True:
        with suppress(FileExistsError):
            return os.fdopen(open_no_link(path, new=True), "r+"), True
        with suppress(FileNotFoundError):
            return os.fdopen(open_no_link(path, new=False), "r+"), False


@contextmanager
def _lock_remote(storage: RemoteStorage, force: bool) -> Iterator[None]:
    if force:
        storage.write(LOCK, _note())
    elif not storage.create(LOCK, _note()):
        note = bytes(storage.read(LOCK)).decode(errors="replace")
        raise _refusal(storage, note, "wait until it ends, or take over with --force if it was killed")
    try:
        yield
    finally:
        with suppress(InputError):
            storage.delete(LOCK)
