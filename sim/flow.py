"""Flow of the fluid around tails and head: each feels the others, and their images in the surface above.

A force f on the fluid at y moves it at x by G(x − y) f, G the Stokeslet. Resistive force theory has the drag of a
node on the fluid at rest; here it is on the fluid as the others move it,

    q_k = −l_k [ζ⊥ I + (ζ∥ − ζ⊥) tt] (v_k − w_k),   w_k = Σ ∫ G(x_k − y) f ds,

the sum over the edges of the other tails (a node's force lies evenly on the edges beside it; the integral over a
straight edge is exact, however near), over the head (pieces of its axis that share its drag, and rotlets for its
spin) and over images. Where the balance holds, the force of a free node on the fluid is its elastic force and
load, so w follows from the shape alone; only clamps and head, whose velocity is given, feel each other's answer (a
few rounds, each smaller than the last by the length of half an edge). The head's drag is on the fluid as the tails
move it, too. All of it is solved together with the balance, not a step later.

C_t is a fitted number and above what a cylinder needs (about 1.4): with its whole drag on the fluid the head would
move the fluid at the clamps faster than itself. The part of the drag that flows are made of ends at the drag that
the head's own pieces have, so that it carries the fluid on its axis along; the rest is taken to have other causes.

Surface: a flat plane without shear or flow through it, HEIGHT times the larger of R and a above the axis. The
image of f at (x, 2H − y, z) is (f_x, −f_y, f_z); a spin about z turns backwards. Each tail meets its own image,
and the images of those whose flow it meets (images of others alone would take more drag off a tail than it has).

The singularities are spread over r0 (tails) and R (head), as Cortez, Fauci and Medovikov (2005) do. Left out: the
head's spin in the tails' flow, and its finite thickness (the flow goes through it).
Units: l, μ0 l⁴/EI, EI/l², so μ0 = 1. Source: Pozrikidis (1992), ch. 2; images: Blake (1971), free surface.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sim.compiling import compiled
from sim.drag import node_drag
from sim.tail import E_Z, Body, Geometry, Motion, entry, motion_at, node_tangent, put, vector
from sim.vectors import Vector, cross, dot, formula, minus, plus, times

Array = NDArray[np.float64]

HEIGHT = 1.25  # of the surface above the axis, in the larger of R and a
_PIECES = 4  # of the head's axis
_ROUNDS = 3


@formula
def stokeslets(at: Vector, start: Vector, end: Vector, force: Vector, spread: float) -> Vector:
    """Velocity at a point from a force on the fluid that lies evenly on a straight piece, spread over a length.

    With σ along the piece from the foot of the perpendicular c, and R² = σ² + |c|² + spread²:
    ∫ [(1/R + spread²/R³) f + (r·f) r/R³] dσ/8π, r = c − σ t.
    """
    piece = minus(end, start)
    length = np.sqrt(dot(piece, piece))
    t = times(1 / length, piece)
    away = minus(at, start)
    along = dot(away, t)
    c = minus(away, times(along, t))
    square = dot(c, c) + spread * spread
    first, last = -along, length - along
    r_first, r_last = np.sqrt(first * first + square), np.sqrt(last * last + square)
    if first > 0:
        log = np.log((last + r_last) / (first + r_first))
    elif last < 0:
        log = np.log((r_first - first) / (r_last - last))
    else:
        log = np.log((last + r_last) * (r_first - first) / square)
    cubes = (last / r_last - first / r_first) / square
    first_moment = 1 / r_first - 1 / r_last
    second_moment = log - (last / r_last - first / r_first)
    by_c, by_t = dot(c, force), dot(t, force)
    total = times(log + spread * spread * cubes, force)
    total = plus(total, times(cubes * by_c - first_moment * by_t, c))
    total = plus(total, times(second_moment * by_t - first_moment * by_c, t))
    return times(1 / (8 * np.pi * length), total)


@formula
def rotlet(away: Vector, torque: Vector, spread: float) -> Vector:
    """Velocity at `away` from a torque on the fluid that is spread over a length."""
    square = dot(away, away) + spread * spread
    scale = (square + 1.5 * spread * spread) / (8 * np.pi * square * square * np.sqrt(square))
    return times(scale, cross(torque, away))


@compiled
def _in_body(motion: Motion, v: Vector) -> Vector:
    """Components in the body frame of a vector in a lane's."""
    return dot(motion.e_x, v), dot(motion.e_y, v), v[2]


@compiled
def _in_lane(motion: Motion, v: Vector) -> Vector:
    return plus(plus(times(v[0], motion.e_x), times(v[1], motion.e_y)), times(v[2], E_Z))


