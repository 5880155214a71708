"""Compile all kernels of the simulator, with progress, so that the first use need not wait for it."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from functools import cache
from pathlib import Path

from sim.jit import CACHE
from sim.model.presets import PRESETS
from sim.motion.response import responses
from sim.motion.sensitivity import sensitivities
from sim.motion.settling import settle
from sim.motion.steady import steady

_ROBOT = PRESETS["paper-control"]
_STAGES: tuple[tuple[str, Callable[[], object]], ...] = (
    ("orbits", lambda: steady(_ROBOT.groups(), stability=False)),
    ("stability", lambda: steady(_ROBOT.groups())),
    ("derivatives", lambda: sensitivities(_ROBOT.groups(), ("C_t",))),
    ("flips", lambda: responses(_ROBOT.groups())),
    ("time steps", lambda: settle(_ROBOT.groups())),
)


@cache
def _mark() -> Path:
    """Return the file that tells that all kernels are there for this kind of processor."""
    from llvmlite.binding import get_host_cpu_name

    return CACHE / f"all-for-{get_host_cpu_name()}"


def all_compiled() -> bool:
    """Whether all kernels have been compiled for this processor."""
    return _mark().exists()


def compile_all() -> float:
    """Call every kernel once, with progress on stderr. Kernels that are compiled already are only loaded.

    Returns:
        The time that it took, in seconds.
    """
    began = time.perf_counter()
    for i, (name, call) in enumerate(_STAGES):
        print(f"{i + 1}/{len(_STAGES)} {name} …", end=" ", file=sys.stderr, flush=True)
        call()
        print(f"{time.perf_counter() - began:.0f} s", file=sys.stderr, flush=True)
    _mark().touch()
    return time.perf_counter() - began


def compile_once() -> None:
    """Compile all kernels unless that has been done. Call it before starting processes: each would compile."""
    if not all_compiled():
        compile_all()
