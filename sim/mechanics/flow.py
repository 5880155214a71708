"""Flow of the fluid around tails and head: each part is in the flow of the others, and of images in the surface.

A force f on the fluid at y moves the fluid at x with the velocity G(x − y) f/μ, where G is the Stokeslet. In
resistive force theory the drag on a node depends on its velocity relative to fluid at rest. Here it depends on the
velocity relative to the fluid that the other parts move:

    q_k = −l_k [ζ⊥ I + (ζ∥ − ζ⊥) tt] (v_k − w_k),   w_k = Σ ∫ G(x_k − y) f/μ ds.

The sum is over the edges of the other tails, over the head, and over images. The force of a node is spread evenly
over the edges beside it, and the integral over a straight edge is exact at any distance. The head is represented
by segments of its axis with equal parts of its drag, and rotlets for its spin. In balance, the force of a free
node on the fluid is its elastic force and load. So w follows from the shape. Only the velocities of clamps and
head are given, so their forces depend on each other's flow. They are found in a few rounds; each change is smaller
than the last one. The head's drag, too, is relative to the fluid that the tails move. All of this is solved
together with the balance, not one step later.

C_t is fitted and larger than that of a cylinder (about 1.4). With all of this drag on the fluid, the head would
move the fluid at the clamps faster than it moves itself. So only a part of the drag moves the fluid: at most the
drag with which the head's segments would move with the fluid on the axis. The rest of the drag has other causes.

Surface: a flat plane without shear and without flow through it, at a height of HEIGHT times the larger of R and a
above the axis. The image of f at (x, y, z) is (f_x, −f_y, f_z) at (x, 2H − y, z); the image of a spin about z
turns backwards. A tail is in the flow of its own image. It is in the flow of another part's image only if it is in
the flow of that part, because images of others alone would reduce the drag on a tail by more than all of it.

The singularities are spread over r0 (tails) and R (head), as in Cortez, Fauci and Medovikov (2005). Left out: the
effect of the tails' flow on the head's spin, and the thickness of the head (the flow goes through it).
Units: l, μ0 l⁴/EI, EI/l². Source: Pozrikidis (1992), ch. 2; images: Blake (1971), free surface.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from common.arrays import Floats, Integers
from sim.jit import borrowing, compiled, formula
from sim.linear.blocks import add, add_at, put_at, vector, vector_at
from sim.linear.vectors import E_Z, ZERO, Vector, cross, dot, minus, plus, times
from sim.mechanics.balance import TailMotion, head_drag, motion_at
from sim.mechanics.drag import node_drag
from sim.mechanics.geometry import Geometry, node_tangent
from sim.model.body import Body

HEIGHT = 1.25  # of the surface above the axis, in the larger of R and a
_SEGMENTS = 4  # of the head's axis
_ROUNDS = 3


class FlowScene(NamedTuple):
    """A robot at one instant in the body frame: places where the flow is computed, and segments that produce it.

    Places: nodes 0..n of each tail, then the midpoints of the head's segments. Segments: edges of the tails under
    the forces of free nodes, first edges under the drag of the clamps, then the head's segments.
    """

    place: Floats  # (K, 3)
    of: Integers  # (K,) tail of a place, or N for the head
    start: Floats  # (S, 3)
    end: Floats  # (S, 3)
    force: Floats  # (S, 3) on the fluid
    by: Integers  # (S,) tail of a segment, or N for the head


@compiled
def _new_scene(n: int, tails: int) -> FlowScene:
    places, segments = (n + 1) * tails + _SEGMENTS, (n + 1) * tails + _SEGMENTS
    return FlowScene(
        np.zeros((places, 3)),
        np.full(places, tails),
        np.zeros((segments, 3)),
        np.zeros((segments, 3)),
        np.zeros((segments, 3)),
        np.full(segments, tails),
    )


@borrowing
def has_flow(body: Body) -> bool:
    """Tell whether any part of the robot is in the flow of another part."""
    terms = body.nonlocal_terms
    return bool(terms.tail_interaction != 0 or terms.head_flow != 0 or terms.free_surface != 0)


@compiled
def add_flow(
    body: Body, geometry: Geometry, x: Floats, u: Floats, phase: float, instant: int, tails: int,
    flow: Floats, wrench: Floats,
) -> None:  # fmt: skip
    """Add the fluid's velocity around a robot at one instant.

    Args:
        x: free nodes, (n, M, 3); tail j at instant p of P is column p + j P, at phase φ + 2πj/N.
        u: (v_x, v_z, ω_yr, ω_h), (4,).
        phase: φ.
        flow: (n + 1, M, 3); added in the columns of this instant, each in the frame of its tail.
        wrench: (4,), about J; the effect of the flow on the head is added.
    """
    n, columns, _ = x.shape
    scene, instants = _new_scene(n, tails), columns // tails
    for j in range(tails):
        motion = motion_at(body, u, phase + 2 * np.pi * j / tails)
        _place_tail(scene, body, geometry, motion, x, j, instant + j * instants)
    _place_head(scene, body, n, tails)
    nodes, edges = (n + 1) * tails, n * tails
    moved = np.zeros_like(scene.place)
    everywhere = np.arange(len(scene.place))
    _add_stokeslets(body, scene, everywhere, np.arange(edges), moved)
    _add_rotlets(body, scene, nodes, body.resistance[3, 3] * u[3], moved)
    _answer(scene, body, geometry, u, phase, instant, tails, moved)
    _add_stokeslets(body, scene, everywhere, np.arange(edges, len(scene.by)), moved)
    for j in range(tails):
        motion = motion_at(body, u, phase + 2 * np.pi * j / tails)
        for k in range(n + 1):
            add(flow, k, instant + j * instants, _in_tail(motion, vector_at(moved, j * (n + 1) + k)))
    drag_across, drag_along = _head_resistance(body)
    for i in range(nodes, nodes + _SEGMENTS):
        wrench[0] += drag_across * moved[i, 0] / _SEGMENTS
        wrench[1] += drag_along * moved[i, 2] / _SEGMENTS
        wrench[2] += drag_across * moved[i, 0] / _SEGMENTS * body.head_length / 2


@compiled
def _place_tail(
    scene: FlowScene, body: Body, geometry: Geometry, motion: TailMotion, x: Floats, j: int, column: int
) -> None:
    """Place the nodes of tail j, and its edges under the forces of its free nodes."""
    n = x.shape[0]
    cell = 1.0 / n
    first_clamp = n * ((len(scene.by) - _SEGMENTS) // (n + 1))
    place = _in_body(motion, (body.offset, 0.0, 0.0))
    put_at(scene.place, j * (n + 1), place)
    for k in range(n + 1):
        scene.of[j * (n + 1) + k] = j
    for k in range(n):
        force = times(0.5 * cell if k == n - 1 else cell, motion.load)
        force = minus(force, vector(geometry.force, k, column))
        if k < n - 1:
            force = times(0.5, plus(force, vector(geometry.force, k + 1, column)))
        force = _in_body(motion, force)
        i = j * n + k
        put_at(scene.start, i, place)
        place = _in_body(motion, vector(x, k, column))
        put_at(scene.place, j * (n + 1) + k + 1, place)
        put_at(scene.end, i, place)
        scene.by[i] = j
        add_at(scene.force, i, force)
        if k < n - 1:
            put_at(scene.force, i + 1, force)
    put_at(scene.start, first_clamp + j, vector_at(scene.start, j * n))
    put_at(scene.end, first_clamp + j, vector_at(scene.end, j * n))
    scene.by[first_clamp + j] = j


@borrowing
def _place_head(scene: FlowScene, body: Body, n: int, tails: int) -> None:
    """Add the head's segments, which follow the nodes and edges of the tails."""
    first, length = (n + 1) * tails, body.head_length / _SEGMENTS
    for i in range(_SEGMENTS):
        scene.place[first + i, 2] = (i + 0.5) * length
        scene.start[first + i, 2] = i * length
        scene.end[first + i, 2] = (i + 1) * length


