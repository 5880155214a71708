"""The worked effect of docs/howto/effect.md: its formula against its energy, and its declaration."""

from __future__ import annotations

from collections import namedtuple
from importlib.util import module_from_spec, spec_from_file_location
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from sim.mechanics.geometry import inverse_voronoi, measure, new_geometry, straight
from tests.docs.pages import DOCS
from tests.sim.robots import control, first_body

EDGES, SIZE, STEP = 6, 0.4, 1e-6


def example(name: str) -> ModuleType:
    """Import the module that the page tells its reader to write."""
    spec = spec_from_file_location(name, DOCS / "howto" / "taper" / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def tapered() -> Any:
    """Make the control robot, as if the effect were in the catalogue."""
    return first_body(control())._replace(nonlocal_terms=namedtuple("Nonlocal", ["tail_taper"])(SIZE))


def energy(x: np.ndarray, offset: float) -> float:
    """Compute what the taper adds to the bending energy Σ ½ |κ|²/l, with |κ|² = 4 (1 − c)/(1 + c)."""
    nodes = np.concatenate([[[offset, 0.0, 1.0], [offset, 0.0, 0.0]], x[:, 0]])  # the first edge is the clamp
    tangents = np.diff(nodes, axis=0)
    tangents /= np.linalg.norm(tangents, axis=1, keepdims=True)
    c = (tangents[:-1] * tangents[1:]).sum(1)
    middles = np.array([0.25, *range(1, EDGES)]) / EDGES
    weights = [inverse_voronoi(k, EDGES) for k in range(EDGES)]
    return float((SIZE * (1 - 2 * middles) * np.array(weights) * 2 * (1 - c) / (1 + c)).sum())


def test_forces_and_moment_are_slopes_of_the_energy() -> None:
    body, geometry, moments = tapered(), new_geometry(np.empty(0), EDGES, 1), np.zeros((1, 3))
    x = straight(EDGES, 1, body.offset)
    x += 0.03 * np.random.default_rng(0).normal(size=x.shape)
    measure(geometry, x, body.offset, body.axial_stiffness)
    uniform = geometry.force.copy()
    example("add_taper").add_taper(body, geometry, 0, moments)
    forces = (geometry.force - uniform)[:, 0]
    for k in range(EDGES):
        for axis in range(3):  # edge k alone changes if all nodes from k on move
            moved = [x.copy(), x.copy()]
            for sign, nodes in zip((1, -1), moved, strict=True):
                nodes[k:, 0, axis] += sign * STEP
            slope = (energy(moved[0], body.offset) - energy(moved[1], body.offset)) / (2 * STEP)
            assert forces[k, axis] == pytest.approx(slope, rel=1e-6, abs=1e-8)
    # Turning the tail as a whole about its clamp by a small angle costs the clamp's spring alone.
    root = np.array([body.offset, 0.0, 0.0])
    for axis in range(3):
        turned = [x.copy(), x.copy()]
        for sign, nodes in zip((1, -1), turned, strict=True):
            nodes[:, 0] += sign * STEP * np.cross(np.eye(3)[axis], x[:, 0] - root)
        slope = (energy(turned[0], body.offset) - energy(turned[1], body.offset)) / (2 * STEP)
        assert moments[0, axis] == pytest.approx(slope, rel=1e-5, abs=1e-8)


def test_the_declaration_is_one_of_a_nonlocal_effect() -> None:
    effect = example("tail_taper").EFFECT
    assert effect.name == "tail_taper"
    assert effect.reach == "nonlocal"
    assert effect.bounds[0] < effect.null < effect.typical < effect.bounds[1]
