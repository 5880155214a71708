"""Compile all loops of the look-up table, so that each process reads the same machine code from disk."""

from __future__ import annotations

from sim.compile_stages import run_stages
from sim.compiling import mark_all_compiled
from surrogate.loops import FOLDER
from surrogate.table.model_file import load
from surrogate.training.simulated import draw_robots


def compile_all() -> float:
    """Call every loop once. Loops that are compiled already are only loaded.

    Returns:
        The time that it took, in seconds.
    """
    stages = (("look-up table", lambda: load().query(draw_robots(16, 0, wide=False), intervals=True, flag=True)),)
    seconds = run_stages("surrogate", stages, FOLDER)
    mark_all_compiled(FOLDER)
    return seconds
