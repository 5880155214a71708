"""Bordered block-banded linear systems, thousands at once.

Newton's matrix for one robot is

    [ A_1          B_1 ] [δx_1]   [r_1]
    [      …        …  ] [  … ] = [ … ]
    [          A_N B_N ] [δx_N]   [r_N]
    [ C_1  …   C_N  D  ] [ δu ]   [ s ]

A_j is block pentadiagonal in 3×3 blocks, since a rod couples a node to two neighbours on either side. B_j has four
columns, since the body's velocities move every node. C_j is zero except at the two nodes next to the clamp. A_j is
eliminated from the tip to the root, so that the Schur complement D − Σ C_j A_j⁻¹ B_j needs the first
six unknowns only.

There is no pivoting: A is minus (drag plus stiffness), whose symmetric part is definite. For a few tails a dense
LU is faster than many small vector operations. Then the same entries are written into a dense array; a test shows
that both give the same result.
"""

from __future__ import annotations

import torch
from torch import Tensor

HALF_BANDWIDTH = 8  # two neighbours of three components, counted from the far corner of a block
_ROW = 2 * HALF_BANDWIDTH  # a band is stored as a dense matrix whose rows overlap: row stride 16
_DENSE_BELOW = 12  # tails: for fewer, LAPACK on dense matrices was faster on the machines tried


class BlockBanded:
    """A batch of square matrices of n × n blocks of 3×3, block bandwidth 2, filled by block diagonals."""

    def __init__(self, n: int, batch: tuple[int, int], like: Tensor, *, dense: bool | None = None):
        """Allocate n nodes; batch = (N, B) tails and robots; `dense` overrides the choice of storage."""
        self.n, self.batch, self.count = n, batch, batch[0] * batch[1]
        self.dense = self.count < _DENSE_BELOW if dense is None else dense
        size = 3 * n
        self._row = size if self.dense else _ROW
        self._offset = 0 if self.dense else HALF_BANDWIDTH
        length = size * size if self.dense else size * (_ROW + 1)
        self._entries = torch.zeros(length, *batch, dtype=like.dtype, device=like.device)

    def diagonal(self, offset: int) -> Tensor:
        """View of the blocks (k, k + offset): (n − |offset|, 3, 3, N, B), to be added to."""
        first = max(0, -offset)
        start = self._offset + 3 * first * self._row + 3 * (first + offset)
        return self._entries.as_strided(
            (self.n - abs(offset), 3, 3, *self.batch),
            (3 * (self._row + 1) * self.count, self._row * self.count, self.count, self.batch[1], 1),
            start * self.count,
        )

    def solve_bordered(
        self, r: Tensor, border: Tensor, foot: Tensor, corner: Tensor, s: Tensor
    ) -> tuple[Tensor, Tensor]:
        """Solve the bordered system; the matrix is destroyed.

        Args:
            r: right-hand sides of the tails, (n, 3, N, B).
            border: B, (4, n, 3, N, B).
            foot: C on the first two nodes, (4, 6, N, B).
            corner: D, (4, 4, B).
            s: right-hand side of the body, (4, B).

        Returns:
            δx (n, 3, N, B) and δu (4, B).
        """
        size = 3 * self.n
        columns = torch.cat([r.reshape(1, size, *self.batch), border.reshape(4, size, *self.batch)])
        columns = columns.transpose(0, 1).reshape(size, 5, self.count)
        if self.dense:
            matrix = self._entries.reshape(size, size, self.count).permute(2, 0, 1)
            solution = torch.linalg.solve_ex(matrix, columns.permute(2, 0, 1))[0].permute(1, 2, 0)
            head = solution[:6]
        else:
            entries = self._entries.reshape(size, _ROW + 1, self.count)
            _eliminate_upwards(entries, columns)
            head = _substitute(entries, columns[:6].clone())
        first = head.reshape(6, 5, *self.batch)
        crossed = (foot.unsqueeze(2) * first.unsqueeze(0)).sum((1, 3))  # (4, 5, B): C A⁻¹ [r B]
        schur = (corner - crossed[:, 1:]).permute(2, 0, 1)
        body = torch.linalg.solve_ex(schur, (s - crossed[:, 0]).T.unsqueeze(-1))[0].squeeze(-1).T
        spread = body.reshape(4, 1, self.batch[1]).expand(4, *self.batch).reshape(1, 4, self.count)
        if self.dense:
            tails = solution[:, 0] - (solution[:, 1:] * spread).sum(1)
        else:
            folded = columns[:, 0] - (columns[:, 1:] * spread).sum(1)
            tails = _substitute(entries, folded.unsqueeze(1)).squeeze(1)
        return tails.reshape(self.n, 3, *self.batch), body


def _eliminate_upwards(entries: Tensor, columns: Tensor) -> None:
    """Reduce band matrices to lower triangular form, from the last row to the first."""
    size, width, count = entries.shape
    row_stride = (width - 1) * count
    for i in range(size - 1, 0, -1):
        reach = min(HALF_BANDWIDTH, i)
        top = i - reach
        corner = (top * (width - 1) + top + HALF_BANDWIDTH) * count
        window = entries.as_strided((reach, reach, count), (row_stride, count, 1), corner)
        above = entries.as_strided((reach, count), (row_stride, 1), corner + reach * count)
        row = entries[i, HALF_BANDWIDTH - reach : HALF_BANDWIDTH]
        factor = above / entries[i, HALF_BANDWIDTH]
        window.addcmul_(factor.unsqueeze(1), row.unsqueeze(0), value=-1)
        columns[top:i].addcmul_(factor.unsqueeze(1), columns[i].unsqueeze(0), value=-1)


def _substitute(entries: Tensor, columns: Tensor) -> Tensor:
    """Solve the lower triangular systems left by `_eliminate_upwards`, in place, root to tip."""
    for i in range(columns.shape[0]):
        reach = min(HALF_BANDWIDTH, i)
        if reach:
            row = entries[i, HALF_BANDWIDTH - reach : HALF_BANDWIDTH]
            columns[i] -= (row.unsqueeze(1) * columns[i - reach : i]).sum(0)
        columns[i] /= entries[i, HALF_BANDWIDTH]
    return columns
