"""Contact between tails: how close they come, and a repulsion that begins where their axes are 2 r0 apart.

    gap = min |x − y| / (2 r0)   over nodes x of one tail and points y on the edges of another

At 1 the tails touch. The base model has no contact, so rows below 1 are kept and flagged. With the effect
`tail_contact`, rows are flagged only where the gap is not kept (`sim.effects.tail_contact.least_gap`). Where two
edges cross between their nodes, the error of the distance is at most half an edge.

The energy of a tail beside another one is ∫ φ(d(s)) ds, with d(s) the distance from its point s to the axis of the
other tail. The force per length −φ'(d) is a smoothed line: about zero above D = 2 r0, and in proportion to D − d
below,

    f = F ln(1 + exp(g)),   g = (D − d)/(SOFTNESS D).

The smallest distance from a point x to a chain of edges has kinks: the nearest edge changes. So d is a smooth
smallest distance, which for a straight line is the distance itself:

    d² = −2 w² ln Σ ∫ exp(−|x − y|²/2w²) dy/√(2π) w,   w = WIDTH D,

the sum over the edges of the other tail, each integral in closed form. The force on x is spread over the other
tail with the same weights. So force and moment of each pair of points are zero. A tail is here a smooth curve
through its nodes, with POINTS points on it, whatever the mesh. Left out: friction, and the fluid that is squeezed
out between tails.

Source: Tong, Choi, Joo, Jawed, *Extreme Mech. Lett.* 58, 101924 (2023), arXiv 2205.10309: an energy of the
smallest distance, smoothed, and solved for with the balance. The smooth smallest distance here is ours. Units:
l, EI/l², EI/l³.
"""

from __future__ import annotations

from math import erfc

import numpy as np

from common.arrays import Floats, Integers
from sim.jit import borrowing, compiled
from sim.linear.blocks import add, add_at, put, put_at, vector, vector_at
from sim.linear.vectors import ZERO, Vector, cross, dot, minus, plus, times
from sim.mechanics.balance import body_wrench, motion_at
from sim.mechanics.geometry import Geometry
from sim.model.body import Body

SOFTNESS = 0.004  # of D: the force grows from nothing to a line over a few of these
FIRM = 0.02  # of D: at this depth the force per length is that of `Body.nonlocal_terms`
WIDTH = 0.1  # of D
POINTS = 96  # of a tail
_REACH = 1.1  # of D: no force beyond; it is 1e-11 of the line there
_BESIDE = 0.4  # of D²: edges whose squared distance is larger by this count for nothing
_EDGES = 24  # of the smooth tail, or more


@borrowing
def has_contact(body: Body) -> bool:
    """Tell whether the tails feel each other's touch."""
    return bool(body.nonlocal_terms.tail_contact != 0)


