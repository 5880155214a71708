"""Faults of the machine: signals, kills at any time, disks that are full or read-only.

Afterwards the rows are those of an undisturbed build, or there is one line that says no.
"""

from __future__ import annotations

import os
import resource
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import pytest

from dataset.build import build
from dataset.data_set import read, read_manifest
from tests.dataset import sweeps
from tests.dataset.sweeps import MARKS, SMALL, design, invented, without_cost
from tests.processes import LIMIT, ROOT, alive, printed, until

pytestmark = pytest.mark.slow


@pytest.fixture(autouse=True)
def _no_marks() -> None:
    for mark in MARKS.iterdir():
        mark.unlink()


def started(code: str, *, limit: int | None = None) -> subprocess.Popen[str]:
    """Start a Python process that builds; `limit`: bytes of its largest file, and of its workers'."""

    def limited() -> None:
        if limit is not None:
            resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))

    words = (
        "from tests.dataset.sweeps import *; from dataset.build import *; from dataset.__main__ import program; "
    )
    return subprocess.Popen(
        [sys.executable, "-c", words + code],
        cwd=ROOT, text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE, preexec_fn=limited,
    )  # fmt: skip


def building(folder: Path, rows: int, rows_by: str) -> str:
    """Write code that builds as the command line does."""
    return (
        "import sys; from common.errors import run_command; "
        f"sys.exit(run_command(lambda _: build(design({rows}), {str(folder)!r}, jobs=2, title='', "
        f"simulate={rows_by}, resume='the same words')))"
    )


def workers() -> list[int]:
    return [int(mark.name.rsplit("-", 1)[1]) for mark in MARKS.iterdir()]


def same_rows(folder: Path, rows: int, calm: Path) -> None:
    """Finish a build, and compare it with an undisturbed one."""
    build(design(rows), folder, jobs=2, title="", simulate=invented)
    build(design(rows), calm, jobs=1, title="", simulate=invented)
    assert read(folder).equals(read(calm))
    assert read_manifest(folder)["converged"] == read_manifest(calm)["converged"]
    assert {path.name for path in folder.iterdir()} == {".lock", "card.md", "manifest.json", "rows", "sweep.json"}


@pytest.mark.parametrize("number", [signal.SIGINT, pytest.param(signal.SIGTERM, marks=pytest.mark.rest)])
def test_an_interrupt_ends_it_with_one_line_and_the_workers(number: int, tmp_path: Path) -> None:
    process = started(building(tmp_path / "out", 400, "endless"))
    until(lambda: len(workers()) == 2, process)
    process.send_signal(number)
    _, line = printed(process)
    assert process.returncode == 128 + number
    assert line.strip() == f"stopped: 0 of 400 rows are stored in {tmp_path}/out; go on with: the same words"
    until(lambda: not any(alive(worker) for worker in workers()))


@pytest.mark.rest
def test_the_command_line_stops_and_goes_on(tmp_path: Path) -> None:
    (tmp_path / "sweep.toml").write_text(SMALL.replace("rows = 6", "rows = 64"))
    words = ["build", "--config", str(tmp_path / "sweep.toml"), "--out", str(tmp_path / "out"), "--jobs", "2"]
    process = started(f"import sys; sys.argv[1:] = {words}; program.exit()")
    until(lambda: bool(list(tmp_path.glob("out/rows/rows-*"))), process)
    os.kill(process.pid, signal.SIGINT)
    _, error = printed(process)
    assert process.returncode == 130
    line = error.strip().splitlines()[-1]
    assert line.startswith("stopped: ")
    command = line.split("go on with: ")[1].split()
    assert command == ["softflagella", "sweep", *words[1:]]
    kept = {path: path.stat().st_mtime_ns for path in (tmp_path / "out" / "rows").iterdir()}
    calm = [str(tmp_path / "calm") if word == str(tmp_path / "out") else word for word in words]
    for each in (["build", *command[2:]], calm):
        again = started(f"import sys; sys.argv[1:] = {each}; program.exit()")
        assert "64 rows: 64 converged" in printed(again)[0]
    assert {path: path.stat().st_mtime_ns for path in kept} == kept
    assert without_cost(read(tmp_path / "out")).equals(without_cost(read(tmp_path / "calm")))


def test_two_builds_at_once_and_workers_that_end_with_their_parent(tmp_path: Path) -> None:
    first = started(building(tmp_path / "out", 400, "endless"))
    until(lambda: len(workers()) == 2, first)
    second = started(building(tmp_path / "out", 400, "invented"))
    _, line = printed(second)
    assert second.returncode == 2
    assert f"is being written by process {first.pid} on" in line
    assert len(line.splitlines()) == 1
    first.kill()
    printed(first)
    until(lambda: not any(alive(worker) for worker in workers()))
    again = started(building(tmp_path / "out", 400, "endless"))
    until(lambda: len(workers()) == 4, again)  # the lock went with its owner
    again.kill()
    printed(again)


