"""What a plan tells while it is made: its stage, and how far it is; and a bar that shows this."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from common.progress import progress_bar

DECLARING = "finding the nearest path that can be followed"
ORDERING = "comparing the ways between places"
REMEDY = "too tight: looking for a change that helps"
FOLLOWING = "following the path"
ERRORS = "computing the error of the path"
ProgressCallback = Callable[[float], object]  # called with a Progress


class Progress(float):
    """The share of the path that has been followed, with the stage of the plan and the share of the stage."""

    stage: str
    done: float


def tell(progress: ProgressCallback | None, stage: str, done: float) -> None:
    """Tell how far a stage is."""
    if progress is not None:
        share = Progress(done if stage == FOLLOWING else float(stage == ERRORS))
        share.stage, share.done = stage, done
        progress(share)


@contextmanager
def plan_bar() -> Iterator[Callable[[float], object]]:
    """Show the stage of a plan, how far it is, and when it ends."""
    style = "{desc}: {percentage:3.0f}%|{bar:10}| {elapsed}, {remaining} left"
    with progress_bar("preparing", total=100, miniters=0, bar_format=style) as bar:

        def show(share: float) -> None:
            if isinstance(share, Progress):
                bar.set_description_str(share.stage, refresh=False)
                bar.update(100 * min(share.done, 1.0) - bar.n)

        yield show
