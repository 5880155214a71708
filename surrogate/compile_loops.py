"""Compile all loops of the look-up table, so that each process reads the same machine code from disk."""

from __future__ import annotations

from sim.compile_stages import run_stages
from sim.compiling import mark_all_compiled
from surrogate.loops import FOLDER
from surrogate.networks.blocks import evaluate_rows
from surrogate.table.batch_query import query_blocks
from surrogate.table.compiled_query import query_rows
from surrogate.table.support import novelty_rows
from surrogate.wrench.balance import inverse_rows
from surrogate.wrench.motions import solve_rows

_KEPT = {
    "networks": evaluate_rows,
    "domain": novelty_rows,
    "inverses": inverse_rows,
    "motions": solve_rows,
    "queries": query_rows,
    "batches": query_blocks,
}


def compile_all() -> float:
    """Load every loop; compile those that have not been compiled.

    Returns:
        The time that it took, in seconds.
    """
    stages = tuple((name, lambda function=function: function.call) for name, function in _KEPT.items())
    seconds = run_stages("surrogate", stages, FOLDER)
    mark_all_compiled(FOLDER)
    return seconds
