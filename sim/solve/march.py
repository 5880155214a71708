"""Time steps of one robot at constant motor speed (`sim.solve.steps`), which fills one lane of a group."""

from __future__ import annotations

import numpy as np

from sim.arrays import Floats
from sim.mechanics.geometry import straight
from sim.model.body import Body
from sim.solve.assembly import row
from sim.solve.grouping import NAMES, group_width, in_groups, wanted_lanes
from sim.solve.steps import PHASE as PHASE
from sim.solve.steps import SURGE as SURGE
from sim.solve.steps import SWAY as SWAY
from sim.solve.steps import YAW as YAW
from sim.solve.steps import State as State
from sim.solve.steps import X as X
from sim.solve.steps import Y as Y
from sim.solve.steps import march

TOLERANCE = 2e-4  # on the last correction; Newton converges quadratically


def new_state(tails: int, edges: int, offset: float) -> State:
    """Start from straight tails at rest."""
    x = straight(edges, tails, offset)
    return State(x, np.zeros_like(x), np.zeros(6), np.zeros(4))


def advance(
    body: Body, state: State, dt: float, count: int, tolerance: float, poses: Floats, shapes: Floats
) -> bool:
    """Make `count` steps of dt at constant motor speed; the first is a one-step method.

    Args:
        poses: (count, 6), filled with the pose after every step.
        shapes: (K, n, N, 3), filled with the shape after each of the last K steps.

    Returns:
        Whether every step converged. If not, the state is that of the step that failed.
    """
    if not 0 < dt < np.inf:
        return False
    numbers, *in_lanes = (in_groups(part[None])[0] for part in (row(body)[0], *state, poses, shapes))
    *state_in_lanes, all_poses, all_shapes = in_lanes
    wanted = wanted_lanes(np.ones(1, bool))
    solved = march(
        numbers, NAMES, State(*state_in_lanes), dt, count, tolerance, wanted, all_poses, all_shapes, group_width()
    )
    for part, found in zip((*state, poses, shapes), in_lanes, strict=True):
        part[:] = found[..., 0]
    return bool(solved)
