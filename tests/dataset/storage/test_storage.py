"""Data sets on disks and behind URLs: one writer at a time, no links, the same files, the same refusals."""

from __future__ import annotations

import fcntl
import hashlib
import json
import os
import re
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest

import dataset.build.build
from dataset.build.build import build, mend
from dataset.storage.data_set import batches, read, read_manifest
from dataset.storage.lock import LOCK, locked
from dataset.storage.storage import LocalStorage, RemoteStorage, open_storage
from sim.io.errors import InputError
from tests.dataset.sweeps import ROOT, InThisProcess, design, invented
from tests.processes import LIMIT


def test_a_lock_does_not_change_another_file(tmp_path: Path) -> None:
    storage, lock, precious = LocalStorage(str(tmp_path)), tmp_path / LOCK, tmp_path / "precious"
    precious.write_text("content")
    lock.symlink_to("precious")
    with pytest.raises(InputError, match=r"\.lock is a symbolic link; remove it"), locked(storage):
        pytest.fail("the lock must not be taken")
    lock.unlink()
    os.link(precious, lock)
    with locked(storage):
        assert '"pid"' in lock.read_text()
    assert [path.name for path in tmp_path.iterdir()] == ["precious"]
    assert precious.read_text() == "content"


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
    """The name of an unfinished file is not known in advance."""
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


def files(address: str) -> dict[str, str]:
    there = open_storage(address)
    names = [n for n in there.names() if "." in n] + [f"rows/{name}" for name in there.names("rows")]
    return {name: hashlib.sha256(there.read(name)).hexdigest() for name in names if name != "card.md"}


@pytest.fixture
def calm(tmp_path: Path) -> Path:
    build(design(200), tmp_path / "calm", jobs=1, title="", simulate=invented)
    return tmp_path / "calm"


@pytest.fixture
def memory(monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest) -> str:
    """Provide a folder in the memory of this process, and workers in it."""
    monkeypatch.setattr(dataset.build.build, "open_backend", lambda *_, **__: InThisProcess())
    return f"memory://{re.sub(r'[^a-z_]', '', request.node.name)}"


def test_a_url_holds_the_same_files(memory: str, calm: Path) -> None:
    build(design(90), memory, title="", simulate=invented)
    build(design(200), memory, title="", simulate=invented)
    assert read(memory).equals(read(calm))
    assert files(memory) == files(str(calm))
    assert sum(batch.num_rows for batch in batches(memory, ["v_x"])) == 200


def test_damage_behind_a_url_is_refused_and_mended(
    memory: str, calm: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    build(design(200), memory, title="", simulate=invented)
    storage = open_storage(memory)
    (name,) = storage.names("rows")
    contents = bytes(storage.read(f"rows/{name}"))
    with storage.writer(f"rows/{name}") as sink:
        sink.write(contents[:5000] + bytes([contents[5000] ^ 4]) + contents[5001:])
    with pytest.raises(InputError, match="digest"):
        read(memory)
    storage.delete(f"rows/{name}")
    with pytest.raises(InputError, match="missing"):
        read(memory)
    mend(memory, title="", simulate=invented)
    assert read(memory).equals(read(calm))


def test_one_writer_behind_a_url(memory: str) -> None:
    storage = open_storage(memory)
    with locked(storage), pytest.raises(InputError, match="is being written by process"):
        build(design(9), memory, title="", simulate=invented)
    killed = {"host": "elsewhere", "pid": 1, "since": time.time() - 7200}
    storage.write(LOCK, json.dumps(killed))
    with pytest.raises(InputError, match=r"process 1 on elsewhere, for 120 min; .* take over with --force"):
        build(design(9), memory, title="", simulate=invented)
    assert json.loads(bytes(storage.read(LOCK))) == killed
    build(design(9), memory, title="", simulate=invented, force=True)
    assert storage.size(LOCK) is None


def test_unknown_urls_and_missing_packages_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    def missing(_: str) -> None:
        raise ImportError("Install s3fs to access S3")

    with pytest.raises(InputError, match="nonsense"):
        build(design(9), "nonsense://x/y", title="", simulate=invented)
    monkeypatch.setattr("fsspec.core.url_to_fs", missing)
    with pytest.raises(InputError, match="pip install s3fs"):
        RemoteStorage("s3://bucket/folder")


@pytest.fixture
def bucket(monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    """Provide a bucket of an S3 server of this machine."""
    pytest.importorskip("s3fs", reason="the extra s3 is not installed")
    pytest.importorskip("moto", reason="moto is not installed")
    from moto.server import ThreadedMotoServer

    server = ThreadedMotoServer("127.0.0.1", port=0, verbose=False)
    server.start()
    for name, value in {
        "AWS_ENDPOINT_URL": "http://{}:{}".format(*server.get_host_and_port()), "AWS_ACCESS_KEY_ID": "test",
        "AWS_SECRET_ACCESS_KEY": "test", "AWS_DEFAULT_REGION": "us-east-1",
    }.items():  # fmt: skip
        monkeypatch.setenv(name, value)
    import s3fs

    s3fs.S3FileSystem.clear_instance_cache()
    s3fs.S3FileSystem().mkdir("sweeps")
    yield "s3://sweeps/one"
    server.stop()


@pytest.mark.rest
@pytest.mark.filterwarnings("ignore::DeprecationWarning", "ignore::ResourceWarning")
def test_s3_holds_the_same_files(bucket: str, calm: Path) -> None:
    code = (
        "from tests.dataset.sweeps import *; from dataset.build.build import build; "
        f"build(design(200), {bucket!r}, jobs=2, title='', simulate=invented)"
    )
    subprocess.run([sys.executable, "-c", code], cwd=ROOT, check=True, timeout=LIMIT)
    assert read(bucket).equals(read(calm))
    assert files(bucket) == files(str(calm))
    assert read_manifest(bucket) == read_manifest(calm)
    storage = open_storage(bucket)
    assert isinstance(storage, RemoteStorage)
    with locked(storage):
        assert not storage.create(LOCK, "{}")
    with suppress(ZeroDivisionError), storage.writer("rows/x") as sink:
        sink.write(b"half")
        raise ZeroDivisionError
    assert storage.size("rows/x") is None
    storage.delete("manifest.json")
    with pytest.raises(InputError, match="no finished data set"):
        read(bucket)
