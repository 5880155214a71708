"""Compile all loops of the simulator, with progress, so that the first use need not wait for it."""

from __future__ import annotations

import sys

from sim.compile_stages import Stage, run_stages
from sim.compiling import CACHE, all_compiled, compile_apart, mark_all_compiled
from sim.model.presets import PRESETS
from sim.motion.response import responses
from sim.motion.sensitivity import sensitivities
from sim.motion.settling import settle
from sim.motion.steady import steady

_ROBOT = PRESETS["paper-control"]


_STAGES: tuple[Stage, ...] = (
    ("steady motion", lambda: steady(_ROBOT.groups())),
    ("time steps", lambda: settle(_ROBOT.groups())),
    ("response to flips", lambda: responses(_ROBOT.groups())),
    ("derivatives", lambda: sensitivities(_ROBOT.groups(), ("C_t",))),
)


def compile_all() -> float:
    """Call every loop once, with progress on stderr. Loops that are compiled already are only loaded.

    Returns:
        The time that it took, in seconds.
    """
    seconds = run_stages("sim", _STAGES, CACHE)
    mark_all_compiled()
    return seconds


def compile_once() -> bool:
    """Compile all loops in another process, unless that has been done; false if that failed.

    Call it before starting processes: each would compile.
    """
    if all_compiled():
        return True
    print("first use: compiling the simulator's loops, a few minutes", file=sys.stderr, flush=True)
    return compile_apart(__name__)
