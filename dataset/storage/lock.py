"""One writer a folder: a lock that says who holds it and since when.

On a disk the operating system holds the lock and lets go when the writer ends, however it ends. Behind a URL the
lock is a file that its owner renews; one that has not been renewed for STALE seconds is taken over.
"""

from __future__ import annotations

import fcntl
import json
import os
import socket
import threading
import time
import uuid
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import IO

from dataset.storage.storage import Folder, Place, Remote, StorageError
from sim.io.errors import InputError

LOCK = ".lock"
STALE = 120.0  # seconds
_RENEWED = 20.0  # seconds


@contextmanager
def locked(place: Place) -> Iterator[None]:
    """The only writer of a place for as long as the block lasts.

    Raises:
        InputError: another process writes there.
    """
    with _lock_folder(place) if isinstance(place, Folder) else _lock_remote(place):  # type: ignore[arg-type]
        yield


def _note(token: str = "") -> str:
    now = time.time()
    return json.dumps(
        {"host": socket.gethostname(), "pid": os.getpid(), "since": now, "seen": now, "token": token}
    )


def _refuse(place: Place, text: str) -> InputError:
    try:
        note = json.loads(text)
        minutes = max(0.0, time.time() - note["since"]) / 60
        owner = f"process {note['pid']} on {note['host']}, for {minutes:.0f} min"
    except (ValueError, KeyError, TypeError):
        owner = "another process"
    return InputError(f"{place.address} is being written by {owner}; wait until it ends, or give another folder")


@contextmanager
def _lock_folder(place: Folder) -> Iterator[None]:
    try:
        os.makedirs(place.address, exist_ok=True)
        file = _acquired(place)
    except OSError as refusal:
        raise StorageError(f"cannot write {place.path(LOCK)}: {refusal.strerror}") from None
    try:
        yield
    finally:
        with suppress(OSError):
            os.unlink(place.path(LOCK))
        file.close()


def _acquired(place: Folder) -> IO[str]:
    path = place.path(LOCK)
    while True:
        file = open(path, "a+")  # noqa: SIM115
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            file.seek(0)
            refusal = _refuse(place, file.read())
            file.close()
            raise refusal from None
        except OSError:
            file.close()
            raise
        with suppress(FileNotFoundError):
            if os.fstat(file.fileno()).st_ino == os.stat(path).st_ino:
                break
        file.close()  # its owner removed it between our opening and locking it
    try:
        file.truncate(0)
        file.write(_note())
        file.flush()
    except OSError:
        file.close()
        raise
    return file


@contextmanager
def _lock_remote(place: Remote) -> Iterator[None]:
    token = uuid.uuid4().hex
    if not place.create(LOCK, _note(token)):
        held = bytes(place.read(LOCK)).decode(errors="replace")
        if not _is_stale(held):
            raise _refuse(place, held)
        place.write(LOCK, _note(token))
        time.sleep(1.0)  # where two take over at once, the later one has it
        if token not in bytes(place.read(LOCK)).decode(errors="replace"):
            raise _refuse(place, held)
    over = threading.Event()
    renewal = threading.Thread(target=_renew, args=(place, token, over), daemon=True)
    renewal.start()
    try:
        yield
    finally:
        over.set()
        renewal.join()
        with suppress(InputError):
            place.delete(LOCK)


def _renew(place: Remote, token: str, over: threading.Event) -> None:
    note = json.loads(_note(token))
    while not over.wait(_RENEWED):
        with suppress(InputError):
            place.write(LOCK, json.dumps({**note, "seen": time.time()}))


def _is_stale(text: str) -> bool:
    try:
        return bool(time.time() - json.loads(text)["seen"] > STALE)
    except (ValueError, KeyError, TypeError):
        return True
