"""Where the compiled loops of this package are kept, and their compilation before the first query."""

from __future__ import annotations

import sys
from functools import cache
from pathlib import Path

from sim.compiling import all_compiled, compile_apart, folder_of_package

FOLDER = folder_of_package(Path(__file__).parent)
COMPILER = "surrogate.compile_loops"  # by name: this module needs a whole table, which needs the loops


@cache
def compile_once() -> None:
    """Compile all loops in another process, unless that has been done."""
    if not all_compiled(FOLDER):
        print("first use: compiling the look-up table's loops", file=sys.stderr, flush=True)
        compile_apart(COMPILER)
