"""Arrays of vectors with a lane for each robot (`sim.lanes`): lanes in and out, sums, largest entries."""

from __future__ import annotations

from typing import Any

from common.arrays import Floats
from sim.jit import borrowing
from sim.lanes import choose, fma, lane, larger, with_lane


@borrowing
def put_lane(out: Floats, i: int, values: Floats) -> None:
    """Set lane i of an array of vectors to the numbers of an array of the same size."""
    flat, given = out.reshape(out.size), values.reshape(values.size)
    for j in range(len(flat)):
        flat[j] = with_lane(flat[j], i, given[j])


@borrowing
def take_lane(out: Floats, values: Floats, i: int) -> None:
    """Set the numbers of an array to lane i of an array of vectors of the same size."""
    flat, given = out.reshape(out.size), values.reshape(values.size)
    for j in range(len(flat)):
        flat[j] = lane(given[j], i)


@borrowing
def copy(out: Floats, values: Floats) -> None:
    """Set an array to another of the same size; numba takes seconds to compile `out[:] = values`."""
    flat, given = out.reshape(out.size), values.reshape(values.size)
    for i in range(len(flat)):
        flat[i] = given[i]


@borrowing
def combine(out: Floats, a: Any, x: Floats, b: Any, y: Floats) -> None:
    """Set out = a x + b y, for arrays of the same size."""
    flat, first, second = out.reshape(out.size), x.reshape(x.size), y.reshape(y.size)
    for i in range(len(flat)):
        flat[i] = a * first[i] + b * second[i]


@borrowing
def add_chosen(a: Floats, share: Any, change: Floats, going: Any) -> None:
    """Add in place: a += share · change, in the lanes where `going` is 1."""
    flat, changes = a.reshape(a.size), change.reshape(change.size)
    for i in range(len(flat)):
        flat[i] = choose(going, flat[i] + share * changes[i], flat[i])


@borrowing
def choose_all(out: Floats, condition: Any, a: Floats, b: Floats) -> None:
    """Set every entry to that of a where the condition is true, else to that of b."""
    flat, first, second = out.reshape(out.size), a.reshape(a.size), b.reshape(b.size)
    for i in range(len(flat)):
        flat[i] = choose(condition, first[i], second[i])


@borrowing
def largest_entry(a: Floats) -> Any:
    """Find the largest magnitude in each lane; NaN where there is one."""
    flat = a.reshape(a.size)
    largest = abs(flat[0])
    for i in range(1, len(flat)):
        largest = larger(largest, abs(flat[i]))
    return largest


@borrowing
def scalar_product(a: Floats, b: Floats) -> Any:
    """Compute the scalar product of two vectors (K,), as four sums that are added at the same time."""
    first = second = third = fourth = 0.0 * a[0]
    whole = len(a) - len(a) % 4
    for k in range(0, whole, 4):
        first, second = fma(a[k], b[k], first), fma(a[k + 1], b[k + 1], second)
        third, fourth = fma(a[k + 2], b[k + 2], third), fma(a[k + 3], b[k + 3], fourth)
    for k in range(whole, len(a)):
        first = fma(a[k], b[k], first)
    return (first + second) + (third + fourth)


@borrowing
def subtract_multiple(out: Floats, factor: Any, a: Floats) -> None:
    """Set out -= factor · a, for vectors (K,)."""
    for k in range(len(out)):
        out[k] = fma(-factor, a[k], out[k])


@borrowing
def divide(out: Floats, a: Floats, by: Any) -> None:
    """Set out = a/by, for arrays of the same size."""
    flat, values = out.reshape(out.size), a.reshape(a.size)
    for k in range(len(flat)):
        flat[k] = values[k] / by
