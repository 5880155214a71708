"""Elementary functions of compiled loops against those of Python's `math`."""

from __future__ import annotations

import math

import numpy as np

from surrogate.networks.elementary import angle_of, arcsinh_of, exp_of, log_of


def test_elementary_functions_are_exact_to_a_few_last_digits() -> None:
    random = np.random.default_rng(3)
    x = random.normal(size=3000) * np.exp(random.uniform(-20, 20, 3000))
    y = random.normal(size=3000) * np.exp(random.uniform(-20, 20, 3000))
    for a, b in zip(x, y, strict=True):
        assert abs(log_of(abs(a)) - math.log(abs(a))) <= 5e-16 * max(1.0, abs(math.log(abs(a))))
        assert abs(arcsinh_of(a) - math.asinh(a)) <= 1e-15 * max(1.0, abs(math.asinh(a)))
        assert abs(angle_of(a, b) - math.atan2(a, b)) <= 1e-15
    for a in np.linspace(-100, 100, 2001):
        assert abs(exp_of(a) / math.exp(a) - 1) <= 1e-14


def test_bounds() -> None:
    assert angle_of(0.0, 0.0) == 0.0
    assert angle_of(0.0, -2.0) == math.pi
    assert exp_of(900.0) == exp_of(700.0) < np.inf
    assert log_of(1.0) == arcsinh_of(0.0) == 0.0
