"""Data sets behind URLs: the same files as on a disk, the same refusals."""

from __future__ import annotations

import hashlib
import json
import os
import re
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

import dataset.build.build
from dataset.build.build import build, mend
from dataset.storage import lock
from dataset.storage.data_set import batches, read, read_manifest
from dataset.storage.lock import locked
from dataset.storage.storage import RemoteStorage, open_storage
from sim.io.errors import InputError
from tests.dataset.sweeps import ROOT, InThisProcess, design, invented
from tests.processes import LIMIT


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
    storage.write(lock.LOCK, json.dumps(killed))
    with pytest.raises(InputError, match=r"process 1 on elsewhere, for 120 min; .* take over with --force"):
        build(design(9), memory, title="", simulate=invented)
    assert json.loads(bytes(storage.read(lock.LOCK))) == killed
    build(design(9), memory, title="", simulate=invented, force=True)
    assert storage.size(lock.LOCK) is None


def test_unknown_urls_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="nonsense"):
        build(design(9), "nonsense://x/y", title="", simulate=invented)


@pytest.fixture
def bucket(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[str]:
    """Provide a bucket of an S3 server of this machine."""
    pytest.importorskip("s3fs", reason="the extra s3 is not installed")
    pytest.importorskip("moto", reason="moto is not installed")
    with socket.socket() as connection:
        connection.bind(("127.0.0.1", 0))
        port = connection.getsockname()[1]
    for name, value in {
        "AWS_ENDPOINT_URL": f"http://127.0.0.1:{port}", "AWS_ACCESS_KEY_ID": "test",
        "AWS_SECRET_ACCESS_KEY": "test", "AWS_DEFAULT_REGION": "us-east-1",
    }.items():  # fmt: skip
        monkeypatch.setenv(name, value)
    with open(tmp_path / "moto.log", "wb") as log:
        words = [sys.executable, "-m", "moto.server", "-H", "127.0.0.1", "-p", str(port)]
        server = subprocess.Popen(words, stdout=log, stderr=log)
    while True:
        with socket.socket() as connection:
            if connection.connect_ex(("127.0.0.1", port)) == 0:
                break
        assert server.poll() is None, (tmp_path / "moto.log").read_text()
        time.sleep(0.05)
    import s3fs

    s3fs.S3FileSystem.clear_instance_cache()
    s3fs.S3FileSystem().mkdir("sweeps")
    yield "s3://sweeps/one"
    server.kill()
    server.wait(timeout=LIMIT)


def break_off(storage: RemoteStorage) -> None:
    with storage.writer("rows/x") as sink:
        sink.write(b"half")
        raise ZeroDivisionError


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::DeprecationWarning", "ignore::ResourceWarning")
def test_s3_holds_the_same_files(bucket: str, calm: Path) -> None:
    code = (
        "from tests.dataset.sweeps import *; from dataset.build.build import build; "
        f"build(design(200), {bucket!r}, jobs=2, title='', simulate=invented)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, env=dict(os.environ), text=True, capture_output=True, timeout=LIMIT
    )
    assert done.returncode == 0, done.stderr
    assert read(bucket).equals(read(calm))
    assert files(bucket) == files(str(calm))
    assert read_manifest(bucket) == read_manifest(calm)
    storage = open_storage(bucket)
    assert isinstance(storage, RemoteStorage)
    with locked(storage):
        assert not storage.create(lock.LOCK, "{}")
    with pytest.raises(ZeroDivisionError):
        break_off(storage)
    assert storage.size("rows/x") is None
    storage.delete("manifest.json")
    with pytest.raises(InputError, match="no finished data set"):
        read(bucket)
