"""The look-up table and the simulator as functions of torch's tensors, for gradients in other programs.

The values are those of `NeuralTable.query` and of `sim.motion.sensitivity`. Their derivatives are found with them,
and torch multiplies gradients with these.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor
from torch.autograd.function import once_differentiable

from common.arrays import Floats
from common.errors import InputError
from common.keywords import checks_keywords
from sim.motion.batches import sensitivity_columns
from surrogate.interface import LookupTable
from surrogate.table_file import trained_table

Inputs = Mapping[str, Tensor | Floats | float]
Answer = tuple[Mapping[str, Floats], Mapping[str, Mapping[str, Floats]]]  # values, and derivatives by input


class _Linearised(torch.autograd.Function):
    """Values (M, O) at inputs (M, P) with a known Jacobian (M, O, P)."""

    @staticmethod
    def forward(ctx: Any, inputs: Tensor, values: Tensor, jacobian: Tensor) -> Tensor:
        ctx.save_for_backward(jacobian)
        return values.clone()

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, gradient: Tensor) -> tuple[Tensor, None, None]:
        (jacobian,) = ctx.saved_tensors
        parts = torch.where(gradient[..., None] == 0, 0.0, gradient[..., None] * jacobian)  # a gap may be infinite
        return parts.sum(1), None, None


@checks_keywords
def torch_query(
    columns: Inputs, *, lookup: LookupTable | str | Path | None = None, flag: bool = False
) -> dict[str, Tensor]:
    """Ask a trained look-up table, so that torch can differentiate the answer once.

    Args:
        columns: robots by dimensionless input, (M,) each or one number for all; with `dwell_bar` also the response
            to a flip. Gradients flow to the tensors that require them.
        lookup: the table, or its file; default: the one that comes with the package.
        flag: answer for robots outside the domain as well.

    Returns:
        Outputs by name, (M,) each, in double precision; the error of their derivatives is about 1e-7 of them.

    Raises:
        InputError: a robot cannot be, or is outside the domain of the table, or N requires a gradient.

    Example:
        >>> import softflagella as sf, torch
        >>> C_yr = torch.tensor(2.0, requires_grad=True)
        >>> robot = sf.load_robot("paper-control").group_values()
        >>> sf.torch_query({**robot, "C_yr": C_yr})["omega_yr_bar"].sum().backward()
        >>> round(C_yr.grad.item(), 3)
        0.025
    """
    table = trained_table(lookup)

    def ask(robots: dict[str, Floats], names: Sequence[str]) -> Answer:
        values = table.query(robots, flag=flag)
        values.pop("outside", None)
        return values, table.derivatives(robots, names, flag=True) if names else {}

    return _answered(columns, ask)


@checks_keywords
def torch_steady(columns: Inputs, *, jobs: int | None = None) -> dict[str, Tensor]:
    """Simulate the steady motion, so that torch can differentiate it once.

    Args:
        columns: as for `torch_query`, without a dwell.
        jobs: threads; default all processors.

    Returns:
        The outputs of `sensitivities` by name, (M,) each; NaN where there is no direct solution.

    Raises:
        InputError: a robot cannot be, or N requires a gradient.

    Example:
        >>> import softflagella as sf, torch
        >>> C_yr = torch.tensor(2.0, requires_grad=True)
        >>> robot = sf.load_robot("paper-control").group_values()
        >>> sf.torch_steady({**robot, "C_yr": C_yr})["omega_yr_bar"].sum().backward()
        >>> round(C_yr.grad.item(), 3)
        0.025
    """

    def ask(robots: dict[str, Floats], names: Sequence[str]) -> Answer:
        found = sensitivity_columns(robots, names or ["C_t"], jobs=jobs, title="")
        slopes = {
            output: dict(zip(found.parameters, part.T, strict=True)) for output, part in found.derivatives.items()
        }
        return {name: found.values[name] for name in slopes}, slopes

    return _answered(columns, ask)


def _answered(columns: Inputs, ask: Callable[[dict[str, Floats], Sequence[str]], Answer]) -> dict[str, Tensor]:
    """Ask for values and derivatives, and join them to the graph of the tensors that require gradients."""
    given = {name: torch.as_tensor(value, dtype=torch.float64) for name, value in columns.items()}
    try:
        count = max(value.numel() for value in given.values())
        wide = {name: value.expand(count) for name, value in given.items()}
    except RuntimeError:
        raise InputError("the columns differ in length; give (M,) tensors, or one number for all robots") from None
    names = [name for name, value in wide.items() if value.requires_grad]
    if "N" in names:
        raise InputError("N requires a gradient, but a number of tails has none; give it without")
    values, slopes = ask({name: value.detach().cpu().numpy() for name, value in wide.items()}, names)
    whole = torch.from_numpy(np.stack(list(values.values()), -1))
    if names:
        jacobian = np.stack([np.stack([slopes[output][name] for name in names], -1) for output in values], 1)
        inputs = torch.stack([wide[name] for name in names], -1)
        whole = _Linearised.apply(inputs, whole, torch.from_numpy(jacobian))  # type: ignore[no-untyped-call]
    return dict(zip(values, whole.unbind(-1), strict=True))
