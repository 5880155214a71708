"""Band and dense storage solve the same systems."""

from __future__ import annotations

import pytest
import torch

from sim.reference.banded import BlockBanded


@pytest.mark.parametrize("n", [3, 8])
def test_banded_and_dense_solves_agree(n: int) -> None:
    generator = torch.Generator().manual_seed(n)

    def noise(*shape: int) -> torch.Tensor:
        return torch.randn(*shape, generator=generator, dtype=torch.float64)

    batch = (2, 3)
    blocks = {m: noise(n - abs(m), 3, 3, *batch) for m in range(-2, 3)}
    blocks[0] += 30 * torch.eye(3, dtype=torch.float64).reshape(3, 3, 1, 1)
    r, border, foot = noise(n, 3, *batch), noise(4, n, 3, *batch), noise(4, 6, *batch)
    corner = noise(4, 4, 3) + 20 * torch.eye(4, dtype=torch.float64).unsqueeze(-1)
    s = noise(4, 3)
    answers = []
    for dense in (True, False):
        matrix = BlockBanded(n, batch, r, dense=dense)
        for m, block in blocks.items():
            matrix.diagonal(m).add_(block)
        answers.append(matrix.solve_bordered(r, border, foot, corner, s))
    for a, b in zip(*answers, strict=True):
        assert torch.allclose(a, b, rtol=1e-10, atol=1e-12)
    # And both solve the system: check the rows of robot 1.
    x, u = answers[0]
    row = torch.zeros(n, 3, 2, dtype=torch.float64)
    for m, block in blocks.items():
        for k in range(n - abs(m)):
            i = k + max(0, -m)
            row[i] += (block[k, :, :, :, 1] * x[i + m, :, :, 1].unsqueeze(0)).sum(1)
    row += (border[..., 1] * u[:, 1].reshape(4, 1, 1, 1)).sum(0)
    assert torch.allclose(row, r[..., 1], atol=1e-10)
    body = (foot[..., 1] * x[:2, :, :, 1].reshape(6, 2)).sum((1, 2)) + corner[..., 1] @ u[:, 1]
    assert torch.allclose(body, s[:, 1], atol=1e-10)
