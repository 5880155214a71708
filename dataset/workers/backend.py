"""The contract of a backend: where the tasks of a sweep run.

A backend is a file with one class that has the four methods of `Backend`. It loses no task silently: what it was
given comes back from `collect` as a receipt, a refusal, or one of the constants below.
"""

from __future__ import annotations

from typing import Literal, Protocol

from dataset.workers.tasks import Join, Outcome, Task

Lost = Literal["lost", "killer", "gone"]
LOST: Lost = "lost"  # its worker died; counted
KILLER: Lost = "killer"  # the backend has counted already: it will not try again
GONE: Lost = "gone"  # through no fault of the task: submitted again


class Backend(Protocol):
    """Workers that run tasks."""

    def slots(self) -> int:
        """Return how many tasks can run at once; 0 while there are no workers."""

    def submit(self, number: int, task: Task | Join) -> None:
        """Start a task under a number; at most `slots` are under way."""

    def collect(self, seconds: float) -> list[tuple[int, Outcome | Lost]]:
        """Return the tasks that have ended, after at most about so many seconds."""

    def stop(self) -> None:
        """Abort the tasks under way and release the workers, at once."""
