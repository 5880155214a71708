"""Schedule the chunks of a sweep on a backend until all are stored, and survive worker failures.

A chunk whose worker dies is tried again. One that kills KILLS workers is skipped and named in the end, and so is
one that raises an error; the other chunks go on. If there is no worker for PATIENCE seconds, the storage refuses,
or a worker has other code, the sweep ends with one line; what is stored stays stored.
"""

from __future__ import annotations

import time
from collections import Counter, deque
from collections.abc import Iterator, Sequence
from typing import Any

from tqdm import tqdm

from dataset.storage.storage import StorageError
from dataset.workers.backend import GONE, KILLER, LOST, Backend
from dataset.workers.tasks import Join, Receipt, Refusal, Task
from sim.io.errors import InputError

KILLS = 3  # dead workers after which a chunk is skipped
PATIENCE = 60.0  # seconds without any worker
_POLL = 0.2  # seconds


class NoWorkersError(RuntimeError):
    """There were no workers for too long."""


class SkippedError(RuntimeError):
    """Some tasks could not be completed; the others have been."""

    def __init__(self, skipped: Sequence[tuple[Task | Join, str]]):
        tasks = [f"rows {task.start} to {task.stop - 1} ({reason})" for task, reason in skipped]
        super().__init__(f"skipped: {', '.join(tasks)}")


class Progress:
    """A progress line on stderr: rows, rows a second, time left, failures so far.

    Chunks are runs of a low-discrepancy sequence, so each has its share of slow robots. The time left is what a
    row has cost its worker so far, times the rows left, over the workers.
    """

    def __init__(self, title: str, rows: int, *, done: int, failed: int):
        self.total, self.rows = rows, done
        self._title, self._before, self._failed, self._cost = title, done, failed, 0.0
        self._began = self._shown = time.monotonic()
        self._bar: tqdm[Any] = tqdm(
            total=rows, initial=done, bar_format="{desc} |{bar:20}|", delay=1.0, disable=not title
        )

    @property
    def simulated(self) -> int:
        """Rows that this run has added."""
        return self.rows - self._before

    def add(self, receipt: Receipt) -> None:
        """Count a chunk that has been stored."""
        count = receipt.contents.stop - receipt.contents.start
        self.rows += count
        self._cost += receipt.seconds
        self._failed += receipt.contents.failed
        self._bar.n = self.rows

    def show(self, workers: int, *, now: bool = False) -> None:
        """Update the line, once a second."""
        if time.monotonic() - self._shown < 1 and not now:
            return
        self._shown = time.monotonic()
        new = self.simulated
        text = f"{self._title}: {self.rows}/{self.total} rows"
        if new:
            seconds = (self.total - self.rows) * self._cost / new / max(workers, 1)
            text += f", {new / (self._shown - self._began):.3g} rows/s, {duration(seconds)} left"
        self._bar.set_description_str(f"{text}, {self._failed} failed{'' if workers else ', waiting for workers'}")

    def close(self) -> None:
        """End the line."""
        self.show(1, now=True)
        self._bar.close()


def duration(seconds: float) -> str:
    """Write a time with a fitting unit."""
    if seconds < 90:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 5400 else f"{seconds / 3600:.1f} h"


def run(
    tasks: Sequence[Task | Join], backend: Backend, progress: Progress
) -> Iterator[tuple[Task | Join, Receipt]]:
    """Run all tasks; yield each with its receipt as soon as it is done.

    Raises:
        NoWorkersError: there are no workers for PATIENCE seconds.
        SkippedError: some tasks could not be completed; raised when all others are done.
        StorageError: the storage refuses.
        InputError: a worker has another version of the code.
    """
    skipped: list[tuple[Task | Join, str]] = []
    kills = Counter[int]()
    waiting, under_way = deque(range(len(tasks))), set[int]()
    last_seen = time.monotonic()
    while waiting or under_way:
        slots = backend.slots()
        if slots:
            last_seen = time.monotonic()
        elif time.monotonic() - last_seen > PATIENCE:
            raise NoWorkersError(f"no workers for {PATIENCE:.0f} s")
        while waiting and len(under_way) < slots:
            number = waiting.popleft()
            backend.submit(number, tasks[number])
            under_way.add(number)
        for number, outcome in backend.collect(_POLL):
            under_way.discard(number)
            if isinstance(outcome, Receipt):
                progress.add(outcome)
                yield tasks[number], outcome
            elif isinstance(outcome, Refusal):
                if outcome.kind != "error":
                    raise (StorageError if outcome.kind == "storage" else InputError)(outcome.message)
                skipped.append((tasks[number], outcome.message))
            else:
                kills[number] += {LOST: 1, KILLER: KILLS, GONE: 0}[outcome]
                if kills[number] < KILLS:
                    waiting.appendleft(number)
                else:
                    skipped.append((tasks[number], f"its worker died {KILLS} times"))
        progress.show(slots)
    if skipped:
        raise SkippedError(skipped)