@compiled
def _answer(
    scene: FlowScene,
    body: Body,
    geometry: Geometry,
    u: Floats,
    phase: float,
    instant: int,
    tails: int,
    moved: Floats,
) -> None:
    """Find the forces on the fluid of clamps and head, whose velocities are given, in a fluid moving by `moved`.

    The forces depend on each other's flow. They are found in a few rounds; each change is smaller than the last
    one.
    """
    n, columns = geometry.length.shape
    nodes, first_clamp, cell = (n + 1) * tails, n * tails, 1.0 / n
    drag_across, drag_along = _head_resistance(body)
    share_x, share_z = drag_across / body.resistance[0, 0], drag_along / body.resistance[1, 1]
    push_x, push_z = share_x * head_drag(body, u, 0), share_z * head_drag(body, u, 1)  # if the fluid were at rest
    answering = np.arange(first_clamp, len(scene.by))
    fixed = np.concatenate((np.arange(tails) * (n + 1), np.arange(nodes, nodes + _SEGMENTS)))
    answer = np.zeros_like(moved)
    perp, excess = 0.5 * cell * body.zeta_perp, 0.5 * cell * (body.zeta_parallel - body.zeta_perp)
    for _ in range(_ROUNDS):
        for j in range(tails):
            motion = motion_at(body, u, phase + 2 * np.pi * j / tails)
            i = fixed[j]
            tangent, _ = node_tangent(geometry, 0, instant + j * (columns // tails))
            velocity = plus(motion.linear, cross(motion.spin, (body.offset, 0.0, 0.0)))
            velocity = minus(velocity, _in_tail(motion, plus(vector_at(moved, i), vector_at(answer, i))))
            drag = node_drag(tangent, velocity, perp, excess)
            put_at(scene.force, first_clamp + j, _in_body(motion, times(-1.0, drag)))
        for i in range(nodes, nodes + _SEGMENTS):
            scene.force[i, 0] = (push_x - drag_across * (moved[i, 0] + answer[i, 0])) / _SEGMENTS
            scene.force[i, 2] = (push_z - drag_along * (moved[i, 2] + answer[i, 2])) / _SEGMENTS
        answer[:] = 0.0
        _add_stokeslets(body, scene, fixed, answering, answer)


@borrowing
def _in_body(motion: TailMotion, v: Vector) -> Vector:
    """Convert a vector from a tail's frame to the body frame."""
    return dot(motion.e_x, v), dot(motion.e_y, v), v[2]


@borrowing
def _in_tail(motion: TailMotion, v: Vector) -> Vector:
    """Convert a vector from the body frame to a tail's frame."""
    return plus(plus(times(v[0], motion.e_x), times(v[1], motion.e_y)), times(v[2], E_Z))


@borrowing
def _add_stokeslets(body: Body, scene: FlowScene, places: Integers, segments: Integers, flow: Floats) -> None:
    """Add to `flow` (K, 3), at some places, the flow of the forces of some segments."""
    height = HEIGHT * max(body.offset, body.head_radius)
    head = scene.of[len(scene.of) - 1]
    for i in places:
        at = vector_at(scene.place, i)
        total = ZERO
        for j in segments:
            spread = body.head_radius if scene.by[j] == head else body.tail_radius
            share, mirrored = _shares(body, scene.of[i], scene.by[j], head)
            start, end, force = vector_at(scene.start, j), vector_at(scene.end, j), vector_at(scene.force, j)
            if share != 0:
                total = plus(total, times(share, stokeslets(at, start, end, force, spread)))
            if mirrored != 0:
                start = (start[0], 2 * height - start[1], start[2])
                end = (end[0], 2 * height - end[1], end[2])
                image = (force[0], -force[1], force[2])
                total = plus(total, times(mirrored, stokeslets(at, start, end, image, spread)))
        add_at(flow, i, times(1 / body.viscosity, total))


@borrowing
def _shares(body: Body, on: int, by: int, head: int) -> tuple[float, float]:
    """Return the factors on the flow of one part at another part: on the direct flow, and on that of the image."""
    terms = body.nonlocal_terms
    if on == by:
        return 0.0, 0.0 if on == head else terms.free_surface
    share = terms.head_flow if on == head or by == head else terms.tail_interaction
    return share, share * terms.free_surface


@borrowing
def _head_resistance(body: Body) -> tuple[float, float]:
    """Compute the part of the head's drag that moves the fluid, across and along the axis.

    It is at most the drag with which the head's segments would move with the flow that they produce.
    """
    end, across, along = (0.0, 0.0, body.head_length), 0.0, 0.0
    for i in range(_SEGMENTS):
        at = (0.0, 0.0, (i + 0.5) / _SEGMENTS * body.head_length)
        across += stokeslets(at, ZERO, end, (1.0, 0.0, 0.0), body.head_radius)[0]
        along += stokeslets(at, ZERO, end, E_Z, body.head_radius)[2]
    scale = _SEGMENTS * body.viscosity
    return min(scale / across, body.resistance[0, 0]), min(scale / along, body.resistance[1, 1])


@borrowing
def _add_rotlets(body: Body, scene: FlowScene, nodes: int, torque: float, flow: Floats) -> None:
    """Add to `flow`, at the tails' nodes, the flow of the head's spin."""
    terms = body.nonlocal_terms
    height = HEIGHT * max(body.offset, body.head_radius)
    for i in range(nodes):
        for j in range(_SEGMENTS):
            middle = vector_at(scene.place, nodes + j)
            away = minus(vector_at(scene.place, i), middle)
            mirrored = (away[0], away[1] + 2 * middle[1] - 2 * height, away[2])
            direct = rotlet(away, (0.0, 0.0, torque / _SEGMENTS), body.head_radius)
            back = rotlet(mirrored, (0.0, 0.0, -torque / _SEGMENTS), body.head_radius)
            total = times(terms.head_flow / body.viscosity, plus(direct, times(terms.free_surface, back)))
            add_at(flow, i, total)


@formula
def stokeslets(at: Vector, start: Vector, end: Vector, force: Vector, spread: float) -> Vector:
    """Compute the velocity at a point from a force that is constant on a straight segment, spread over a length.

    With σ along the segment from the foot of the perpendicular c, and R² = σ² + |c|² + spread²:
    ∫ [(1/R + spread²/R³) f + (r·f) r/R³] dσ/8π, r = c − σ t.
    """
    segment = minus(end, start)
    length = np.sqrt(dot(segment, segment))
    t = times(1 / length, segment)
    away = minus(at, start)
    foot = dot(away, t)
    c = minus(away, times(foot, t))
    square = dot(c, c) + spread * spread
    first, last = -foot, length - foot
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
    """Compute the velocity at a distance `away` from a torque on the fluid that is spread over a length."""
    square = dot(away, away) + spread * spread
    scale = (square + 1.5 * spread * spread) / (8 * np.pi * square * square * np.sqrt(square))
    return times(scale, cross(torque, away))
