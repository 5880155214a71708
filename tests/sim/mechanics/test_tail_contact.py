"""Contact between tails: the gap, and forces without net wrench, from an energy, by the stated law."""

from __future__ import annotations

import math

import numpy as np
import pytest

from sim.mechanics.geometry import straight
from sim.mechanics.tail_contact import FIRM, SOFTNESS, contact_forces, tail_gap
from sim.model.body import Body
from tests.sim.robots import CONTROL_VALUES, control, first_body

EDGES = 8


def bundle(tails: int, seed: int) -> tuple[Body, np.ndarray]:
    """Make a robot whose tails lean towards the axis and twist about each other; free nodes (n, N, 3)."""
    body = first_body(control(N=tails, tail_contact=0.5))
    random = np.random.default_rng(seed)
    x = straight(EDGES, tails, body.offset)
    along = -x[:, :, 2]
    angle, near = 2.0 * along**2, 1 - (1 - along) ** 4
    radius = body.offset * (1 - near) + body.tail_radius / np.sin(np.pi / tails) * near
    x[:, :, 0], x[:, :, 1] = radius * np.cos(angle), radius * np.sin(angle)
    return body, x + 2e-3 * random.normal(size=x.shape)


def forces(body: Body, x: np.ndarray) -> np.ndarray:
    """Compute contact forces on nodes 0..n of tails x (n, N, 3), in the frame of each tail, (n + 1, N, 3)."""
    out = np.full((len(x) + 1, *x.shape[1:]), np.nan)
    contact_forces(body, x, 0, x.shape[1], out)
    return out


def together(vectors: np.ndarray) -> np.ndarray:
    """Turn vectors (K, N, 3) from the frames of their tails into the frame of tail 0."""
    turn = 2 * np.pi * np.arange(vectors.shape[1]) / vectors.shape[1]
    out = vectors.copy()
    out[:, :, 0] = np.cos(turn) * vectors[:, :, 0] - np.sin(turn) * vectors[:, :, 1]
    out[:, :, 1] = np.sin(turn) * vectors[:, :, 0] + np.cos(turn) * vectors[:, :, 1]
    return out


@pytest.mark.parametrize("tails", [2, 3, 4, 5])
def test_total_force_and_moment_are_zero(tails: int) -> None:
    body, x = bundle(tails, tails)
    root = np.zeros((1, tails, 3))
    root[:, :, 0] = body.offset
    force, place = together(forces(body, x)), together(np.concatenate([root, x]))
    scale = np.abs(force).sum()
    assert scale > 0.1
    assert np.abs(force.sum((0, 1))).max() < 1e-13 * scale
    assert np.abs(np.cross(place, force).sum((0, 1))).max() < 1e-13 * scale


def test_forces_come_from_an_energy() -> None:
    """Their derivative in the positions is symmetric."""
    body, x = bundle(2, 1)
    step, count = 1e-7, x.size
    slopes = np.empty((count, count))
    for i in range(count):
        ends = []
        for sign in (-1, 1):
            moved = x.copy()
            moved.reshape(-1)[i] += sign * step
            ends.append(forces(body, moved)[1:].reshape(-1))
        slopes[:, i] = (ends[1] - ends[0]) / (2 * step)
    assert np.abs(slopes).max() > 10
    assert np.abs(slopes - slopes.T).max() < 1e-5 * np.abs(slopes).max()


@pytest.mark.parametrize("gap", [0.97, 0.99, 1.0, 1.01])
def test_parallel_tails_repel_by_the_law(gap: float) -> None:
    """Straight tails at a distance: the force per length, away from each other; nothing beyond a tenth more."""
    body = first_body(control(N=2, tail_contact=0.5))
    body = body._replace(offset=gap * body.tail_radius)
    force = forces(body, straight(EDGES, 2, body.offset))
    law = body.nonlocal_terms.tail_contact * SOFTNESS / FIRM * np.log1p(np.exp((1 - gap) / SOFTNESS))
    middle = slice(3, -3)  # at its ends the other tail ends, too
    assert force[middle, :, 0] * EDGES == pytest.approx(np.full((3, 2), law), rel=1e-6)
    assert np.abs(force[middle, :, 1:]).max() < 1e-9 * law
    assert force[:, :, 0].sum() == pytest.approx(2 * law, rel=0.05)
    apart = body._replace(offset=1.11 * body.tail_radius)
    assert not forces(apart, straight(EDGES, 2, apart.offset)).any()


def test_the_gap_of_straight_tails() -> None:
    offset, radius = 1 / CONTROL_VALUES["l_over_R"], 1 / CONTROL_VALUES["l_over_r0"]
    tails = straight(EDGES, 4, offset)
    assert tail_gap(tails, offset, radius) == pytest.approx(math.sqrt(2) * offset / (2 * radius), rel=1e-12)
    assert math.isinf(tail_gap(tails[:, :1].copy(), offset, radius))
