"""dask as separate processes: the rows are the same bits, whatever is killed meanwhile."""

from __future__ import annotations

import os
import re
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import pytest
from filelock import FileLock

from common.errors import InputError
from dataset import build as engine
from dataset.build import UnfinishedError, build
from dataset.data_set import read
from tests.dataset import sweeps
from tests.dataset.sweeps import MARKS, design, invented
from tests.processes import LIMIT, ROOT, printed, until
from tests.shared import FOLDER

pytestmark = [
    pytest.mark.rest,
    pytest.mark.filterwarnings("ignore::DeprecationWarning", "ignore::ResourceWarning"),
]
ENVIRONMENT = {**os.environ, "PYTHONPATH": f"{ROOT}{os.pathsep}{os.environ.get('PYTHONPATH', '')}"}


@pytest.fixture(autouse=True)
def _one_cluster_at_a_time() -> Iterator[None]:
    with FileLock(FOLDER / "clusters.lock"):
        for mark in MARKS.iterdir():
            mark.unlink()
        yield


@pytest.fixture(scope="module")
def calm(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("calm") / "out"
    build(design(200), folder, jobs=1, title="", simulate=invented)
    return folder


def free_port() -> int:
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return int(one.getsockname()[1])


class Dask:
    """A scheduler and two workers, each its own process."""

    def __init__(self, folder: Path):
        self.folder, self.port = folder, free_port()
        self.address = f"tcp://127.0.0.1:{self.port}"
        words = ("scheduler", "--host", "127.0.0.1", "--port", str(self.port), "--no-dashboard")
        self.scheduler = self._start(*words)
        self.workers = [self.add_worker(), self.add_worker()]

    def _start(self, *words: str) -> subprocess.Popen[bytes]:
        with open(self.folder / "dask.log", "ab") as log:
            command = [sys.executable, "-m", "distributed.cli.dask_" + words[0], *words[1:]]
            return subprocess.Popen(
                command, cwd=self.folder, env=ENVIRONMENT, stdout=log, stderr=log, start_new_session=True
            )

    def add_worker(self, *words: str) -> subprocess.Popen[bytes]:
        """Start a worker under a nanny, which starts it again where it dies."""
        return self._start("worker", self.address, "--nthreads", "1", "--no-dashboard", *words)

    def stop(self) -> None:
        for process in (*self.workers, self.scheduler):
            with suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)  # with what it has started
            process.wait(timeout=LIMIT)


@pytest.fixture
def dask(tmp_path: Path) -> Iterator[Dask]:
    pytest.importorskip("distributed", reason="the extra dask is not installed")
    cluster = Dask(tmp_path)
    until(lambda: (tmp_path / "dask.log").read_bytes().count(b"Registered to") == 2, log=tmp_path / "dask.log")
    yield cluster
    cluster.stop()