def test_a_script_is_not_run_again_by_its_workers(tmp_path: Path) -> None:
    """It has no `if __name__ == "__main__"`, and its rows are made by a function of its own."""
    script = tmp_path / "script.py"
    script.write_text(
        "from tests.dataset.sweeps import *\nfrom dataset.build import build\nprint('once')\n"
        "def own(points):\n    return invented(points)\n"
        f"build(design(40), {str(tmp_path / 'out')!r}, jobs=2, title='', simulate=own)\n"
    )
    environment = {**os.environ, "PYTHONPATH": f"{ROOT}{os.pathsep}{os.environ.get('PYTHONPATH', '')}"}
    done = subprocess.run(
        [sys.executable, str(script)], env=environment, text=True, capture_output=True, timeout=LIMIT
    )
    assert (done.returncode, done.stdout, done.stderr) == (0, "once\n", "")
    assert len(read(tmp_path / "out")) == 40


def test_a_worker_killed_at_each_step_of_its_write(tmp_path: Path) -> None:
    build(design(60), tmp_path / "out", jobs=2, title="", simulate=sweeps.dying_in_the_write)
    build(design(60), tmp_path / "calm", jobs=1, title="", simulate=invented)
    assert read(tmp_path / "out").equals(read(tmp_path / "calm"))
    assert len(workers()) == 3 * 8
    assert [path.name for path in (tmp_path / "out").glob(".*")] == [".lock"]


def test_a_build_that_is_killed_again_and_again_loses_the_chunks_under_way(tmp_path: Path) -> None:
    """And its files stay as they are."""
    out, kept = tmp_path / "out", dict[Path, int]()
    for chunks in (1, 4):
        process = started(building(out, 400, "slow"))
        until(lambda count=chunks: len(list(out.glob("rows/rows-*"))) >= count, process)  # type: ignore[misc]
        process.kill()
        printed(process)
        assert {path: path.stat().st_mtime_ns for path in kept} == kept
        kept |= {path: path.stat().st_mtime_ns for path in out.glob("rows/rows-*")}
    finished = started(building(out, 400, "slow"))
    assert printed(finished) == ("", "")
    assert {path: path.stat().st_mtime_ns for path in kept} == kept
    build(design(400), tmp_path / "calm", jobs=1, title="", simulate=invented)
    assert read(out).equals(read(tmp_path / "calm"))


def refused(folder: Path, rows: int, *, limit: int | None = None) -> str:
    process = started(building(folder, rows, "invented"), limit=limit)
    _, line = printed(process)
    assert process.returncode == 2, line
    assert len(line.splitlines()) == 1
    assert line.startswith("error: cannot ")
    return line


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    """Mount a disk of 2 MB."""
    disk = tmp_path / "disk"
    disk.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=2m", "tmpfs", str(disk)]
    if (
        os.getuid() != 0
        or not shutil.which("mount")
        or subprocess.run(mount, capture_output=True, timeout=LIMIT).returncode
    ):
        pytest.skip("this user may not mount a small disk")
    yield disk
    subprocess.run(["umount", "-l", str(disk)], check=True, timeout=LIMIT)


def test_a_disk_that_is_full_or_becomes_read_only(small_disk: Path, tmp_path: Path) -> None:
    build(design(200), small_disk / "out", jobs=1, title="", simulate=invented)
    before = read(small_disk / "out")
    assert "No space left on device" in refused(small_disk / "out", 8000)
    assert read(small_disk / "out").equals(before)
    subprocess.run(["mount", "-o", "remount,ro", str(small_disk)], check=True, timeout=LIMIT)
    assert "Read-only file system" in refused(small_disk / "out", 8000)
    assert read(small_disk / "out").equals(before)
    subprocess.run(["mount", "-o", "remount,rw,size=32m", str(small_disk)], check=True, timeout=LIMIT)
    same_rows(small_disk / "out", 8000, tmp_path / "calm")


def test_a_quota(tmp_path: Path) -> None:
    assert "File too large" in refused(tmp_path / "out", 2000, limit=20_000)
    same_rows(tmp_path / "out", 2000, tmp_path / "calm")


def test_a_folder_that_may_not_be_written(tmp_path: Path) -> None:
    if os.getuid() == 0:
        pytest.skip("root may write everywhere")
    (tmp_path / "out").mkdir(mode=0o555)
    assert "Permission denied" in refused(tmp_path / "out", 20)


def test_a_file_in_the_way(tmp_path: Path) -> None:
    (tmp_path / "out").write_text("x")
    assert "File exists" in refused(tmp_path / "out", 20)
    assert (tmp_path / "out").read_text() == "x"


def fork_server(user: int) -> int:
    """The process from which the workers of `user` are forked."""
    for status in Path("/proc").glob("[0-9]*/stat"):
        with suppress(OSError):
            parent = int(status.read_text().rsplit(")", 1)[1].split()[1])
            if parent == user and b"multiprocessing.forkserver" in status.with_name("cmdline").read_bytes():
                return int(status.parent.name)
    raise AssertionError("no fork server")


def test_a_fork_server_that_is_killed_is_started_anew(tmp_path: Path) -> None:
    """A traceback ended the build."""
    process = started(building(tmp_path / "out", 400, "slow"))
    until(lambda: len(workers()) > 2, process)
    os.kill(fork_server(process.pid), signal.SIGKILL)
    assert printed(process)[1] == ""
    assert process.returncode == 0
    build(design(400), tmp_path / "calm", jobs=1, title="", simulate=invented)
    assert read(tmp_path / "out").equals(read(tmp_path / "calm"))