@compiled
def _put_row(a: Array, i: int, v: Vector) -> None:
    a[i, 0], a[i, 1], a[i, 2] = v


class _Sources(NamedTuple):
    """Straight pieces, S of them; the head's come last."""

    start: Array  # (S, 3)
    end: Array  # (S, 3)
    load: Array  # (S, 3) force on the fluid
    owner: Array  # (S,) tail, or N for the head


@compiled
def _add_flow(
    body: Body, places: Array, owner: Array, targets: Array, sources: _Sources, active: Array, flow: Array
) -> None:
    """Add to `flow` (T, 3) at the places of `targets` what the forces of `active` sources bring about."""
    beyond = body.beyond
    height = HEIGHT * max(body.offset, beyond.head_radius)
    head = owner[len(owner) - 1]
    for i in targets:
        at = entry(places, i)
        total = (0.0, 0.0, 0.0)
        for j in active:
            by = sources.owner[j]
            spread = beyond.head_radius if by == head else beyond.tail_radius
            share, mirrored = _shares(body, owner[i], by, head)
            start, end, load = entry(sources.start, j), entry(sources.end, j), entry(sources.load, j)
            if share != 0:
                total = plus(total, times(share, stokeslets(at, start, end, load, spread)))
            if mirrored != 0:
                start = (start[0], 2 * height - start[1], start[2])
                end = (end[0], 2 * height - end[1], end[2])
                image = (load[0], -load[1], load[2])
                total = plus(total, times(mirrored, stokeslets(at, start, end, image, spread)))
        _put_row(flow, i, plus(entry(flow, i), total))


@compiled
def _shares(body: Body, on: float, by: float, head: float) -> tuple[float, float]:
    """Shares of the flow of one part that another meets: directly, and from the surface."""
    beyond = body.beyond
    if on == by:
        return 0.0, 0.0 if on == head else beyond.surface_flow
    share = beyond.head_flow if on == head or by == head else beyond.tail_flow
    return share, share * beyond.surface_flow


@compiled
def _head_resistance(body: Body, across_axis: bool) -> float:
    """The part of the head's drag that moves the fluid: at most what its pieces alone would need to go along with
    the flow that they make."""
    length = body.beyond.head_length
    unit = (1.0, 0.0, 0.0) if across_axis else E_Z
    flow = 0.0
    for i in range(_PIECES):
        at = (0.0, 0.0, (i + 0.5) / _PIECES * length)
        flow += dot(unit, stokeslets(at, (0.0, 0.0, 0.0), (0.0, 0.0, length), unit, body.beyond.head_radius))
    return float(min(_PIECES / flow, body.resistance[0, 0] if across_axis else body.resistance[1, 1]))


@compiled
def _add_swirl(body: Body, places: Array, nodes: int, torque: float, flow: Array) -> None:
    """Add to `flow` at the tails' nodes what the head's spin brings about."""
    beyond = body.beyond
    height = HEIGHT * max(body.offset, beyond.head_radius)
    for i in range(nodes):
        for j in range(_PIECES):
            away = minus(entry(places, i), entry(places, nodes + j))
            mirrored = (away[0], away[1] + 2 * entry(places, nodes + j)[1] - 2 * height, away[2])
            direct = rotlet(away, (0.0, 0.0, torque / _PIECES), beyond.head_radius)
            back = rotlet(mirrored, (0.0, 0.0, -torque / _PIECES), beyond.head_radius)
            total = times(beyond.head_flow, plus(direct, times(beyond.surface_flow, back)))
            _put_row(flow, i, plus(entry(flow, i), total))


