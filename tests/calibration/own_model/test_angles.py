"""Angles of a model of one's own are compared modulo a turn."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pandas as pd
import pytest

import softflagella as sf

X = np.repeat(np.linspace(-3, 3.4, 15), 3)
NOISE = 0.02 * np.random.default_rng(1).standard_normal(45)
UNITS = {"deg": 360.0, "°": 360.0, "rad": 2 * np.pi}


def wrapped(angle: Any, turn: float, low: float = -0.5) -> Any:
    return (angle - low * turn) % turn + low * turn


def verdict(angle: Any, function: Callable[[Any, Any], Any], number: sf.Number, unit: str) -> Any:
    model = sf.Model(
        lambda c, p: {"a": function(c, p)},
        outputs={"a": sf.Output("angle", unit=unit, kind="difference")},
        numbers=[number],
        effects=[sf.Effect("square", "square", low=-1, high=1)] if number.name == "k" else [],
        settings=["x"],
    )
    table = pd.DataFrame({"x": X, "day": np.tile([1, 2, 3], 15), "a": angle})
    return sf.calibrate(table, model, session="day", progress=False)


@pytest.mark.parametrize("unit", UNITS)
@pytest.mark.parametrize("low", [-0.5, 0.0])
def test_a_model_that_is_wrapped_and_one_that_is_not_have_one_verdict(unit: str, low: float) -> None:
    turn = UNITS[unit]
    of_rad = turn / (2 * np.pi)
    measured = wrapped(of_rad * (2 * X + NOISE), turn, low)

    def plain(c: Any, p: Any) -> Any:
        return of_rad * (p["k"] * c["x"] + p["square"] * c["x"] ** 2)

    results = [
        verdict(measured, function, sf.Number("k", 1.9), unit)
        for function in (
            plain,
            lambda c, p: wrapped(plain(c, p), turn),
            lambda c, p: wrapped(plain(c, p), turn, 0.0),
        )
    ]
    assert {result.verdict for result in results} == {"none"}
    for result in results:
        assert result.corrected["k"] == pytest.approx(2, abs=0.01)
        assert result.error_after == pytest.approx(results[0].error_after)
        assert result.error_after < 0.03 * of_rad


def test_means_are_circular() -> None:
    """179.5 ± 1.1° is measured on either side of ±180°."""
    result = verdict(
        wrapped(179.5 + np.degrees(NOISE), 360.0), lambda c, p: p["h"] + 0 * c["x"], sf.Number("h", 170.0), "deg"
    )
    assert result.corrected["h"] == pytest.approx(179.5, abs=0.6)
    assert result.error_after == pytest.approx(1.1, abs=0.4)


def test_what_is_no_angle_is_compared_as_it_is() -> None:
    result = verdict(
        2 * X + NOISE, lambda c, p: p["k"] * c["x"] + p["square"] * c["x"] ** 2, sf.Number("k", 1.9), "m"
    )
    assert result.corrected["k"] == pytest.approx(2, abs=0.01)
