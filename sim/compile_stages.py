"""Compile the loops of a package stage by stage, and show how much is left.

The number of loops is that of the compiled functions in the modules that are loaded; those that are ready have an
index file in the folder of machine code. A terminal shows a bar. Without a terminal each stage prints a line.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from tqdm import tqdm

from sim import compiling

Stage = tuple[str, Callable[[], object]]  # what it is, and a call that needs its loops
_FIRST_USE = "compiling for first use |{bar}| {n_fmt} of at most {total_fmt} loops, {elapsed} so far"
_BAR = "{desc} |{bar}| {n_fmt} of {total_fmt} loops, {elapsed} so far, {remaining} left"


def run_stages(package: str, stages: Sequence[Stage], folder: Path) -> float:
    """Call every stage once, with progress on stderr. Loops that are compiled already are only loaded.

    Args:
        package: its name, as in the names of its modules.
        stages: all that the package compiles.
        folder: where the machine code is kept.

    Returns:
        The time that it took, in seconds.
    """
    began = time.perf_counter()
    total = count_loops(package)
    if sys.stderr.isatty():
        with (
            tqdm(total=total, bar_format=_BAR, leave=False, mininterval=0) as bar,
            _shown(lambda: _Count(bar, folder)),
        ):
            for i, (name, call) in enumerate(stages):
                bar.set_description_str(f"compiling {i + 1}/{len(stages)}: {name}")
                call()
                bar.update(count_ready(folder) - bar.n)
    else:
        with _shown(lambda: _Count(None, folder)):
            for i, (name, call) in enumerate(stages):
                ready = f"{count_ready(folder)} of {total} loops are ready"
                print(f"compiling {i + 1}/{len(stages)}: {name} ({ready}) …", file=sys.stderr, flush=True)
                call()
    return time.perf_counter() - began


def count_loops(package: str) -> int:
    """Count the compiled functions of a package that are loaded."""
    modules = [module for name, module in sys.modules.copy().items() if name.partition(".")[0] == package]
    return sum(
        isinstance(value, compiling.Loop) and value.py_func.__module__ == module.__name__
        for module in modules
        for value in vars(module).values()
    )


def count_ready(folder: Path) -> int:
    """Count the loops with machine code in a folder."""
    return len(list(folder.glob("*.nbi")))


@contextmanager
def saying_first_use(package: str, folder: Path) -> Iterator[None]:
    """Say that loops are being compiled, and of how many, while a call compiles those that it needs.

    Args:
        package: its name, as in the names of its modules.
        folder: where the machine code is kept.
    """
    if compiling.all_compiled(folder):
        yield
        return
    shown: list[_Count] = []

    def first_loop() -> _Count:
        if not shown:
            total = count_loops(package)
            if not sys.stderr.isatty():
                print(f"first use: compiling at most {total} loops, about a minute", file=sys.stderr, flush=True)
            bar = tqdm(
                total=total, bar_format=_FIRST_USE, initial=count_ready(folder), leave=False, mininterval=0,
                disable=not sys.stderr.isatty(),
            )  # fmt: skip
            shown.append(_Count(bar, folder))
        return shown[0]

    with _shown(first_loop):
        try:
            yield
        finally:
            for count in shown:
                count.update()
                count.bar.close()


class _Count:
    """Takes the place of the bar that the first use of a loop shows."""

    def __init__(self, bar: Any, folder: Path):
        self.bar, self._folder = bar, folder

    def update(self) -> None:
        """A loop has been compiled."""
        if self.bar is not None:
            self.bar.update(count_ready(self._folder) - self.bar.n)

    def close(self) -> None:
        """The outermost loop has been compiled."""
        self.update()


@contextmanager
def _shown(count: Callable[[], _Count]) -> Iterator[None]:
    """Show compiled loops in the bar of this count, or not at all, rather than in one of their own."""
    from sim import machine_code  # here, for it imports numba

    own = vars(machine_code)["tqdm"]
    vars(machine_code)["tqdm"] = lambda **_: count()
    try:
        yield
    finally:
        vars(machine_code)["tqdm"] = own