@compiled
def add_flow(
    body: Body, geometry: Geometry, x: Array, u: Array, phase: float, first: int, tails: int,
    flow: Array, wrench: Array,
) -> None:  # fmt: skip
    """The fluid's velocity around a robot at one instant.

    Args:
        x: free nodes, (n, M, 3); tail j is the lane first + j M/N, at phase φ + 2πj/N.
        u: (v_x, v_z, ω_yr, ω_h), (4,).
        phase: φ.
        flow: (n + 1, M, 3), filled in the robot's lanes, each in its own frame.
        wrench: (4,), on the robot about J through its head; added to.
    """
    n, lanes, _ = x.shape
    nodes, edges = (n + 1) * tails, n * tails
    places, owner = np.zeros((nodes + _PIECES, 3)), np.full(nodes + _PIECES, tails)
    moved = np.zeros((nodes + _PIECES, 3))  # by free nodes and the head's spin
    answer = np.zeros((nodes + _PIECES, 3))  # by clamps and head
    # Edges under the forces of free nodes, first edges under those of the clamps, the head's pieces.
    count = edges + tails + _PIECES
    sources = _Sources(np.zeros((count, 3)), np.zeros((count, 3)), np.zeros((count, 3)), np.full(count, tails))
    cell = 1.0 / n
    for j in range(tails):
        m = first + j * (lanes // tails)
        motion = motion_at(body, u, phase + 2 * np.pi * j / tails)
        owner[j * (n + 1) : (j + 1) * (n + 1)] = j
        place = _in_body(motion, (body.offset, 0.0, 0.0))
        _put_row(places, j * (n + 1), place)
        for k in range(n):
            force = times(0.5 * cell if k == n - 1 else cell, motion.load)
            force = minus(force, vector(geometry.force, k, m))
            if k < n - 1:
                force = times(0.5, plus(force, vector(geometry.force, k + 1, m)))
            force = _in_body(motion, force)
            i = j * n + k
            _put_row(sources.start, i, place)
            place = _in_body(motion, vector(x, k, m))
            _put_row(places, j * (n + 1) + k + 1, place)
            _put_row(sources.end, i, place)
            sources.owner[i] = j
            _put_row(sources.load, i, plus(entry(sources.load, i), force))
            if k < n - 1:
                _put_row(sources.load, i + 1, force)
        sources.start[edges + j] = sources.start[j * n]
        sources.end[edges + j] = sources.end[j * n]
        sources.owner[edges + j] = j
    omega_t = body.omega + body.gain * u[3]
    on_fluid = np.zeros(4)  # by the head, if the fluid were at rest
    for a in range(4):
        on_fluid[a] = body.resistance[a, 4] * omega_t
        for c in range(4):
            on_fluid[a] += body.resistance[a, c] * u[c]
    across, along = _head_resistance(body, across_axis=True), _head_resistance(body, across_axis=False)
    on_fluid[0] *= across / body.resistance[0, 0]
    on_fluid[1] *= along / body.resistance[1, 1]
    piece = body.beyond.head_length / _PIECES
    for i in range(_PIECES):
        places[nodes + i, 2] = (i + 0.5) * piece
        sources.start[edges + tails + i, 2] = i * piece
        sources.end[edges + tails + i, 2] = (i + 1) * piece
    everywhere, free, given = np.arange(nodes + _PIECES), np.arange(edges), np.arange(edges, count)
    fixed = np.concatenate((np.arange(tails) * (n + 1), np.arange(nodes, nodes + _PIECES)))
    _add_flow(body, places, owner, everywhere, sources, free, moved)
    _add_swirl(body, places, nodes, body.resistance[3, 3] * u[3], moved)
    for _ in range(_ROUNDS):
        for j in range(tails):
            motion = motion_at(body, u, phase + 2 * np.pi * j / tails)
            i, m = fixed[j], first + j * (lanes // tails)
            tangent, _ = node_tangent(geometry, 0, m)
            velocity = plus(motion.linear, cross(motion.spin, (body.offset, 0.0, 0.0)))
            velocity = minus(velocity, _in_lane(motion, plus(entry(moved, i), entry(answer, i))))
            perp, excess = 0.5 * cell * body.zeta_perp, 0.5 * cell * (body.zeta_parallel - body.zeta_perp)
            _put_row(
                sources.load, edges + j, _in_body(motion, times(-1.0, node_drag(tangent, velocity, perp, excess)))
            )
        for i in range(_PIECES):
            at = nodes + i
            sources.load[edges + tails + i, 0] = (on_fluid[0] - across * (moved[at, 0] + answer[at, 0])) / _PIECES
            sources.load[edges + tails + i, 2] = (on_fluid[1] - along * (moved[at, 2] + answer[at, 2])) / _PIECES
        answer[:] = 0.0
        _add_flow(body, places, owner, fixed, sources, given, answer)
    answer[:] = 0.0
    _add_flow(body, places, owner, everywhere, sources, given, answer)
    moved += answer
    for j in range(tails):
        motion = motion_at(body, u, phase + 2 * np.pi * j / tails)
        m = first + j * (lanes // tails)
        for k in range(n + 1):
            put(flow, k, m, _in_lane(motion, entry(moved, j * (n + 1) + k)))
    for i in range(nodes, nodes + _PIECES):
        wrench[0] += across * moved[i, 0] / _PIECES
        wrench[1] += along * moved[i, 2] / _PIECES
        wrench[2] += across * moved[i, 0] / _PIECES * body.beyond.head_length / 2
