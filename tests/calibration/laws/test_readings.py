"""Exponents in words: powers of one quantity where the runs agree with that."""

from __future__ import annotations

import numpy as np
import pytest

from calibration.laws.inputs import logarithms
from calibration.laws.motion_readings import motion_patterns
from calibration.laws.readings import in_words, readings
from calibration.swimmer.measured_table import read_measurements
from calibration.swimmer.synthetic_table import make_table
from tests.calibration.toy_tables import TRUTH

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


SPEED = {"|v|": (0.85, -0.31, 0.60)}


def in_motion(exponents: tuple[float, ...], covariance: np.ndarray = NARROW) -> str:
    errors = 1.96 * np.sqrt(np.diag(covariance))
    intervals = [(value - error, value + error) for value, error in zip(exponents, errors, strict=True)]
    return in_words(["ω", "l", "N"], np.array(exponents), covariance, intervals, SPEED)


def test_a_power_of_the_speed_is_named_beside_the_inputs() -> None:
    words = in_motion((0.43, -0.15, 0.30))
    assert words.startswith(
        "in proportion to ω^0.43 (0.41 to 0.45) l^-0.15 (-0.19 to -0.11) N^0.30 (0.24 to 0.36)"
    )
    assert ", or as well to |v|^0.50 (0.48 to 0.53)" in words


def test_the_motion_is_not_named_where_a_quantity_of_the_inputs_is_nearer() -> None:
    assert "|v|" not in in_motion((0.105, 0.41, 0.02))
    assert "|v|" not in in_motion((0.43, 0.15, 0.30))
    assert "|v|" not in in_motion((0.001, 0.002, 0.003))
    assert "|v|" in in_motion((0.43, -0.15, 0.30), 400 * NARROW)
    assert "|v|" not in in_motion((0.43, 0.0, 0.0), 400 * NARROW)


@pytest.mark.usefixtures("toy_model")
@pytest.mark.parametrize("with_speed", [False, True])
def test_the_motion_follows_the_inputs_as_its_exponents_say(with_speed: bool) -> None:
    """The slopes of a plane, here by the normal equations, from the outputs of a table with little noise."""
    table = make_table(TRUTH, seed=1, noise=1e-4, session_noise=0.0, title="")
    if with_speed:
        noise = np.exp(np.random.default_rng(0).normal(scale=1e-4, size=len(table)))
        table["v_cm_s"] = table["omega_yr_rad_s"].abs() * table["R_yr_cm"] * noise
    runs = read_measurements(table)
    patterns = motion_patterns(logarithms(runs), runs.outputs, runs.y)
    assert set(patterns) == {"ω_h", "ω_t", "ω_yr", "|v|"}
    speed = np.log(np.abs(table["omega_yr_rad_s"]) * table["R_yr_cm"]).to_numpy()
    inputs = np.log(np.stack([table["omega_rpm"].abs(), table["l_cm"], table["N"]], 1))
    plane = np.column_stack([np.ones(len(inputs)), inputs])
    assert patterns["|v|"] == pytest.approx(np.linalg.solve(plane.T @ plane, plane.T @ speed)[1:], abs=1e-3)


def test_what_is_no_power_law_is_no_pattern() -> None:
    speeds = np.linspace(50.0, 150.0, 40)
    inputs = np.column_stack([np.log(speeds), np.zeros(40), np.zeros(40)])
    resonance = 1 / (1 + ((speeds - 100) / 20) ** 2)
    spins = np.column_stack([np.log(resonance), 0.7 * np.log(speeds)])
    patterns = motion_patterns(inputs, ("omega_h", "omega_t"), spins)
    assert set(patterns) == {"ω_t"}
    assert patterns["ω_t"] == pytest.approx((0.7, 0.0, 0.0))
