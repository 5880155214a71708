"""dask and ray as separate processes: the rows are the same bits, whatever is killed meanwhile."""

from __future__ import annotations

import os
import re
import signal
import socket
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path

import pytest
from filelock import FileLock

from dataset import build as engine
from dataset.build import UnfinishedError, build
from dataset.data_set import read
from sim.io.errors import InputError
from tests.dataset import sweeps
from tests.dataset.sweeps import MARKS, ROOT, design, invented
from tests.processes import LIMIT, alive, printed, until
from tests.shared import FOLDER

pytestmark = [
    pytest.mark.rest,
    pytest.mark.filterwarnings("ignore::DeprecationWarning", "ignore::ResourceWarning"),
]
Head = tuple[str, Callable[[], None]]
ENVIRONMENT = {name: value for name, value in os.environ.items() if not name.startswith("RAY_")} | {
    "PYTHONPATH": f"{ROOT}{os.pathsep}{os.environ.get('PYTHONPATH', '')}",
    "RAY_USAGE_STATS_ENABLED": "0",
}


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
        "from sim.io.errors import run_command\n"
        "sys.exit(run_command(lambda _: build(design(200), "
        f"{str(folder)!r}, backend={backend!r}, address={address!r}, jobs=2, title='', simulate={rows_by})))"
    )
    return subprocess.Popen(
        [sys.executable, script], env=ENVIRONMENT, cwd=ROOT, text=True,
        stdout=subprocess.PIPE, stderr=subprocess.PIPE,
    )  # fmt: skip


@pytest.fixture
def home(tmp_path: Path, request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Give this user no token of ray's, or one where the test asks for it."""
    pytest.importorskip("ray", reason="the extra ray is not installed")
    (tmp_path / ".ray").mkdir()
    if getattr(request, "param", False):
        (tmp_path / ".ray" / "auth_token").write_text(64 * "0")
    monkeypatch.setitem(ENVIRONMENT, "HOME", str(tmp_path))


@pytest.fixture
def ray(home: None, tmp_path: Path) -> Iterator[Head]:
    """Start a ray head with two processors; return its address and how to kill it with its children."""
    port, log = free_port(), tmp_path / "ray.log"
    words = ["start", "--head", "--block", "--port", str(port), "--num-cpus", "2", "--include-dashboard", "false"]
    code = "import sys; from ray.scripts.scripts import main; sys.exit(main())"
    with open(log, "wb") as file:
        head = subprocess.Popen(
            [sys.executable, "-c", code, *words, "--object-store-memory", "100000000"],
            env=ENVIRONMENT, stdout=file, stderr=file, start_new_session=True,
        )  # fmt: skip
    until(lambda: b"Ray runtime started" in log.read_bytes() or head.poll() is not None, log=log)
    assert head.poll() is None, log.read_text()

    def kill() -> None:
        with suppress(ProcessLookupError):
            os.killpg(head.pid, signal.SIGKILL)
        head.wait(timeout=LIMIT)

    yield f"127.0.0.1:{port}", kill
    kill()


def test_ray_ends_when_its_head_is_killed(ray: Head, tmp_path: Path) -> None:
    process = build_apart(tmp_path / "out", "endless", "ray", ray[0], patience=2)
    until(lambda: len(list(MARKS.iterdir())) >= 2 or process.poll() is not None)
    ray[1]()
    line = printed(process)[1].strip().splitlines()[-1]
    assert re.search(r"^error: no workers for 2 s: 0 of 200 rows are stored .* go on with", line)
    assert process.returncode == 1


@pytest.mark.parametrize("home", [False, True], indirect=True)
def test_ray_makes_the_same_rows(ray: Head, calm: Path, tmp_path: Path) -> None:
    process = build_apart(tmp_path / "out", "killing_once", "ray", ray[0])
    shown, failures = printed(process)
    assert (process.returncode, failures) == (0, "")
    assert "Traceback" not in shown  # ray itself tells of the killed workers
    assert read(tmp_path / "out").equals(read(calm))
    assert {mark.name.split("-")[-2] for mark in MARKS.iterdir()} >= {"0", "1"}


@pytest.mark.parametrize("home", [True], indirect=True)
def test_ray_without_its_token_ends_with_a_line(
    ray: Head, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(ENVIRONMENT, "RAY_AUTH_MODE", "disabled")
    process = build_apart(tmp_path / "out", "invented", "ray", ray[0])
    assert re.fullmatch(r"error: no ray cluster at .* set RAY_AUTH_MODE=token .*\n", printed(process)[1])
    assert process.returncode == 2


def test_a_local_ray_cluster_ends_with_its_parent(home: None, tmp_path: Path) -> None:
    import psutil

    process = build_apart(tmp_path / "out", "endless", "ray", None)
    until(lambda: len(list(MARKS.iterdir())) >= 2, process)
    cluster = [each.pid for each in psutil.Process(process.pid).children(recursive=True)]
    agents = [each for each in cluster if b"Agent" in Path(f"/proc/{each}/cmdline").read_bytes()]
    assert len(agents) == 2
    for agent in agents:
        os.kill(agent, signal.SIGSTOP)  # or they would end, by themselves, after a minute
    process.kill()
    assert printed(process) == ("", "")
    until(lambda: not any(map(alive, cluster)))


def test_ray_sets_a_poisonous_chunk_aside_and_stops_when_told(ray: Head, tmp_path: Path) -> None:
    process = build_apart(tmp_path / "out", "poisonous", "ray", ray[0])
    line = printed(process)[1].strip().splitlines()[-1]
    assert re.search(r"rows \d+ to \d+ \(its worker died 3 times", line)
    assert process.returncode == 1
    stopped = build_apart(tmp_path / "stopped", "endless", "ray", ray[0])
    until(lambda: any("endless" in mark.name for mark in MARKS.iterdir()))
    stopped.send_signal(signal.SIGINT)
    assert printed(stopped)[1].strip().splitlines()[-1].startswith("stopped: 0 of 200 rows")
    assert stopped.returncode == 130


def test_no_ray_there(tmp_path: Path) -> None:
    pytest.importorskip("ray", reason="the extra ray is not installed")
    with pytest.raises(InputError, match="no ray cluster answers"):
        build(design(9), tmp_path / "out", backend="ray", address=f"127.0.0.1:{free_port()}", title="")
