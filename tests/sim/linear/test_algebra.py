"""Vectors with a lane for each robot, small dense systems, GMRES, trigonometric interpolants, complex steps."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise

import numba
import numpy as np
import pytest

from common.arrays import Floats
from sim.effects import catalogue
from sim.jit import compiled
from sim.lanes import choose, fma, lane, lanes, larger, less, smaller, somewhere, width, with_lane
from sim.linear.complex_step import derivative, magnitude, sign
from sim.linear.dense import factor_dense, solve_factored
from sim.linear.gmres import extend, new_krylov, solution, start
from sim.linear.spectral import differentiation, interpolation, with_phases
from sim.model.groups import SLOPE_INPUTS
from sim.solve.assembly import numbers
from tests.sim.robots import control


def solved(matrix: np.ndarray, right: np.ndarray, most: int, tolerance: float) -> tuple[np.ndarray, list[float]]:
    """Solve; return the solution and the relative residuals that GMRES states on the way."""
    krylov, norm = new_krylov(right, len(right), most), np.linalg.norm(right)
    assert start(krylov, right) == pytest.approx(norm)
    left: list[float] = []
    for i in range(most):
        left.append(extend(krylov, i, matrix @ krylov.basis[i], 1.0) / norm)
        if left[-1] < tolerance:
            break
    found = np.empty_like(right)
    solution(krylov, len(left), found)
    return found, left


def test_it_solves_in_as_many_steps_as_there_are_unknowns() -> None:
    rng = np.random.default_rng(0)
    matrix, right = rng.normal(size=(12, 12)) + 3 * np.eye(12), rng.normal(size=12)
    found, left = solved(matrix, right, 12, 1e-13)
    assert matrix @ found == pytest.approx(right, abs=1e-10)
    assert all(b <= a * (1 + 1e-12) for a, b in pairwise(left))  # residuals never grow


def test_the_stated_residual_is_the_true_one() -> None:
    rng = np.random.default_rng(2)
    matrix, right = rng.normal(size=(30, 30)) + 8 * np.eye(30), rng.normal(size=30)
    for steps in (1, 9):
        found, left = solved(matrix, right, steps, 0.0)
        true = np.linalg.norm(right - matrix @ found) / np.linalg.norm(right)
        assert left[-1] == pytest.approx(true, rel=1e-8)


def test_nothing_to_solve_for() -> None:
    krylov, found = new_krylov(np.zeros(5), 5, 3), np.ones(5)
    assert start(krylov, np.zeros(5)) == 0.0
    solution(krylov, 0, found)
    assert found == pytest.approx(np.zeros(5))


@pytest.mark.parametrize("phases", [3, 4, 5, 8])
def test_phases_are_resampled_and_differentiated_exactly(phases: int) -> None:
    at = 2 * np.pi * np.arange(phases) / phases
    finer = 2 * np.pi * np.arange(12) / 12
    for k in range(1, (phases - 1) // 2 + 1):
        values = np.cos(k * at + 0.3)
        assert differentiation(phases) @ values == pytest.approx(-k * np.sin(k * at + 0.3), abs=1e-12)
        assert interpolation(phases, finer) @ values == pytest.approx(np.cos(k * finer + 0.3), abs=1e-12)
        assert with_phases(values.reshape(1, -1, 1), 12)[0, :, 0] == pytest.approx(
            np.cos(k * finer + 0.3), abs=1e-12
        )


PLACES = np.array([[1.3, 0.4], [-1.3, 0.4], [-0.7, -2.0], [0.7, -2.0]])  # one in each quadrant
FORMULAS: list[tuple[Callable[[Floats], Floats], Callable[[Floats], Floats]]] = [
    (lambda p: magnitude(p[:, 0]), lambda p: np.abs(p[:, 0])),
    (lambda p: sign(p[:, 0]) * p[:, 1], lambda p: np.sign(p[:, 0]) * p[:, 1]),
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


@compiled
def factored(a: Floats, exchanged: Floats, b: Floats) -> None:
    """Factor a and solve for b with the factors, twice."""
    x, y, z = lanes(a), lanes(exchanged), lanes(b)
    factor_dense(x, y)
    solve_factored(x, y, z)
    solve_factored(x, y, z)


def test_each_lane_exchanges_its_own_rows() -> None:
    rng, count = np.random.default_rng(7), width()
    a, b = rng.normal(size=(8, 8, count)), rng.normal(size=(8, 3, count))
    factors, found, exchanged = a.copy(), b.copy(), np.zeros_like(a)
    factored(factors, exchanged, found)
    for i in range(count):
        matrix = a[:, :, i]
        assert matrix @ matrix @ found[:, :, i] == pytest.approx(b[:, :, i], abs=1e-9)
    assert exchanged.any(axis=(0, 1)).all()
    assert len({part.tobytes() for part in np.moveaxis(exchanged, -1, 0)}) == count


HOOKS = """numba.types: Array Boolean Float Integer NamedUniTuple Type VarArg
numba.extending: lower_builtin lower_cast models overload register_model type_callable typeof_impl
numba.core.cgutils: get_or_insert_function unpack_tuple
numba.core.event: Listener register
numba.core.imputils: impl_ret_borrowed
numba.core.typeconv: Conversion
numba.np.arrayobj: make_array populate_array
llvmlite.ir: Constant DoubleType FunctionType IntType Undefined VectorType"""


@pytest.mark.parametrize("line", HOOKS.splitlines())
def test_numba_has_the_hooks_that_lanes_are_made_with(line: str) -> None:
    module, names = line.split(": ")
    missing = [name for name in names.split() if not hasattr(importlib.import_module(module), name)]
    assert not missing, f"numba {numba.__version__} has no {module}.{missing}; sim/lane_code.py needs it"


@compiled
def operated(a: Floats, b: Floats, out: Floats) -> None:
    """Write each operation on a and b, (1, W), to a row of out."""
    x, y, rows = lanes(a)[0], lanes(b)[0], lanes(out)
    total = x
    total += 1
    rows[0], rows[1], rows[2], rows[3] = total - y, x * y, x / y, -x
    rows[4], rows[5], rows[6], rows[7] = fma(x, y, 1.0), larger(x, y), smaller(x, y), less(x, y)
    rows[8], rows[9] = choose(less(x, y), x, 2), abs(x)
    rows[10], rows[11], rows[12] = np.sqrt(y), np.cos(x), np.sin(x)
    rows[13] = with_lane(x, 2, lane(y, 1))
    rows[14] = x + width() if somewhere(less(x, y)) and not somewhere(less(y, 0.0)) else y


def test_an_operation_on_vectors_is_that_on_each_number() -> None:
    rng, count = np.random.default_rng(8), width()
    x, y = rng.normal(size=count), rng.uniform(1.0, 2.0, count)
    x[0], out = np.nan, np.empty((15, count))
    operated(x[None], y[None], out)
    moved = x.copy()
    moved[2] = y[1]
    expected = [
        x + 1 - y, x * y, x / y, -x, x * y + 1, np.maximum(x, y), np.where(x < y, x, y), x < y,
        np.where(x < y, x, 2), abs(x), np.sqrt(y), np.cos(x), np.sin(x), moved, x + count,
    ]  # fmt: skip
    assert out == pytest.approx(np.stack(expected), rel=1e-14, nan_ok=True)
