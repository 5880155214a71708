"""The lock of a folder that others can write: no link in it leads to another file that is written."""

from __future__ import annotations

import fcntl
import os
import socket
from pathlib import Path
from typing import Any

import pytest

from dataset.storage.lock import LOCK, locked
from dataset.storage.storage import LocalStorage
from sim.io.errors import InputError


def test_a_lock_that_is_a_symbolic_link_is_refused(tmp_path: Path) -> None:
    """The file that it points to used to be emptied."""
    (tmp_path / "precious").write_text("content")
    (tmp_path / LOCK).symlink_to("precious")
    with (
        pytest.raises(InputError, match=r"\.lock is a symbolic link; remove it"),
        locked(LocalStorage(str(tmp_path))),
    ):
        pytest.fail("the lock must not be taken")
    assert (tmp_path / "precious").read_text() == "content"


def test_a_lock_that_is_another_file_too_is_not_written_into(tmp_path: Path) -> None:
    (tmp_path / "precious").write_text("content")
    os.link(tmp_path / "precious", tmp_path / LOCK)
    with locked(LocalStorage(str(tmp_path))):
        assert '"pid"' in (tmp_path / LOCK).read_text()
    assert [path.name for path in tmp_path.iterdir()] == ["precious"]
    assert (tmp_path / "precious").read_text() == "content"


def test_a_second_writer_is_refused_and_a_dead_one_is_followed(tmp_path: Path) -> None:
    storage = LocalStorage(str(tmp_path))
    (tmp_path / LOCK).write_text("of a killed process")
    with (
        locked(storage),
        pytest.raises(InputError, match=f"being written by process {os.getpid()} on"),
        locked(storage),
    ):
        pytest.fail("the lock must not be taken twice")
    with locked(storage):
        assert (tmp_path / LOCK).exists()
    assert not (tmp_path / LOCK).exists()


def test_a_shard_is_not_written_through_a_link(tmp_path: Path) -> None:
    """The name of an unfinished file used to be known in advance."""
    (tmp_path / "precious").write_text("content")
    for name in (".a.txt", f".a.txt.{socket.gethostname()}.{os.getpid()}"):
        (tmp_path / name).symlink_to("precious")
    LocalStorage(str(tmp_path)).write("a.txt", "new")
    assert (tmp_path / "precious").read_text() == "content"
    assert (tmp_path / "a.txt").read_text() == "new"


@pytest.mark.parametrize("left", [None, "of a killed process"], ids=["removed", "replaced"])
def test_a_lock_that_is_removed_before_it_is_locked_is_made_again(
    left: str | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its owner ends between our opening and our locking: what we then hold is no longer the file of that name."""
    storage, lock, flock = LocalStorage(str(tmp_path)), tmp_path / LOCK, fcntl.flock

    def flock_late(*words: Any) -> None:
        monkeypatch.setattr(fcntl, "flock", flock)
        lock.unlink()
        if left is not None:
            lock.write_text(left)
        flock(*words)

    monkeypatch.setattr(fcntl, "flock", flock_late)
    with (
        locked(storage),
        pytest.raises(InputError, match=f"being written by process {os.getpid()} on"),
        locked(storage),
    ):
        pytest.fail("the lock must not be taken twice")
