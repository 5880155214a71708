"""Derivatives of the table's steady motion in the inputs of a robot.

At a solution u of F(u; p) = 0, one more step of Newton's method, u(p) = u − F_u⁻¹ F(u; p) with F_u held, has the
exact derivative du/dp = −F_u⁻¹ F_p. So the outputs are differentiated through that step (forward mode).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import torch
from torch import Tensor

from sim.arrays import Floats
from sim.motion.steady_motion import STEADY_OUTPUTS
from surrogate.networks.ensemble import Ensemble
from surrogate.table.wrench_table import WrenchTable, network_index
from surrogate.wrench.heads import as_tensor, full_motion, heads_and_tails, unbalanced, value_and_slope


def slopes(
    table: WrenchTable, values: Mapping[str, Floats], motion: Tensor, parameters: Sequence[str]
) -> dict[str, dict[str, Floats]]:
    """Return ∂(output)/∂(parameter), each (M,), of robots that the table solved.

    Args:
        table: of the tails.
        values: checked columns of the robots, the parameters among them, each (M,).
        motion: their motion, (M, 5).
        parameters: names of columns.
    """
    derivatives = {name: {p: np.full(len(motion), np.nan) for p in parameters} for name in STEADY_OUTPUTS}
    columns = {name: as_tensor(array) for name, array in values.items()}
    kind = network_index(columns["N"])
    for k, network in enumerate(table.wrench):
        rows = torch.nonzero(kind == k)[:, 0]
        if len(rows) and network is not None:
            robots = {name: array[rows] for name, array in columns.items()}
            for parameter, changes in _changes(table, network, robots, motion[rows, :4], parameters).items():
                for name, change in zip(STEADY_OUTPUTS, changes, strict=True):
                    derivatives[name][parameter][rows.numpy()] = change.numpy()
    return derivatives


def _changes(
    table: WrenchTable, network: Ensemble, columns: dict[str, Tensor], u: Tensor, parameters: Sequence[str]
) -> dict[str, tuple[Tensor, ...]]:
    """Return derivatives of STEADY_OUTPUTS by parameter, of robots with one network and the solution u (M, 4)."""
    heads, tails = heads_and_tails(columns, keep=parameters)
    _, slope = value_and_slope(lambda v: unbalanced(heads, tails, v, network), u)
    inverse = torch.linalg.inv_ex(slope)[0]

    def outputs(moved: dict[str, Tensor]) -> tuple[Tensor, ...]:
        heads, tails = heads_and_tails(moved, keep=parameters)
        residual = unbalanced(heads, tails, u, network)
        motion = full_motion(heads, u - (inverse @ residual[..., None])[..., 0])
        return table.outputs(heads, motion, table.tail_gap(tails, motion))

    derivatives = {}
    for parameter in parameters:
        size = columns[parameter]

        def outputs_at(value: Tensor, name: str = parameter) -> tuple[Tensor, ...]:
            return outputs({**columns, name: value})

        derivatives[parameter] = torch.func.jvp(outputs_at, (size,), (torch.ones_like(size),))[1]
    return derivatives
