"""A bar for plans that take long."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from common.progress import progress_bar


@contextmanager
def plan_bar() -> Iterator[Callable[[float], object]]:
    """Show the stage of a plan, how far it is, and when it ends."""
    from planner.planning.request import Progress

    style = "{desc}: {percentage:3.0f}%|{bar:10}| {elapsed}, {remaining} left"
    with progress_bar("preparing", total=100, miniters=0, bar_format=style) as bar:

        def show(share: float) -> None:
            if isinstance(share, Progress):
                bar.set_description_str(share.stage, refresh=False)
                bar.update(100 * min(share.done, 1.0) - bar.n)

        yield show