@compiled
def add_contact(
    body: Body, geometry: Geometry, x: Floats, u: Floats, phase: float, instant: int, tails: int, wrench: Floats
) -> None:
    """Add contact to the forces of the edges of the tails at one instant, and to the wrench on the robot.

    An edge carries what acts on the nodes beyond it. So its force −Σ f, in `geometry`, is that on these nodes. The
    clamp feels them through its elastic edge only; `wrench` sets that right.

    Args:
        x: free nodes, (n, M, 3); tail j at instant p of P is column p + j P, at phase φ + 2πj/N.
        u: (v_x, v_z, ω_yr, ω_h), (4,).
        phase: φ.
        wrench: (4,), about J.
    """
    n, columns, _ = x.shape
    root = (body.offset, 0.0, 0.0)
    force = np.empty((n + 1, tails, 3))
    contact_forces(body, x, instant, tails, force)
    for j in range(tails):
        total = ZERO
        for k in range(n, 0, -1):
            total = plus(total, vector(force, k, j))
            add(geometry.force, k - 1, instant + j * (columns // tails), times(-1.0, total))
        total = plus(total, vector(force, 0, j))
        motion = motion_at(body, u, phase + 2 * np.pi * j / tails)
        more = body_wrench(motion, total, cross(root, total))
        for a in range(4):
            wrench[a] += more[a]


@compiled
def contact_forces(body: Body, x: Floats, instant: int, tails: int, force: Floats) -> None:
    """Compute the forces of contact on the tails at one instant.

    Args:
        x: free nodes, (n, M, 3); tail j at instant p of P is column p + j P.
        force: (n + 1, N, 3), filled: on nodes 0..n, each in the frame of its tail.
    """
    n, columns, _ = x.shape
    smooth = _smooth_chain(n)
    edges = len(smooth) - 1
    nodes, place, push = np.empty((n + 1, 3)), np.empty((tails, edges + 1, 3)), np.zeros((tails, edges + 1, 3))
    for j in range(tails):
        put_at(nodes, 0, _turned((body.offset, 0.0, 0.0), j / tails))
        for k in range(n):
            put_at(nodes, k + 1, _turned(vector(x, k, instant + j * (columns // tails)), j / tails))
        np.dot(smooth, nodes, place[j])
    near = np.zeros(edges, np.int64)
    for i in range(tails):
        for j in range(tails):
            if i != j:
                for k in range(edges):
                    count = _edges_near(body, place[i], k, place[j], near)
                    if count > 0:
                        _push(body, place[i], k, place[j], near[:count], push[i], push[j])
    back = np.ascontiguousarray(smooth.T)
    for j in range(tails):
        np.dot(back, push[j], nodes)
        for k in range(n + 1):
            put(force, k, j, _turned(vector_at(nodes, k), -j / tails))


@compiled
def _smooth_chain(n: int) -> Floats:
    """Compute the weights (E + 1, n + 1) of the nodes 0..n in a finer chain: a cubic (Catmull-Rom) through them.

    Forces go back to the nodes by the same weights, which keeps their sum and their moment.
    """
    parts = -(-_EDGES // n)
    weights = np.zeros((n * parts + 1, n + 1))
    for i in range(len(weights)):
        k = min(i // parts, n - 1)
        t = i / parts - k
        for at, weight in (
            (k - 1, t * (-0.5 + t * (1 - 0.5 * t))),
            (k, 1 + t * t * (1.5 * t - 2.5)),
            (k + 1, t * (0.5 + t * (2 - 1.5 * t))),
            (k + 2, 0.5 * t * t * (t - 1)),
        ):
            if at < 0 or at > n:  # beyond an end: as if the tail were straight there
                inside = 1 if at < 0 else n - 1
                weights[i, (at + inside) // 2] += 2 * weight
                weights[i, inside] -= weight
            else:
                weights[i, at] += weight
    return weights


@borrowing
def _turned(v: Vector, share: float) -> Vector:
    """Turn a vector about e_z by a share of a whole turn."""
    cos, sin = np.cos(2 * np.pi * share), np.sin(2 * np.pi * share)
    return cos * v[0] - sin * v[1], sin * v[0] + cos * v[1], v[2]


@borrowing
def _edges_near(body: Body, tail: Floats, k: int, neighbour: Floats, near: Integers) -> int:
    """Count the edges of the other tail that may touch edge k of this one, and list them in `near`."""
    n, count, j = len(tail) - 1, 0, 0
    within = 1.1 / n + 2 * 1.2 * body.tail_radius  # half an edge each; edges hardly stretch
    middle = times(0.5, plus(vector_at(tail, k), vector_at(tail, k + 1)))
    while j < n:
        apart = minus(middle, times(0.5, plus(vector_at(neighbour, j), vector_at(neighbour, j + 1))))
        too_far = np.sqrt(dot(apart, apart)) - within
        if too_far < 0:
            near[count] = j
            count += 1
        j += max(1, int(too_far * n / 1.1))  # the edges between are too far, too
    return count


@compiled
def _push(
    body: Body, tail: Floats, k: int, neighbour: Floats, near: Integers, on_tail: Floats, on_neighbour: Floats
) -> None:
    """Add the forces between the points of edge k of one tail and the edges `near` of the other."""
    n = len(tail) - 1
    diameter = 2 * body.tail_radius
    width = WIDTH * diameter
    points = -(-POINTS // n)
    line = body.nonlocal_terms.tail_contact * SOFTNESS / FIRM
    stiffness = 0.5 * line / (points * n)  # each pair counts twice
    start, edge = vector_at(tail, k), minus(vector_at(tail, k + 1), vector_at(tail, k))
    on_ends, square = np.empty((len(near), 2, 3)), np.empty(len(near))
    for i in range(points):
        share = (i + 0.5) / points
        at = plus(start, times(share, edge))
        nearest = np.inf
        for c in range(len(near)):
            square[c] = _squared_distance(at, vector_at(neighbour, near[c]), vector_at(neighbour, near[c] + 1))
            nearest = min(nearest, square[c])
        if nearest > (_REACH * diameter) ** 2:
            continue
        closeness, away = 0.0, ZERO
        for c in range(len(near)):
            if square[c] > nearest + _BESIDE * diameter**2:
                on_ends[c] = 0.0
                continue
            weight, first, second = _closeness(
                at, vector_at(neighbour, near[c]), vector_at(neighbour, near[c] + 1), width
            )
            closeness += weight
            away = plus(away, plus(first, second))
            put_at(on_ends[c], 0, first)
            put_at(on_ends[c], 1, second)
        distance = np.sqrt(max(-2 * width**2 * np.log(closeness / n), (0.01 * diameter) ** 2))
        depth = (diameter - distance) / (SOFTNESS * diameter)
        ramp = max(depth, 0.0) + np.log1p(np.exp(-abs(depth)))
        scale = stiffness * ramp / (distance * closeness)
        add_at(on_tail, k, times((1 - share) * scale, away))
        add_at(on_tail, k + 1, times(share * scale, away))
        for c in range(len(near)):
            add_at(on_neighbour, near[c], times(-scale, vector_at(on_ends[c], 0)))
            add_at(on_neighbour, near[c] + 1, times(-scale, vector_at(on_ends[c], 1)))


@borrowing
def _squared_distance(at: Vector, start: Vector, end: Vector) -> float:
    """Compute the squared distance of a point from an edge."""
    edge, away = minus(end, start), minus(at, start)
    foot = min(max(dot(away, edge) / dot(edge, edge), 0.0), 1.0)
    away = minus(away, times(foot, edge))
    return dot(away, away)


@borrowing
def _closeness(at: Vector, start: Vector, end: Vector, width: float) -> tuple[float, Vector, Vector]:
    """Integrate g over an edge y = start + σ e, g = exp(−|x − y|²/2w²)/√(2π) w; and the parts of ∫ (x − y) g dσ.

    Returns:
        The integral; the part with 1 − σ, of the edge's start; the part with σ, of its end.
    """
    edge, away = minus(end, start), minus(at, start)
    square = dot(edge, edge)
    foot = dot(away, edge) / square
    across = minus(away, times(foot, edge))
    steep = np.sqrt(0.5 * square) / width
    low, high = -steep * foot, steep * (1 - foot)  # ends of the edge, from the foot, in √2 w
    height = np.exp(-0.5 * dot(across, across) / width**2) / (np.sqrt(2 * np.pi) * width)
    at_low, at_high = height * np.exp(-low * low), height * np.exp(-high * high)
    if low > 0:
        part = erfc(low) - erfc(high)
    elif high < 0:
        part = erfc(-high) - erfc(-low)
    else:
        part = 2 - erfc(-low) - erfc(high)
    zeroth = height * np.sqrt(np.pi) / (2 * steep) * part
    first = (at_low - at_high) / (2 * steep * steep)  # ∫ (σ − foot) g dσ
    second = 0.5 / steep**2 * zeroth + (low * at_low - high * at_high) / (2 * steep**3)
    all_of_it = minus(times(zeroth, across), times(first, edge))
    of_end = minus(times(first + foot * zeroth, across), times(second + foot * first, edge))
    return zeroth, minus(all_of_it, of_end), of_end


@compiled
def tail_gap(x: Floats, offset: float, radius: float) -> float:
    """Compute the smallest distance between two tails over 2 r0; infinite for one tail.

    Args:
        x: free nodes at one instant, (n, N, 3), every tail turned so that its clamp lies at (offset, 0, 0).
        offset, radius: a/l and r0/l.
    """
    n, tails, _ = x.shape
    smallest = np.inf
    for i in range(tails):
        for j in range(tails):
            if i == j:
                continue
            angle = 2 * np.pi * (j - i) / tails
            cos, sin = np.cos(angle), np.sin(angle)
            px, py, pz = cos * offset, sin * offset, 0.0
            for k in range(n):
                qx, qy, qz = cos * x[k, j, 0] - sin * x[k, j, 1], sin * x[k, j, 0] + cos * x[k, j, 1], x[k, j, 2]
                ex, ey, ez = qx - px, qy - py, qz - pz
                scale = 1 / (ex * ex + ey * ey + ez * ez)
                for node in range(n):
                    ax, ay, az = x[node, i, 0] - px, x[node, i, 1] - py, x[node, i, 2] - pz
                    share = min(max((ax * ex + ay * ey + az * ez) * scale, 0.0), 1.0)
                    ax, ay, az = ax - share * ex, ay - share * ey, az - share * ez
                    smallest = min(smallest, ax * ax + ay * ay + az * az)
                px, py, pz = qx, qy, qz
    return np.sqrt(smallest) / (2 * radius)


@compiled
def smallest_gaps(shapes: Floats, offset: Floats, radius: Floats) -> Floats:
    """Compute the smallest `tail_gap` of B robots with a/l and r0/l (B,) over S shapes, (B, S, n, N, 3)."""
    gaps = np.full(len(shapes), np.inf)
    for i in range(len(shapes)):
        for k in range(shapes.shape[1]):
            gaps[i] = min(gaps[i], tail_gap(shapes[i, k], offset[i], radius[i]))
    return gaps
