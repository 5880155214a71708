"""Derivatives of the table's steady motion in the inputs of a robot.

At a solution u of F(u; p) = 0, one more step of Newton's method, u(p) = u − F_u⁻¹ F(u; p) with F_u held, has the
exact derivative du/dp = −F_u⁻¹ F_p. So the outputs are differentiated through that step (complex step).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from sim.arrays import Floats
from sim.linear.complex_step import change, moved
from sim.motion.steady_motion import STEADY_OUTPUTS
from surrogate.networks.ensemble import Ensemble
from surrogate.table.wrench_table import WrenchTable, network_index
from surrogate.wrench.balance import inverses_of
from surrogate.wrench.heads import Numbers, full_motion, heads_and_tails, slope_at, unbalanced
from surrogate.wrench.tails import network_inputs


def slopes(
    table: WrenchTable, values: Mapping[str, Floats], motion: Floats, parameters: Sequence[str]
) -> dict[str, dict[str, Floats]]:
    """Return ∂(output)/∂(parameter), each (M,), of robots that the table solved.

    Args:
        table: of the tails.
        values: checked columns of the robots, the parameters among them, each (M,).
        motion: their motion, (M, 5).
        parameters: names of columns.
    """
    derivatives = {name: {p: np.full(len(motion), np.nan) for p in parameters} for name in STEADY_OUTPUTS}
    kind = network_index(values["N"])
    for k, network in enumerate(table.wrench):
        rows = np.flatnonzero(kind == k)
        if len(rows) and network is not None:
            robots = {name: array[rows] for name, array in values.items()}
            for parameter, changes in _changes(table, network, robots, motion[rows, :4], parameters).items():
                for name, slope in zip(STEADY_OUTPUTS, changes, strict=True):
                    derivatives[name][parameter][rows] = slope
    return derivatives


def numbers_of(network: Ensemble) -> Numbers:
    """Return what a network of the wrench gives, from tails and motion."""
    return lambda tails, motion: network(network_inputs(tails, motion, network.shape["inputs"]))


def _changes(
    table: WrenchTable, network: Ensemble, columns: dict[str, Floats], u: Floats, parameters: Sequence[str]
) -> dict[str, tuple[Floats, ...]]:
    """Return derivatives of STEADY_OUTPUTS by parameter, of robots with one network and the solution u (M, 4)."""

    numbers = numbers_of(network)
    heads, tails = heads_and_tails(columns, keep=parameters)
    inverse = inverses_of(slope_at(lambda v: unbalanced(heads, tails, v, numbers), u))

    def outputs(robots: dict[str, Floats]) -> tuple[Floats, ...]:
        heads, tails = heads_and_tails(robots, keep=parameters)
        residual = unbalanced(heads, tails, u, numbers)
        motion = full_motion(heads, u - (inverse @ residual[..., None])[..., 0])
        return table.outputs(heads, motion, table.tail_gap(tails, motion))

    derivatives = {}
    for parameter in parameters:
        size = columns[parameter]
        derivatives[parameter] = tuple(
            change(value) for value in outputs({**columns, parameter: moved(size, np.ones(len(size)))})
        )
    return derivatives
