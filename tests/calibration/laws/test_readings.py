"""Exponents in words: powers of one quantity where the runs agree with that."""

from __future__ import annotations

import numpy as np
import pytest

from calibration.laws.readings import in_words, readings

NARROW = np.diag([0.01, 0.02, 0.03]) ** 2


def said(exponents: tuple[float, ...], covariance: np.ndarray = NARROW, inputs: str = "ωlN") -> str:
    errors = 1.96 * np.sqrt(np.diag(covariance))
    intervals = [(value - error, value + error) for value, error in zip(exponents, errors, strict=True)]
    return in_words(list(inputs), np.array(exponents), covariance, intervals)


def test_a_power_of_the_dimensionless_speed_is_recognised() -> None:
    words = said((0.105, 0.41, 0.02))
    assert words.startswith("in proportion to ω̄^0.10 (0.09 to 0.11)")
    assert words.endswith("independent of N within the intervals")


def test_the_power_is_that_of_generalised_least_squares() -> None:
    (reading,) = readings(["ω", "l"], np.array([0.11, 0.40]), NARROW[:2, :2])
    weights = np.array([1.0, 4.0]) / np.array([0.01, 0.02]) ** 2
    assert reading.power == pytest.approx((weights @ [0.11, 0.40]) / (weights @ [1.0, 4.0]))
    assert reading.error == pytest.approx((weights @ [1.0, 4.0]) ** -0.5)


def test_one_input_alone_is_recognised() -> None:
    assert said((0.5, 0.01, 0.02)) == (
        "in proportion to ω^0.50 (0.48 to 0.52), independent of l and N within the intervals"
    )


def test_a_pattern_of_no_quantity_is_stated_input_by_input() -> None:
    words = said((0.3, -0.6, 0.02))
    assert "ω^0.30 (0.28 to 0.32) l^-0.60 (-0.64 to -0.56)" in words
    assert words.endswith("independent of N within the intervals")


def test_wide_intervals_leave_several_quantities() -> None:
    wide = np.diag([0.4, 0.05, 0.03]) ** 2
    words = said((0.2, 0.4, 0.01), wide)
    assert "l^" in words
    assert "ω̄^" in words
    assert "or as well to" in words


def test_inputs_that_do_not_differ_are_not_mentioned() -> None:
    assert said((0.3,), NARROW[1:2, 1:2], "l") == "in proportion to l^0.30 (0.26 to 0.34)"
    assert said((), np.zeros((0, 0)), "") == ""


def test_no_dependence_is_said() -> None:
    assert said((0.001, 0.002, 0.003)) == "independent of ω, l and N within the intervals"
