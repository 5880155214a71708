"""Derivatives by the complex step."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from sim.arrays import Floats
from sim.effects import catalogue
from sim.linear.complex_step import angle, derivative, length, magnitude, sign
from sim.model.slopes import SLOPE_INPUTS
from sim.solve.assembly import numbers
from tests.sim.robots import control

PLACES = np.array([[1.3, 0.4], [-1.3, 0.4], [-0.7, -2.0], [0.7, -2.0]])  # one in each quadrant
FORMULAS: list[tuple[Callable[[Floats], Floats], Callable[[Floats], Floats]]] = [
    (lambda p: magnitude(p[:, 0]), lambda p: np.abs(p[:, 0])),
    (lambda p: sign(p[:, 0]) * p[:, 1], lambda p: np.sign(p[:, 0]) * p[:, 1]),
    (lambda p: length(p[:, 0], p[:, 1]), lambda p: np.hypot(p[:, 0], p[:, 1])),
    (lambda p: angle(p[:, 1], p[:, 0]), lambda p: np.arctan2(p[:, 1], p[:, 0])),
]


@pytest.mark.parametrize(("formula", "wanted"), FORMULAS)
def test_formulas_have_the_derivative_of_what_they_replace(
    formula: Callable[[Floats], Floats], wanted: Callable[[Floats], Floats]
) -> None:
    assert (formula(PLACES) == wanted(PLACES)).all()
    direction = np.array([0.3, -0.8])
    differences = (wanted(PLACES + 1e-6 * direction) - wanted(PLACES - 1e-6 * direction)) / 2e-6
    assert derivative(formula, PLACES, direction) == pytest.approx(differences, rel=1e-8, abs=1e-9)


@pytest.mark.parametrize("name", [*SLOPE_INPUTS, *catalogue()])
def test_numbers_of_a_robot_carry_derivatives(name: str) -> None:
    """In every input and effect, with all effects there: an effect that drops the imaginary part is found."""
    sizes = {effect.name: 0.5 * (effect.null + effect.typical) for effect in catalogue().values()}
    groups = control(2, omega_bar=[10.0, -10.0], **sizes)
    size = getattr(groups, name) if name in SLOPE_INPUTS else groups.effects[name]

    def at(value: Floats) -> Floats:
        if name in SLOPE_INPUTS:
            return numbers(replace(groups, **{name: value}))  # type: ignore[arg-type]
        return numbers(replace(groups, effects={**groups.effects, name: value}))

    width = 1e-5 * np.abs(size)
    differences = (at(size + width) - at(size - width)) / (2 * width[:, None])
    scale = np.abs(at(size)) / np.abs(size)[:, None]
    assert (
        np.abs(derivative(at, size, np.ones(2)) - differences) <= 1e-9 * scale + 1e-6 * np.abs(differences)
    ).all()
