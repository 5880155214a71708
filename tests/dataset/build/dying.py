"""Run as a process: a build that is killed before each of its operations on the disk, one after the other.

For every operation: a copy of a finished data set of FEWER rows is extended to MORE, the process is killed there,
and the build is run again. Prints how many operations there were. Rows are made in the process itself.

Usage: python -m tests.dataset.build.dying FOLDER
"""

from __future__ import annotations

import os
import shutil
import signal
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import dataset.build.build
import dataset.build.sweep_folder
import dataset.storage.shards
from dataset.rows.version import rows_version
from dataset.storage.data_set import read
from sim.io.errors import InputError
from tests.dataset.sweeps import InThisProcess, design, invented

FEWER, MORE = 100, 300
_STEPS = ("replace", "fsync", "unlink", "rmdir", "open")


def build(folder: Path, rows: int) -> None:
    dataset.build.build.build(design(rows), folder, title="", simulate=invented)


def in_a_child(work: Callable[[], None]) -> int:
    """Run the work in a child; return the signal that ended it, 0 where it came to its end."""
    child = os.fork()
    if child == 0:
        try:
            work()
        except BaseException as error:
            print(f"{type(error).__name__}: {error}", flush=True)
            os._exit(1)
        os._exit(0)
    status = os.waitpid(child, 0)[1]
    assert not os.WIFEXITED(status) or os.WEXITSTATUS(status) == 0
    return os.WTERMSIG(status)


def dying(folder: Path, step: int) -> None:
    """Extend, and kill this process before its operation number `step`."""
    remaining = step

    def wrapped(operation: Any) -> Any:
        def run(*words: Any, **options: Any) -> Any:
            nonlocal remaining
            if remaining == 0:
                os.kill(os.getpid(), signal.SIGKILL)
            remaining -= 1
            return operation(*words, **options)

        return run

    for name in _STEPS:
        setattr(os, name, wrapped(getattr(os, name)))
    build(folder, MORE)


def files(folder: Path) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


def main(place: Path) -> None:
    dataset.build.build.open_backend = lambda *_, **__: InThisProcess()  # type: ignore[assignment]
    dataset.build.sweep_folder.SEGMENT = dataset.storage.shards.SEGMENT = 128
    dataset.storage.shards.ROW_GROUP = 32
    invented(design(2).points())  # loads what all children need
    rows_version()
    base, calm, folder = place / "base", place / "calm", place / "folder"
    assert in_a_child(lambda: build(base, FEWER)) == 0
    shutil.copytree(base, calm)
    assert in_a_child(lambda: build(calm, MORE)) == 0
    old, new, wanted = read(base), read(calm), files(calm)
    wanted.pop("card.md")
    assert sum(name.startswith("rows/") for name in wanted) == 3
    step = refused = 0
    while True:
        shutil.copytree(base, folder)
        killed = in_a_child(lambda at=step: dying(folder, at))  # type: ignore[misc]
        if not killed:
            break
        assert killed == signal.SIGKILL
        try:
            stored = read(folder)
            assert stored.equals(old) or stored.equals(new), step
        except InputError:
            refused += 1
        assert in_a_child(lambda: build(folder, MORE)) == 0
        assert read(folder).equals(new), step
        stored_files = files(folder)
        assert calm.name not in stored_files.pop("card.md").decode()
        assert stored_files == wanted, (step, sorted(stored_files))
        shutil.rmtree(folder)
        step += 1
    print(f"{step} operations, {refused} clear refusals")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
