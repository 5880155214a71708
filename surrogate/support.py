"""The domain of the table: the joint support of the rows that it learned, as a smooth measure.

    q(x) = φ(x)ᵀ M⁻¹ φ(x)/F,   M = mean of φ φᵀ over the rows,   φ: the F monomials up to degree 3

1/q is the Christoffel function of the rows. q is about 1 inside their support and grows with a high power
outside of it, in every direction, also where each input alone looks harmless. Its limit is its largest value
over almost all rows. Source: Lasserre and Pauwels, Adv. Comput. Math. 45, 1439 (2019).
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations_with_replacement

import torch
from torch import Tensor

DEGREE = 3
_KEPT = 0.998  # share of the rows that are inside
_SLACK = 1.5
_REGULAR = 1e-9


@dataclass(frozen=True)
class Support:
    """Where a table has learned."""

    shift: Tensor  # (F,)
    scale: Tensor  # (F,)
    factor: Tensor  # (P, P): the Cholesky factor of M
    limit: float

    @staticmethod
    def of(inputs: Tensor) -> Support:
        """The support of rows (M, F)."""
        low, high = inputs.min(0).values, inputs.max(0).values
        shift, scale = (low + high) / 2, torch.clamp((high - low) / 2, min=1e-6)
        features = _monomials((inputs - shift) / scale)
        moments = features.T @ features / len(inputs)
        moments = moments + _REGULAR * torch.eye(len(moments), dtype=moments.dtype)
        plain = Support(shift, scale, torch.linalg.cholesky(moments), 1.0)
        return Support(shift, scale, plain.factor, _SLACK * float(plain.remoteness(inputs).quantile(_KEPT)))

    def remoteness(self, inputs: Tensor) -> Tensor:
        """q over its limit, (M,): at most 1 inside."""
        features = _monomials((inputs - self.shift) / self.scale)
        solved = torch.linalg.solve_triangular(self.factor, features.T, upper=False)
        return solved.square().sum(0) / len(self.factor) / self.limit


def _monomials(x: Tensor) -> Tensor:
    """All monomials up to DEGREE of x (M, F), (M, P)."""
    columns = [torch.ones_like(x[:, 0])]
    index: dict[tuple[int, ...], int] = {(): 0}
    for degree in range(1, DEGREE + 1):
        for names in combinations_with_replacement(range(x.shape[1]), degree):
            index[names] = len(columns)
            columns.append(columns[index[names[:-1]]] * x[:, names[-1]])
    return torch.stack(columns, -1)