def test_dask_makes_the_same_rows_and_replaces_killed_workers(
    dask: Dask, calm: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("DASK_SCHEDULER_ADDRESS", dask.address)
    build(design(200), "out", backend="dask", title="", simulate=sweeps.killing_once)
    assert read(tmp_path / "out").equals(read(calm))
    marks = [mark.name.split("-") for mark in MARKS.iterdir()]
    assert {number for *_, number, _ in marks} >= {"0", "1"}
    assert str(os.getpid()) not in {process for *_, process in marks}


def test_dask_sets_a_poisonous_chunk_aside(dask: Dask, tmp_path: Path) -> None:
    with pytest.raises(UnfinishedError, match=r"rows \d+ to \d+ \(its worker died 3 times"):
        build(
            design(200), tmp_path / "out", backend="dask", address=dask.address, title="",
            simulate=sweeps.poisonous,
        )  # fmt: skip
    assert len(list((tmp_path / "out" / "rows").iterdir())) == 7


def test_dask_goes_on_when_a_nanny_is_killed(dask: Dask, calm: Path, tmp_path: Path) -> None:
    process = build_apart(tmp_path / "out", "slow", "dask", dask.address)
    until(lambda: len(list(MARKS.iterdir())) >= 2 or process.poll() is not None)
    dask.workers[0].kill()
    assert printed(process)[1] == ""
    assert process.returncode == 0
    assert read(tmp_path / "out").equals(read(calm))


def test_dask_ends_when_its_scheduler_is_killed(dask: Dask, calm: Path, tmp_path: Path) -> None:
    process = build_apart(tmp_path / "out", "endless", "dask", dask.address, patience=2)
    until(lambda: len(list(MARKS.iterdir())) >= 2 or process.poll() is not None)
    dask.scheduler.kill()
    line = printed(process)[1]
    assert process.returncode == 1
    assert re.search(r"^error: no workers for 2 s: 0 of 200 rows are stored .* go on with", line)
    assert len(line.splitlines()) == 1


def test_dask_stops_when_told(dask: Dask, tmp_path: Path) -> None:
    process = build_apart(tmp_path / "out", "endless", "dask", dask.address)
    until(lambda: len(list(MARKS.iterdir())) >= 2 or process.poll() is not None)
    process.send_signal(signal.SIGINT)
    line = printed(process)[1]
    assert line.startswith("stopped: 0 of 200 rows")
    assert (process.returncode, len(line.splitlines())) == (130, 1)


def test_without_dask_workers_it_ends_with_a_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("distributed", reason="the extra dask is not installed")
    monkeypatch.setattr(engine, "PATIENCE", 1.0)
    monkeypatch.setattr(Dask, "add_worker", lambda self: subprocess.Popen(["true"]))
    cluster = Dask(tmp_path)
    with pytest.raises(UnfinishedError, match="no workers for 1 s"):
        build(design(9), tmp_path / "out", backend="dask", address=cluster.address, title="", simulate=invented)
    cluster.stop()


def test_no_scheduler_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("distributed", reason="the extra dask is not installed")
    monkeypatch.setattr("dataset.clusters._ANSWERS", 1.0)
    with pytest.raises(InputError, match="no dask scheduler"):
        build(
            design(9),
            tmp_path / "out",
            backend="dask",
            address=f"tcp://127.0.0.1:{free_port()}",
            title="",
            simulate=invented,
        )


@pytest.mark.parametrize("address", ["nonsense://x", "127.0.0.1:http", "xx://::", "tcp://:::", "here"])
def test_no_address_of_a_scheduler(address: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    distributed = pytest.importorskip("distributed", reason="the extra dask is not installed")
    monkeypatch.setattr(distributed, "Client", None)  # it would wait for itself at its end
    with pytest.raises(InputError, match=r"no dask scheduler answers at .* \((?!'NoneType)"):
        build(design(9), tmp_path / "out", backend="dask", address=address, title="", simulate=invented)


@pytest.mark.parametrize("failure", [RuntimeError("Nanny failed to start."), TimeoutError()])
def test_a_local_cluster_that_does_not_start(
    failure: Exception, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    distributed = pytest.importorskip("distributed", reason="the extra dask is not installed")

    def failing(**_: object) -> None:
        raise failure

    monkeypatch.setattr(distributed, "LocalCluster", failing)
    with pytest.raises(InputError, match=r"no dask scheduler answers at this machine \((Nanny|TimeoutError)"):
        build(design(9), tmp_path / "out", backend="dask", jobs=1, title="", simulate=invented)


def test_a_local_dask_cluster_ends_in_silence(calm: Path, tmp_path: Path) -> None:
    pytest.importorskip("distributed", reason="the extra dask is not installed")
    process = build_apart(tmp_path / "out", "invented", "dask", None)
    assert printed(process) == ("", "")
    assert process.returncode == 0
    assert read(tmp_path / "out").equals(read(calm))


def build_apart(
    folder: Path, rows_by: str, backend: str, address: str | None, *, patience: float = 60
) -> subprocess.Popen[str]:
    """Build as the command line does, by a script that would build again wherever it is imported."""
    script = folder.with_suffix(".py")
    script.write_text(
        "import sys, dataset.build\nfrom tests.dataset.sweeps import *\n"
        f"from dataset.build import build\ndataset.build.PATIENCE = {patience}\n"
        "from common.errors import run_command\n"
        "sys.exit(run_command(lambda _: build(design(200), "
        f"{str(folder)!r}, backend={backend!r}, address={address!r}, jobs=2, title='', simulate={rows_by})))"
    )
    return subprocess.Popen(
        [sys.executable, script], env=ENVIRONMENT, cwd=ROOT, text=True,
        stdout=subprocess.PIPE, stderr=subprocess.PIPE,
    )  # fmt: skip
