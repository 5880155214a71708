"""Learn how far a look-up table's response to a flip is off, from robots that it did not learn.

The curves of a data set are simulated with time steps that leave errors as large as the table's. So for a table
that others plan with, new robots are simulated with a tenth of the tolerance (`with_response_errors`).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from surrogate.one_robot.tabulate import TOLERANCE
from surrogate.table.curve_errors import KINDS, CurveErrors
from surrogate.table.lookup import NeuralTable
from surrogate.table.outside import INSIDE
from surrogate.table.response_table import SHAPES, along_axes, flip_inputs
from surrogate.training.simulated import SimulatedRobots, draw_robots, simulate_robots

_FEWEST_FLIPS = 200  # robots, for the covariance of the errors of the response
_DRAWN = 4  # times as many as are wanted: some are outside the domain


def held_out_curve_errors(lookup: NeuralTable, flips: SimulatedRobots) -> CurveErrors | None:
    """Learn the errors of the response from robots that were not learned; None where they are too few.

    Args:
        lookup: the table.
        flips: held-out robots with curves.
    """
    motions = lookup.solve(flips.robots)
    known = (motions.outside == INSIDE) & (flips.motion["tail_gap"] >= 1)
    if known.sum() < _FEWEST_FLIPS:
        return None
    response = lookup.response(flips.robots, flag=True)
    _, speeds = flip_inputs(motions.robots, motions.motion, motions.inputs)
    errors = {
        kind: ((getattr(response, kind) - flips.curves[kind]) / along_axes(speeds, SHAPES[kind]))[known]
        for kind in KINDS
    }
    return CurveErrors.learned(
        lookup.width_features(motions)[known], errors, lookup.curves.bases, flips.motion["error"][known]
    )


def with_response_errors(
    lookup: NeuralTable, *, count: int = 420, seed: int = 202, title: str = ""
) -> NeuralTable:
    """Return a table with errors of its response learned from new robots; half a second of one core each.

    Args:
        lookup: a trained table.
        count: robots, with two tails or more.
        seed: of their draws; another one than those of the robots that the table has learned.
        title: of the progress bar; empty for none.
    """
    robots = draw_robots(_DRAWN * count, seed, wide=False)
    several = robots["N"] > 1
    robots = {name: values[several] for name, values in robots.items()}
    inside = np.flatnonzero(lookup.solve(robots).outside == INSIDE)[:count]
    chosen = {name: values[inside] for name, values in robots.items()}
    flips = simulate_robots(chosen, curves=True, tolerance=TOLERANCE, title=title)
    source = {"robots": len(flips), "seed": seed, "tolerance": TOLERANCE}
    return replace(
        lookup,
        curve_errors=held_out_curve_errors(lookup, flips),
        provenance={**lookup.provenance, "response_errors": source},
    )
