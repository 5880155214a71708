"""A bar on a terminal, for plans that take long."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager


@contextmanager
def progress_bar() -> Iterator[Callable[[float], object]]:
    """Show a bar on a terminal, for plans that take long."""
    from tqdm import tqdm

    from planner.planning.request import Progress

    style = "{desc}: {percentage:3.0f}%|{bar}| {elapsed}"
    with tqdm(
        total=100, leave=False, delay=1.0, miniters=0, bar_format=style, disable=not sys.stderr.isatty()
    ) as bar:

        def show(share: float) -> None:
            if isinstance(share, Progress):
                bar.set_description_str(share.stage, refresh=False)
                bar.update(100 * min(share.done, 1.0) - bar.n)

        yield show
