"""The minimiser of the training: known minima, and what it does where there is no way down."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from scipy.optimize import minimize, rosen, rosen_der
from torch import Tensor

from surrogate.networks.bfgs import Minimiser


def rosenbrock(x: Tensor) -> tuple[float, Tensor]:
    return float(rosen(x.numpy())), torch.as_tensor(rosen_der(x.numpy()))


def test_it_reaches_the_minimum_of_a_narrow_valley_as_quickly_as_scipy() -> None:
    start = np.full(20, -1.2)
    found = Minimiser(rosenbrock, torch.as_tensor(start))
    steps = 0
    while found.value > 1e-16 and steps < 1000:
        assert found.step()
        steps += 1
    assert found.x.numpy() == pytest.approx(np.ones(20), abs=1e-7)
    assert steps <= 1.5 * minimize(rosen, start, jac=rosen_der, method="BFGS", options={"gtol": 1e-9}).nit


def test_the_matrix_fits_the_last_step_and_stays_symmetric_and_positive() -> None:
    """The secant equation: the matrix times the change of the gradient is the step."""
    found = Minimiser(rosenbrock, torch.linspace(-1.5, 1.5, 7, dtype=torch.float64))
    for _ in range(25):
        x, gradient = found.x, found.gradient
        assert found.step()
        matrix = found._matrix
        assert matrix is not None
        assert (matrix @ (found.gradient - gradient)).numpy() == pytest.approx((found.x - x).numpy(), rel=1e-6)
        assert matrix.numpy() == pytest.approx(matrix.T.numpy(), rel=1e-9)
        assert float(torch.linalg.eigvalsh(matrix)[0]) > 0


def test_it_stops_at_a_minimum_and_where_the_function_breaks_down() -> None:
    at_rest = Minimiser(lambda x: (float(x @ x), 2 * x), torch.zeros(3, dtype=torch.float64))
    assert not at_rest.step()
    broken = Minimiser(lambda x: (float("nan"), torch.full_like(x, torch.nan)), torch.ones(3, dtype=torch.float64))
    assert not broken.step()
    assert torch.equal(broken.x, torch.ones(3, dtype=torch.float64))


def test_every_point_is_aligned() -> None:
    """The last digits of matrix products depend on it, and so did those of a table in another process."""
    places = []

    def valley(x: Tensor) -> tuple[float, Tensor]:
        places.append(x.data_ptr() % 64)
        return rosenbrock(x)

    found = Minimiser(valley, torch.as_tensor(np.full(7, -1.2)).clone())
    for _ in range(20):
        found.step()
    assert set(places) == {0}
