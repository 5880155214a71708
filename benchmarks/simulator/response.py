"""Processor time and error of the response to a flip, compared with one dwell by time steps.

Usage: python -m benchmarks response [ROBOTS]. Single-threaded. The reference for errors has 24 edges and 72 steps
a motor revolution.

Takes 2 minutes.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from benchmarks.timing import processor_time
from dataset.rows.design import load_design
from sim.inputs import check_columns
from sim.model.groups import Groups
from sim.model.response import BEFORE, DWELLS
from sim.motion.batches import one_thread, split
from sim.motion.resolution import Resolution
from sim.motion.response import responses
from sim.motion.steady import steady
from sim.motion.stepped_response import stepped_response
from sim.motion.switching import switch_response
from sim.motion.warm import compile_once
from sim.solve.assembly import bodies

_REFERENCE = Resolution(24, 72)
_FEW = np.arange(0, len(DWELLS), 4)
_CHECKED = 12  # robots whose curves are compared


def main(count: str = "128") -> None:
    robots = int(count)
    columns = check_columns(load_design().with_rows(robots).points())
    parts = [Groups.from_columns({n: c[rows] for n, c in columns.items()}) for rows in split(columns["N"], robots)]
    with one_thread():
        costs(parts, robots)
        errors(parts)


def costs(parts: list[Groups], robots: int) -> None:
    """Measure milliseconds of processor time a robot."""
    rng = np.random.default_rng(0)
    dwells = [np.exp(rng.uniform(np.log(0.3), np.log(4.0), len(bodies(part)))) for part in parts]
    ways: dict[str, Callable[[], object]] = {
        "steady motion": lambda: [steady(part, stability=False) for part in parts],
        "… and the whole curve, 25 dwells": lambda: [responses(part, history=False) for part in parts],
        "… and memory of the dwell before, and rest": lambda: [responses(part) for part in parts],
        "one dwell by time steps": lambda: [switch_response(p, T) for p, T in zip(parts, dwells, strict=True)],
    }
    compile_once()
    for work in ways.values():
        work()  # load the machine code
    print(f"\n{robots} robots of the sweep, processor time a robot")
    for name, work in ways.items():
        print(f"  {name:45s} {1e3 * processor_time(work) / robots:7.2f} ms")


def errors(parts: list[Groups]) -> None:
    """Compute the largest differences from fine time steps over the dwells, for some robots of each N."""
    differences: dict[str, list[float]] = {"lag": [], "memory": [], "rest": []}
    for part in parts:
        curves = responses(part)
        for i, body in enumerate(bodies(part)[: _CHECKED // len(parts)]):
            lag, memory, rest, _ = stepped_response(
                body, part.N, DWELLS[_FEW], BEFORE[[0, 3]], resolution=_REFERENCE
            )
            differences["lag"].append(float(np.abs(curves.lag[i, _FEW] - lag).max()))
            differences["memory"].append(float(np.abs(curves.memory[i][[0, 3]][:, _FEW] - memory).max()))
            differences["rest"].append(float(np.abs(curves.rest[i, _FEW] - rest).max()))
    print(f"Largest difference from fine time steps over the dwells, {len(differences['lag'])} robots [l, rad]")
    for name, values in differences.items():
        print(f"  {name:8s} median {np.median(values):.1e}, largest {np.max(values):.1e}")
