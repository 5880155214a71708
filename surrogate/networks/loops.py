"""Compiled loops of the look-up table, by numba; `evaluate` is that of its networks, for many robots at once.

What numba compiles is kept in FOLDER, which is named by a digest of this package's code. Inner functions are
compiled into the kernels that call them. numba takes half a second to import; so the modules that have loops are
imported by the first query only.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numba import config, njit
from numba.extending import register_jitable

from sim.arrays import Floats
from sim.compiling import folder_of_package, take_formulas

F = TypeVar("F", bound=Callable[..., Any])
BLOCK = 64  # robots that are evaluated together
FOLDER = folder_of_package(Path(__file__).parents[1])
_OPTIONS: dict[str, Any] = {
    "nogil": True,
    "error_model": "numpy",
    "fastmath": {"contract", "reassoc", "nsz", "arcp"},
}
if not any(FOLDER.rglob("*.nbi")):
    print("first use: compiling the look-up table's loops", file=sys.stderr, flush=True)


def inner(function: F) -> F:
    """Compile a function, or a formula, into the kernels that call it."""
    for formula in take_formulas():
        register_jitable(formula)
    compiled: F = njit(**_OPTIONS)(function)
    return compiled


def kernel(function: F) -> F:
    """Compile a function that Python calls, and keep it on disk."""
    before, config.CACHE_DIR = config.CACHE_DIR, str(FOLDER)  # type: ignore[attr-defined]
    try:
        compiled: F = njit(cache=True, **_OPTIONS)(function)
    finally:
        config.CACHE_DIR = before  # type: ignore[attr-defined]
    return compiled


class Layers(NamedTuple):
    """An ensemble for the loops: scale, mean and spread are in the weights; numbers of outputs are even."""

    shift: Floats  # (F,)
    first: Floats  # (K, W, F)
    hidden: Floats  # (K, D − 1, W, W)
    last: Floats  # (K, O, W + F), of the last hidden layer and of the inputs
    biases: Floats  # (K, D, W)
    rest: Floats  # (K, O)


@inner
def tanh(x: float) -> float:
    """Return tanh x within 1e-15: p/q, the Padé approximant at x/4, whose argument is doubled twice.

    That of the C library takes one number at a time. Here loops over arrays become vector instructions.
    """
    a = min(max(x, -20.0), 20.0) / 4
    s = a * a
    p = a * (34459425 + s * (4729725 + s * (135135 + s * (990 + s))))
    q = 34459425 + s * (16216200 + s * (945945 + s * (13860 + 45 * s)))
    for _ in range(2):
        p, q = 2 * p * q, q * q + p * p
    return p / q


@inner
def product(w: Floats, bias: Floats, x: Floats, y: Floats, triangular: bool) -> None:
    """Write W x + bias of robots x (M, F) to y (M, O), for an even O; entries above the diagonal may be left out.

    Four robots at a time share the weights, so that the processor reads fewer numbers than it multiplies.
    """
    count, outputs, inputs = len(x), len(w), w.shape[1]
    whole = count - count % 4
    for k in range(0, whole, 4):
        p, q, r, s = x[k], x[k + 1], x[k + 2], x[k + 3]
        for j in range(0, outputs, 2):
            u, v, stop = w[j], w[j + 1], min(j + 2, inputs) if triangular else inputs
            a0, b0 = bias[j], bias[j + 1]
            a1, a2, a3, b1, b2, b3 = a0, a0, a0, b0, b0, b0
            for i in range(stop):
                a0 += u[i] * p[i]
                a1 += u[i] * q[i]
                a2 += u[i] * r[i]
                a3 += u[i] * s[i]
                b0 += v[i] * p[i]
                b1 += v[i] * q[i]
                b2 += v[i] * r[i]
                b3 += v[i] * s[i]
            y[k, j], y[k + 1, j], y[k + 2, j], y[k + 3, j] = a0, a1, a2, a3
            y[k, j + 1], y[k + 1, j + 1], y[k + 2, j + 1], y[k + 3, j + 1] = b0, b1, b2, b3
    for k in range(whole, count):
        p = x[k]
        for j in range(outputs):
            u, total, stop = w[j], bias[j], min(j + 1, inputs) if triangular else inputs
            for i in range(stop):
                total += u[i] * p[i]
            y[k, j] = total


@inner
def evaluate(layers: Layers, x: Floats, y: Floats) -> None:
    """Write the mean of the members at inputs x (M, F) to y (M, O)."""
    count, inputs, width = len(x), x.shape[1], layers.first.shape[1]
    members, depth = layers.biases.shape[:2]
    hidden, following = np.empty((count, width + inputs)), np.empty((count, width + inputs))
    own = np.empty_like(y)
    shifted = x - layers.shift  # here, since a scale may be small: an input that was learned with one value
    hidden[:, width:] = shifted
    following[:, width:] = shifted
    y[:] = 0.0
    for k in range(members):
        product(layers.first[k], layers.biases[k, 0], shifted, hidden, False)
        for i in range(depth):
            for row in range(count):
                for j in range(width):
                    hidden[row, j] = tanh(hidden[row, j])
            if i + 1 < depth:
                product(layers.hidden[k, i], layers.biases[k, i + 1], hidden, following, False)
                hidden, following = following, hidden
        product(layers.last[k], layers.rest[k], hidden, own, False)
        for row in range(count):
            for j in range(y.shape[1]):
                y[row, j] += own[row, j]


@kernel
def evaluate_all(
    shift: Floats, first: Floats, hidden: Floats, last: Floats, biases: Floats, rest: Floats, x: Floats
) -> Floats:
    """Return the mean of the members of `Layers`, (M, O) with the padding, at inputs x (M, F)."""
    layers, y = Layers(shift, first, hidden, last, biases, rest), np.empty((len(x), rest.shape[1]))
    for begin in range(0, len(x), BLOCK):
        evaluate(layers, x[begin : begin + BLOCK], y[begin : begin + BLOCK])
    return y
