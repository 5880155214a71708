"""Data sets on disks and behind URLs: one writer at a time, no links, the same rows, the same refusals."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from common.errors import InputError
from dataset import build as engine
from dataset.build import build, mend
from dataset.data_set import batches, read
from dataset.folder import LOCK, Folder, StorageError
from dataset.shards import ROWS
from tests.dataset.sweeps import InThisProcess, design, invented
from tests.processes import LIMIT, ROOT


def test_a_lock_does_not_change_another_file(tmp_path: Path) -> None:
    lock, precious = tmp_path / LOCK, tmp_path / "precious"
    precious.write_text("content")
    for link in (lock.symlink_to, lock.hardlink_to):
        link(precious)
        with pytest.raises(InputError, match=r"\.lock is a .*link.*; remove it"), Folder(tmp_path).locked():
            pytest.fail("the lock must not be taken")
        lock.unlink()
    assert precious.read_text() == "content"


def test_a_second_writer_is_refused_and_a_dead_one_is_followed(tmp_path: Path) -> None:
    (tmp_path / LOCK).write_text("of a killed process")
    for _ in range(2):
        with (
            Folder(tmp_path).locked(),
            pytest.raises(InputError, match=f"being written by process {os.getpid()} on"),
            Folder(tmp_path).locked(),
        ):
            pytest.fail("the lock must not be taken twice")


def test_a_file_is_written_whole_or_not_at_all_and_through_no_link(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "precious").write_text("content")
    (tmp_path / "a.txt").symlink_to("precious")
    Folder(tmp_path).write("a.txt", b"new")
    assert ((tmp_path / "precious").read_text(), (tmp_path / "a.txt").read_text()) == ("content", "new")

    def full(_: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(StorageError, match=r"cannot write .*a\.txt: No space left"):
        Folder(tmp_path).write("a.txt", b"newer")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.txt", "precious"]
    assert (tmp_path / "a.txt").read_text() == "new"


@pytest.fixture
def calm(tmp_path: Path) -> Path:
    build(design(200), tmp_path / "calm", jobs=1, title="", simulate=invented)
    return tmp_path / "calm"


@pytest.fixture
def memory(monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest) -> str:
    """Provide a folder in the memory of this process, and workers in it."""
    monkeypatch.setattr(engine, "open_backend", lambda *_: InThisProcess())
    return f"memory://{re.sub(r'[^a-z_]', '', request.node.name)}"


def test_a_url_holds_the_same_rows_and_damage_is_mended(memory: str, calm: Path) -> None:
    build(design(90), memory, title="", simulate=invented)
    build(design(200), memory, title="", simulate=invented)
    assert read(memory).equals(read(calm))
    assert sum(batch.num_rows for batch in batches(memory, ["v_x"])) == 200
    folder = Folder(memory)
    name = f"{ROWS}/{folder.names(ROWS)[1]}"
    contents = folder.read(name)
    folder.write(name, contents[:5000] + bytes([contents[5000] ^ 4]) + contents[5001:])
    with pytest.raises(InputError, match="digest"):
        read(memory)
    folder.delete(name)
    with pytest.raises(InputError, match="missing"):
        read(memory)
    mend(memory, title="", simulate=invented)
    assert read(memory).equals(read(calm))


def test_one_writer_behind_a_url(memory: str) -> None:
    folder = Folder(memory)
    with folder.locked(), pytest.raises(InputError, match="is being written by process"):
        build(design(9), memory, title="", simulate=invented)
    killed = {"host": "elsewhere", "pid": 1, "since": time.time() - 7200}
    folder.write(LOCK, json.dumps(killed).encode())
    with pytest.raises(InputError, match=r"process 1 on elsewhere, for 120 min; .*--force"):
        build(design(9), memory, title="", simulate=invented)
    assert json.loads(folder.read(LOCK)) == killed
    build(design(9), memory, title="", simulate=invented, force=True)
    assert LOCK not in folder.names()


def test_unknown_urls_and_missing_packages_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    def missing(_: str) -> None:
        raise ImportError("Install s3fs to access S3")

    with pytest.raises(InputError, match="nonsense"):
        build(design(9), "nonsense://x/y", title="", simulate=invented)
    monkeypatch.setattr("fsspec.core.url_to_fs", missing)
    with pytest.raises(InputError, match="pip install s3fs"):
        Folder("s3://bucket/folder")


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
def test_s3_holds_the_same_rows(bucket: str, calm: Path) -> None:
    code = (
        "from tests.dataset.sweeps import *; from dataset.build import build; "
        f"build(design(200), {bucket!r}, jobs=2, title='', simulate=killing_once)"
    )
    subprocess.run([sys.executable, "-c", code], cwd=ROOT, check=True, timeout=LIMIT)
    assert read(bucket).equals(read(calm))
    folder = Folder(bucket)
    with folder.locked(), pytest.raises(InputError, match="is being written by"), Folder(bucket).locked():
        pytest.fail("the lock must not be taken twice")
    folder.delete("manifest.json")
    with pytest.raises(InputError, match="no finished data set"):
        read(bucket)
    with pytest.raises(InputError, match="cannot write s3://nowhere/x/a: "):
        Folder("s3://nowhere/x").write("a", b"")
