"""One clamped rotating filament: PyElastica with local anisotropic drag, added through its own hooks.

Needs the package pyelastica (pip install -e '.[bench]'); it is not needed for anything else.
The rod is that of tests/reference/cases.py (FILAMENT): a = 16 mm, l = 0.11 m, r0 = 3.2 mm, E = 1.2 MPa, in
1.49 Pa s. PyElastica integrates inertia explicitly; the density of the real tails is used.
"""

from __future__ import annotations

import time
from typing import Any

import elastica
import numpy as np
from numba import njit

OFFSET, LENGTH, RADIUS, MODULUS, VISCOSITY, DENSITY = 0.016, 0.11, 3.2e-3, 1.2e6, 1.49, 1000.0


@njit(cache=True)
def _drag(x: Any, v: Any, parallel: float, perp: float) -> Any:
    """Compute the resistive force on every node, (3, n + 1): Voronoi lengths and mean tangents."""
    n = x.shape[1] - 1
    force = np.zeros_like(x)
    for k in range(n + 1):
        tangent, voronoi = np.zeros(3), 0.0
        for a, b in ((k - 1, k), (k, k + 1)):
            if a >= 0 and b <= n:
                edge = x[:, b] - x[:, a]
                length = np.sqrt((edge**2).sum())
                tangent += edge / length
                voronoi += length / 2
        tangent /= np.sqrt((tangent**2).sum())
        axial_speed = (v[:, k] * tangent).sum()
        force[:, k] = -voronoi * (perp * v[:, k] + (parallel - perp) * axial_speed * tangent)
    return force


class _AnisotropicDrag(elastica.NoForces):  # type: ignore[misc]
    def __init__(self, parallel: float, perp: float):
        super().__init__()
        self.coefficients = (parallel, perp)

    def apply_forces(self, system: Any, time: float = 0.0) -> None:
        system.external_forces += _drag(system.position_collection, system.velocity_collection, *self.coefficients)


class _RotatingClamp(elastica.ConstraintBase):  # type: ignore[misc]
    def __init__(self, *args: Any, omega: float, **words: Any):
        super().__init__(*args, **words)
        self.omega = omega
        self.first: Any = None

    def constrain_values(self, system: Any, time: float) -> None:
        cos, sin = np.cos(self.omega * time), np.sin(self.omega * time)
        if self.first is None:
            self.first = system.director_collection[:, :, 0].copy()
        system.position_collection[:, 0] = (OFFSET * cos, OFFSET * sin, 0.0)
        system.director_collection[:, :, 0] = self.first @ np.array([[cos, sin, 0], [-sin, cos, 0], [0, 0, 1.0]])

    def constrain_rates(self, system: Any, time: float) -> None:
        cos, sin = np.cos(self.omega * time), np.sin(self.omega * time)
        system.velocity_collection[:, 0] = (-OFFSET * self.omega * sin, OFFSET * self.omega * cos, 0.0)
        spin = np.array([0.0, 0.0, self.omega])
        system.omega_collection[:, 0] = system.director_collection[:, :, 0] @ spin


class _Simulator(elastica.BaseSystemCollection, elastica.Constraints, elastica.Forcing):  # type: ignore[misc]
    pass


def filament(omega: float, *, elements: int, step: float, seconds: float) -> tuple[float, float, float]:
    """Compute |thrust| [N], |moment| [N m] of the fluid at the end, and seconds of work for a simulated second."""
    slender = np.log(LENGTH / RADIUS)
    parallel, perp = 2 * np.pi * VISCOSITY / (slender - 0.5), 4 * np.pi * VISCOSITY / (slender + 0.5)
    rod = elastica.CosseratRod.straight_rod(
        elements, np.array([OFFSET, 0.0, 0.0]), np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 0.0]),
        LENGTH, RADIUS, DENSITY, youngs_modulus=MODULUS, shear_modulus=MODULUS / 3,
    )  # fmt: skip
    simulator = _Simulator()
    simulator.append(rod)
    clamp = simulator.constrain(rod)
    clamp.using(_RotatingClamp, constrained_position_idx=(0,), constrained_director_idx=(0,), omega=omega)
    simulator.add_forcing_to(rod).using(_AnisotropicDrag, parallel, perp)
    simulator.finalize()
    stepper, now = elastica.PositionVerlet(), np.float64(0.0)
    for _ in range(20):  # compile
        now = stepper.step(simulator, now, step)
    count = round(seconds / step)
    began = time.perf_counter()
    for _ in range(count):
        now = stepper.step(simulator, now, step)
    spent = time.perf_counter() - began
    force = _drag(rod.position_collection, rod.velocity_collection, parallel, perp)
    moment = rod.position_collection[0] * force[1] - rod.position_collection[1] * force[0]
    return abs(float(force[2].sum())), abs(float(moment.sum())), spent / seconds
