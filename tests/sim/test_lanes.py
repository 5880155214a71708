"""Vectors with a lane for each robot: what numba must offer, each operation, and matrices that exchange rows."""

from __future__ import annotations

import importlib

import numba
import numpy as np
import pytest

from sim.arrays import Floats
from sim.jit import compiled
from sim.lanes import choose, fma, lane, lanes, larger, less, smaller, somewhere, width, with_lane
from sim.linear.dense import factor_dense, solve_factored


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
