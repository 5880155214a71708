"""Compile all loops of the look-up table, so that each process reads the same machine code from disk."""

from __future__ import annotations

import sys
import time
from functools import cache
from pathlib import Path

from sim.compiling import all_compiled, compile_apart, folder_of_package, mark_all_compiled

FOLDER = folder_of_package(Path(__file__).parent)


def compile_all() -> float:
    """Call every loop once. Loops that are compiled already are only loaded.

    Returns:
        The time that it took, in seconds.
    """
    from surrogate.table.model_file import load
    from surrogate.training.simulated import drawn

    began = time.perf_counter()
    load().query(drawn(16, 0, wide=False), flag=True)
    mark_all_compiled(FOLDER)
    return time.perf_counter() - began


@cache
def compile_once() -> None:
    """Compile all loops in another process, unless that has been done."""
    if not all_compiled(FOLDER):
        print("first use: compiling the look-up table's loops", file=sys.stderr, flush=True)
        compile_apart(__name__)
