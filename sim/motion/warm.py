"""Compile all kernels of the simulator, with progress, so that the first use need not wait for it.

Two processes compile, where there are two processors. The second is a copy of the first that has the balance of
forces already: one goes on with the loops of orbits, the other with those of motion in time.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from functools import cache
from multiprocessing import get_context
from pathlib import Path

import numpy as np

from sim import jit
from sim.model.presets import PRESETS
from sim.motion.response import responses
from sim.motion.sensitivity import sensitivities
from sim.motion.settling import settle
from sim.motion.steady import steady
from sim.solve.assembly import numbers
from sim.solve.orbit import residuals_on_orbits, straight_starts
from sim.solve.transient import Flip, follow_flips
from sim.threads import available_jobs

_ROBOT = PRESETS["paper-control"].groups()
Stage = tuple[str, Callable[[], object]]


def _balance() -> object:
    """Compute what forces on straight tails leave unbalanced."""
    rows = numbers(_ROBOT)
    return residuals_on_orbits(rows, *straight_starts(rows, 4, 3 * _ROBOT.N, _ROBOT.N))


def _flip() -> object:
    """Follow straight tails for a moment."""
    rows = numbers(_ROBOT)
    (x,), (u,) = straight_starts(rows, 4, 3 * _ROBOT.N, _ROBOT.N)
    return follow_flips([Flip(rows[0], x, u, np.zeros(3), 1e-3)], np.array([1e-3]), 1e-3)


_FIRST: tuple[Stage, ...] = (("balance of forces", _balance),)
_OF_ORBITS: tuple[Stage, ...] = (
    ("orbits", lambda: steady(_ROBOT, stability=False)),
    ("stability", lambda: steady(_ROBOT)),
    ("derivatives", lambda: sensitivities(_ROBOT, ("C_t",))),
)
_IN_TIME: tuple[Stage, ...] = (("flips", _flip), ("time steps", lambda: settle(_ROBOT)))


@cache
def _mark() -> Path:
    """Return the file that tells that all kernels are there for this kind of processor."""
    from llvmlite.binding import get_host_cpu_name

    return jit.CACHE / f"all-for-{get_host_cpu_name()}"


def all_compiled() -> bool:
    """Whether all kernels have been compiled for this processor."""
    return _mark().exists()


def _compile(stages: tuple[Stage, ...]) -> None:
    jit.beforehand = True
    for stage in stages:
        began = time.perf_counter()
        stage[1]()
        print(f"compiled {stage[0]}, {time.perf_counter() - began:.0f} s", file=sys.stderr, flush=True)


def compile_all() -> float:
    """Call every kernel once, with progress on stderr. Kernels that are compiled already are only loaded.

    Returns:
        The time that it took, in seconds.
    """
    began = time.perf_counter()
    _compile(_FIRST)
    if available_jobs() > 1 and not all_compiled():
        other = get_context("fork").Process(target=_compile, args=(_IN_TIME,))
        other.start()
        try:
            _compile(_OF_ORBITS)
            other.join()
        finally:
            other.kill()
        for _, call in _IN_TIME:  # what the other process has compiled is read here
            call()
    else:
        _compile(_OF_ORBITS + _IN_TIME)
    responses(_ROBOT)
    _mark().touch()
    return time.perf_counter() - began


def compile_once() -> None:
    """Compile all kernels unless that has been done. Call it before starting processes: each would compile."""
    if not all_compiled():
        compile_all()
