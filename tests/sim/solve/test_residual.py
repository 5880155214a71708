"""The residual depends on the robot alone, not on what the arrays that it is evaluated in held before."""

from __future__ import annotations

import numpy as np
import pytest

from sim.effects import catalogue
from sim.mechanics.balance import motion_at
from sim.mechanics.flow import add_flow
from sim.mechanics.frames import add_frames
from sim.mechanics.geometry import measure, new_geometry
from sim.solve.orbit import FIRST_PHASE, straight_start
from sim.solve.rates import on_orbit
from sim.solve.residual import Room, fill_residual, new_room
from tests.sim.robots import control, first_body

NONLOCAL = tuple(name for name, effect in catalogue().items() if effect.reach == "nonlocal")


def bent(effects: dict[str, float]) -> tuple:  # type: ignore[type-arg]
    """Make a robot with bent tails: its numbers, x (n, M, 3) and u (P, 4)."""
    body = first_body(control(N=2, **effects))
    x, u = straight_start(body, 5, 6, 2)
    rng = np.random.default_rng(4)
    return body, x + 0.02 * rng.normal(size=x.shape), u + 0.1 * rng.normal(size=u.shape)


def residual_in(room: Room, body: object, x: np.ndarray, u: np.ndarray) -> np.ndarray:
    """Return all entries of the residual on an orbit, evaluated in `room`."""
    r, t = np.empty_like(x), np.empty_like(u)
    fill_residual(body, on_orbit(x.shape[1], FIRST_PHASE), x, u, room, r, t)  # type: ignore[arg-type]
    return np.concatenate([r.ravel(), t.ravel()])


@pytest.mark.parametrize("name", ["none", *NONLOCAL])
def test_a_used_room_gives_the_residual_of_a_new_one(name: str) -> None:
    """The moments of the clamps were those of the evaluation before, where no effect overwrote them."""
    effects = {} if name == "none" else {name: catalogue()[name].typical}
    body, x, u = bent(effects)
    expected = residual_in(new_room(x, u), body, x, u)
    used = new_room(x, u)
    for values in (*used.around, used.x_dot, used.by_spin):
        values[:] = np.random.default_rng(5).normal(size=values.shape)
    assert residual_in(used, body, x, u).tobytes() == expected.tobytes()
    assert residual_in(used, body, x, u).tobytes() == expected.tobytes()


def test_effects_add_to_what_the_effects_before_them_made() -> None:
    body, x, u = bent({"natural_splay": 1.0, "tail_interaction": 1.0})
    room, zero = new_room(x, u), new_room(x, u)
    room.around.moment[:], room.around.flow[:] = 0.5, 0.25
    for around in (room.around, zero.around):
        geometry = new_geometry(x, *x.shape[:2])
        measure(geometry, x, body.offset, body.axial_stiffness)
        for m in range(x.shape[1]):
            add_frames(body, geometry, motion_at(body, u[0], 0.3), m, room.x_dot, around.moment)
        for p in range(len(u)):
            add_flow(body, geometry, x, u[p], 0.3, p, 2, around.flow, around.wrench[p])
    assert np.abs(zero.around.moment).max() > 0 < np.abs(zero.around.flow).max()
    assert room.around.moment == pytest.approx(zero.around.moment + 0.5, abs=1e-12)
    assert room.around.flow == pytest.approx(zero.around.flow + 0.25, abs=1e-12)
