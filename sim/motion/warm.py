"""Compile all loops of the simulator, with progress, so that the first use need not wait for it."""

from __future__ import annotations

import sys
from dataclasses import replace

import numpy as np

from sim.compile_stages import Stage, run_stages
from sim.compiling import CACHE, all_compiled, compile_apart, mark_all_compiled
from sim.model.groups import Groups
from sim.model.presets import PRESETS
from sim.model.schedule import Schedule
from sim.motion.replay import replay
from sim.motion.response import responses
from sim.motion.sensitivity import sensitivities
from sim.motion.settling import settle
from sim.motion.shapes import steady_shapes
from sim.motion.steady import steady
from sim.motion.tails_alike import TailsAlike
from sim.solve.assembly import bodies

_ROBOT = PRESETS["paper-control"]
_PAIR = Groups.from_columns({name: np.full(2, value) for name, value in _ROBOT.group_values().items()})
_TOUCHING = replace(PRESETS["paper-measured"], effects={"tail_contact": 1.0})
_CREEPING = replace(_ROBOT, effects={"contact_line": 1.0})
_ALONE_AND_TOGETHER = (_PAIR.select(np.arange(1)), _PAIR)


def _follow_a_branch() -> None:
    """Correct an orbit once, as on a curve of orbits."""
    body = bodies(_ROBOT.groups())[0]
    orbits = TailsAlike(lambda _: body, _ROBOT.tails)
    start = orbits.start(0.5)
    if start is not None:
        orbits.correction(start, np.eye(1, len(start), len(start) - 1)[0], 0.0)


_STAGES: tuple[Stage, ...] = (
    ("steady motion", lambda: [steady(robots) for robots in _ALONE_AND_TOGETHER]),
    ("time steps", lambda: settle(_ROBOT.groups())),
    ("response to flips", lambda: [responses(robots) for robots in (*_ALONE_AND_TOGETHER, _CREEPING.groups())]),
    ("replay", lambda: replay([Schedule(_ROBOT.group_values(), 1, np.array([0.1]), (0.0, 0.0, 0.0), 1.0)])),
    ("derivatives", lambda: [sensitivities(robots, ("C_t",)) for robots in _ALONE_AND_TOGETHER]),
    ("derivatives with flow", lambda: sensitivities(_ROBOT.groups(), ("C_t", "tail_interaction"))),
    ("contact between tails", lambda: steady(_TOUCHING.groups())),
    ("branches", _follow_a_branch),
    ("pictures", lambda: steady_shapes(_ROBOT, 4)),
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
