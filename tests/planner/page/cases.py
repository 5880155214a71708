"""Paths and drifts by which the core is compared with Python."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np

from planner.paths.nearest_feasible import nearest_path
from planner.paths.path import Path2D, circle, polygon
from planner.paths.tractrix import STILL, Drift, Reference
from planner.planning.feasible import Feasibility
from planner.vehicle.vehicle import Vehicle
from sim.model.presets import PRESETS
from tests.planner.page.robots import vehicle_to_page
from tests.planner.vehicles import vehicle

_RNG = np.random.default_rng(24)
_TURN = np.linspace(0.0, 2 * np.pi, 400, endpoint=False)


def eight(size: float) -> Path2D:
    """Make a figure of eight."""
    return Path2D.of(size * np.stack([np.sin(_TURN), np.sin(2 * _TURN) / 2], 1), closed=True)


def wave(length: float, height: float) -> Path2D:
    """Make an open wave of three periods."""
    x = np.linspace(0.0, length, 300)
    return Path2D.of(np.stack([x, height * np.sin(6 * np.pi * x / length)], 1))


def noisy_stroke(noise: float = 0.01) -> Path2D:
    """Make an open stroke as a hand draws it."""
    t = np.linspace(0.0, 1.0, 150)
    clean = np.stack([6 * t, 2 * np.sin(4 * t) + t**2], 1)
    return Path2D.of(clean + noise * _RNG.normal(size=clean.shape))


def random_stroke(seed: int) -> Path2D:
    """Make a random smooth stroke, open or closed."""
    rng = np.random.default_rng(seed)
    t = np.linspace(0.0, 2 * np.pi, 200, endpoint=False)
    closed = bool(rng.integers(2))
    t = t if closed else t / 2
    terms = [rng.normal(size=(2, 2)) / k for k in range(1, 5)]
    points = sum(np.outer(np.cos(k * t), a) + np.outer(np.sin(k * t), b) for k, (a, b) in enumerate(terms, 1))
    return Path2D.of(rng.uniform(1.5, 4.0) * np.asarray(points), closed=closed)


PATHS = {
    "circle": circle(2.0),
    "square": polygon(4, 3.0),
    "triangle": polygon(3, 4.0),
    "eight": eight(3.0),
    "wave": wave(9.0, 0.8),
    "stroke": noisy_stroke(),
    "bend": Path2D.of([[0, 0], [3, 0], [3, 4]]),
    "line": Path2D.of([[0, 0], [5, 1]]),
    "star": polygon(5, 3.0),
    **{f"random {seed}": random_stroke(seed) for seed in range(4)},
}


@cache
def rounded(name: str, rod: float) -> Path2D:
    """Find a path near one of PATHS that turns gently."""
    return nearest_path(PATHS[name], rod, 0.8)


DRIFTS = {"still": STILL, "sideways": Drift(0.15), "current": Drift(-0.05, (0.1, -0.2))}


def drift_to_page(drift: Drift) -> dict[str, Any]:
    """Write a drift as the core has it."""
    return {"sideways": drift.sideways, "current": drift.current}


ROBOT = PRESETS["paper-control"]
PAGE_ROBOT = {"tailLength": ROBOT.tail_length, "timeScale": ROBOT.time_scale}
VEHICLES = {
    "symmetric": vehicle(),
    "biased": vehicle(bias=0.1),
    "without lags": vehicle(lag=0.0),
    "with a long memory": vehicle(memory=3.0),
    "in a current": replace(vehicle(), current=np.array([0.002, -0.003])),
}


def reference_to_page(reference: Reference) -> dict[str, Any]:
    """Write a reference as the core has it."""
    names = ("p", "q", "heading", "arc", "curvature", "closed")
    return {name: getattr(reference, name) for name in names}


def feasibility_of(car: Vehicle, corner: str, **options: Any) -> tuple[Feasibility, dict[str, Any]]:
    """Return what decides whether a path can be followed, as Python and as the core have it."""
    fields = {"rod": car.pivot_distance, "drift": STILL, "time_weight": 0.0, **options}
    feasibility = Feasibility(ROBOT, car, fields["rod"], fields["drift"], corner, fields["time_weight"])  # type: ignore[arg-type]
    page = {
        "robot": PAGE_ROBOT, "vehicle": vehicle_to_page(car), "rod": fields["rod"],
        "drift": drift_to_page(fields["drift"]), "corner": corner, "timeWeight": fields["time_weight"],
    }  # fmt: skip
    return feasibility, page
