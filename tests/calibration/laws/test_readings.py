"""Exponents in words: powers of one quantity where the runs agree with that."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from calibration.laws.readings import in_words, logarithms, motion_patterns, readings
from calibration.swimmer.measured_table import read_measurements
from sim.arrays import Floats
from tests.calibration.toy_tables import toy_table

NARROW = np.diag([0.01, 0.02, 0.03]) ** 2


SPEED = {"|v|": (0.85, -0.31, 0.60)}


def said(
    exponents: tuple[float, ...], covariance: Floats = NARROW, inputs: str = "ωlN", motion: Any = None
) -> str:
    errors = 1.96 * np.sqrt(np.diag(covariance))
    intervals = [(value - error, value + error) for value, error in zip(exponents, errors, strict=True)]
    return in_words(list(inputs), np.array(exponents), covariance, intervals, motion or {})


def test_the_power_is_that_of_generalised_least_squares() -> None:
    (reading,) = readings(["ω", "l"], np.array([0.11, 0.40]), NARROW[:2, :2])
    weights = np.array([1.0, 4.0]) / np.array([0.01, 0.02]) ** 2
    assert reading.power == pytest.approx((weights @ [0.11, 0.40]) / (weights @ [1.0, 4.0]))
    assert reading.error == pytest.approx((weights @ [1.0, 4.0]) ** -0.5)


@pytest.mark.parametrize(
    ("words", "parts"),
    [
        (
            said((0.105, 0.41, 0.02)),
            ("in proportion to ω̄^0.10 (0.09 to 0.11)", "independent of N within"),
        ),
        (
            said((0.5, 0.01, 0.02)),
            ("in proportion to ω^0.50 (0.48 to 0.52), independent of l and N within",),
        ),
        (said((0.3, -0.6, 0.02)), ("ω^0.30 (0.28 to 0.32) l^-0.60 (-0.64 to -0.56)", "independent of N within")),
        (said((0.2, 0.4, 0.01), np.diag([0.4, 0.05, 0.03]) ** 2), ("l^", "ω̄^", "or as well to")),
        (said((0.3,), NARROW[1:2, 1:2], "l"), ("in proportion to l^0.30 (0.26 to 0.34)",)),
        (said((0.001, 0.002, 0.003)), ("independent of ω, l and N within the intervals",)),
    ],
    ids=["dimensionless speed", "one input", "no quantity", "several quantities", "inputs alike", "no dependence"],
)
def test_exponents_are_said_as_powers_of_quantities(words: str, parts: tuple[str, ...]) -> None:
    assert all(part in words for part in parts), words
    assert said((), np.zeros((0, 0)), "") == ""


def test_the_motion_is_named_beside_the_inputs_where_no_quantity_of_the_inputs_is_nearer() -> None:
    words = said((0.43, -0.15, 0.30), motion=SPEED)
    assert words.startswith(
        "in proportion to ω^0.43 (0.41 to 0.45) l^-0.15 (-0.19 to -0.11) N^0.30 (0.24 to 0.36)"
    )
    assert ", or as well to |v|^0.50 (0.48 to 0.53)" in words
    assert "|v|" not in said((0.105, 0.41, 0.02), motion=SPEED)
    assert "|v|" not in said((0.43, 0.15, 0.30), motion=SPEED)
    assert "|v|" not in said((0.001, 0.002, 0.003), motion=SPEED)
    assert "|v|" in said((0.43, -0.15, 0.30), 400 * NARROW, motion=SPEED)
    assert "|v|" not in said((0.43, 0.0, 0.0), 400 * NARROW, motion=SPEED)


@pytest.mark.parametrize("with_speed", [False, True])
def test_the_motion_follows_the_inputs_as_its_exponents_say(with_speed: bool) -> None:
    """The slopes of a plane, here by the normal equations, from the outputs of a table with little noise."""
    table = toy_table(1, lengths_cm=(5.0, 7.0, 9.0, 11.0), design={"noise": 1e-4, "session_noise": 0.0})
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
