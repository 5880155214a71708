"""Vectors and 3×3 matrices as tuples of components: the algebra in which the formulas are written.

A vector is (a_x, a_y, a_z); a matrix is a tuple of three such rows. A component is anything that can be added and
multiplied: a number in a compiled loop, or a tensor with an entry for each node and robot. So a formula of
`sim.mechanics` is written once and used by both.

`sim.jit.formula` marks such a function.
"""

from __future__ import annotations

from typing import Any

from sim.jit import formula

Vector = tuple[Any, Any, Any]
Matrix = tuple[Vector, Vector, Vector]

ZERO: Vector = (0.0, 0.0, 0.0)
ZERO_MATRIX: Matrix = (ZERO, ZERO, ZERO)
E_Z: Vector = (0.0, 0.0, 1.0)


@formula
def dot(a: Vector, b: Vector) -> Any:
    """Compute a·b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@formula
def cross(a: Vector, b: Vector) -> Vector:
    """Compute a × b."""
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


@formula
def plus(a: Vector, b: Vector) -> Vector:
    """Compute a + b."""
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


@formula
def minus(a: Vector, b: Vector) -> Vector:
    """Compute a − b."""
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


@formula
def times(s: Any, a: Vector) -> Vector:
    """Compute s a."""
    return (s * a[0], s * a[1], s * a[2])


@formula
def outer(a: Vector, b: Vector) -> Matrix:
    """Compute a ⊗ b."""
    return (times(a[0], b), times(a[1], b), times(a[2], b))


@formula
def added(a: Matrix, b: Matrix) -> Matrix:
    """Compute a + b."""
    return (plus(a[0], b[0]), plus(a[1], b[1]), plus(a[2], b[2]))


@formula
def subtracted(a: Matrix, b: Matrix) -> Matrix:
    """Compute a − b."""
    return (minus(a[0], b[0]), minus(a[1], b[1]), minus(a[2], b[2]))


@formula
def negative(a: Matrix) -> Matrix:
    """Compute −a."""
    return (
        (-a[0][0], -a[0][1], -a[0][2]),
        (-a[1][0], -a[1][1], -a[1][2]),
        (-a[2][0], -a[2][1], -a[2][2]),
    )


@formula
def plus_identity(a: Matrix, s: Any) -> Matrix:
    """Compute a + s I."""
    return (
        (a[0][0] + s, a[0][1], a[0][2]),
        (a[1][0], a[1][1] + s, a[1][2]),
        (a[2][0], a[2][1], a[2][2] + s),
    )


@formula
def transposed(a: Matrix) -> Matrix:
    """Compute aᵀ."""
    return (
        (a[0][0], a[1][0], a[2][0]),
        (a[0][1], a[1][1], a[2][1]),
        (a[0][2], a[1][2], a[2][2]),
    )


@formula
def applied(a: Matrix, b: Vector) -> Vector:
    """Compute a b."""
    return (dot(a[0], b), dot(a[1], b), dot(a[2], b))


@formula
def projected(a: Matrix, t: Vector, s: Any) -> Matrix:
    """Compute s a (I − t⊗t): chain rule from the unit vector t to a vector along it of length 1/s."""
    along = applied(a, t)
    return (
        times(s, minus(a[0], times(along[0], t))),
        times(s, minus(a[1], times(along[1], t))),
        times(s, minus(a[2], times(along[2], t))),
    )


@formula
def crossed(a: Vector, b: Matrix) -> Matrix:
    """Compute [a×] b: the columns of b under a ×."""
    return (
        minus(times(a[1], b[2]), times(a[2], b[1])),
        minus(times(a[2], b[0]), times(a[0], b[2])),
        minus(times(a[0], b[1]), times(a[1], b[0])),
    )


@formula
def turned(b: Matrix, a: Vector) -> Matrix:
    """Compute b [a×]: the rows of b under × a."""
    return (cross(b[0], a), cross(b[1], a), cross(b[2], a))


@formula
def product(a: Matrix, b: Matrix) -> Matrix:
    """Compute a b."""
    return (
        plus(plus(times(a[0][0], b[0]), times(a[0][1], b[1])), times(a[0][2], b[2])),
        plus(plus(times(a[1][0], b[0]), times(a[1][1], b[1])), times(a[1][2], b[2])),
        plus(plus(times(a[2][0], b[0]), times(a[2][1], b[1])), times(a[2][2], b[2])),
    )


@formula
def inverse(a: Matrix) -> Matrix:
    """Compute a⁻¹."""
    p, q, r = transposed(a)
    first = cross(q, r)
    scale = 1.0 / dot(p, first)
    return (times(scale, first), times(scale, cross(r, p)), times(scale, cross(p, q)))
