"""Published numbers that nobody here made, against the formulas and solvers of the simulator.

One table in Markdown: what is compared, source, published number, ours, difference. Rods are solved with the rod,
the drag and the frames of `sim.mechanics` (`tests.oracles.clamped_rod`), on two meshes, extrapolated. A follower
load is no part of a robot: here it is added to the product's rod. Rigid helices have the drag of
`sim.mechanics.drag`, node by node, and once the flow of each segment at each other. Measured tables of others are
read if they are given: BALLS.csv of falling balls, and SPHERES.csv of beads in glycerine, as for
docs/models.

Usage: python -m benchmarks outside [BALLS.csv] [SPHERES.csv]

Takes 10 seconds.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import brentq, least_squares

from benchmarks.common import heading, row
from common.arrays import Floats
from sim.linear.vectors import Vector
from sim.mechanics.drag import node_resistance, tail_coefficients
from sim.mechanics.flow import stokeslets
from tests.oracles import falling_balls
from tests.oracles.clamped_rod import ClampedRod, dead_load
from tests.oracles.twirled_rod import whirling

_MESHES = (24, 48)  # edges; errors go as the square of an edge
_PIECES = 120  # of a helix with flow


class Compared(NamedTuple):
    """One row of the table."""

    what: str
    source: str
    published: tuple[float, ...]
    ours: Sequence[float]

    def line(self) -> str:
        """Write the row in Markdown."""
        pairs = list(zip(self.ours, self.published, strict=True))
        differences = ", ".join(f"{float(f'{100 * (ours / theirs - 1):.2g}'):+g}" for ours, theirs in pairs)
        ours, theirs = (", ".join(f"{value:.4g}" for value in values) for values in zip(*pairs, strict=True))
        return row(self.what, self.source, theirs, ours, f"{differences} %")


def extrapolated(of_edges: Callable[[int], Any]) -> Any:
    """Remove the error of second order from a value on two meshes."""
    coarse, fine = (np.asarray(of_edges(n)) for n in _MESHES)
    return (4 * fine - coarse) / 3


def rods() -> Iterator[Compared]:
    """Compare rods: shapes, buckling, and instabilities in a viscous fluid."""
    tip = extrapolated(
        lambda n: ClampedRod(n).balanced(dead_load(0, -39.24, 0), np.linspace(0.02, 1, 50).tolist())[-1]
    )
    heavy = "boundary-value problem θ'' = −α (1 − s) cos θ, α = w l³/EI = 39.24"
    yield Compared("heavy elastica: tip, over l", heavy, (0.2871, -0.8934), (abs(tip[2]), tip[1]))

    def buckles(n: int) -> float:
        return float(brentq(lambda w: ClampedRod(n).least_stiffness(dead_load(0, 0, w)), 6, 9))

    weight = float(extrapolated(buckles))
    yield Compared("weight that buckles a column, w l³/EI", "Greenhill (1881)", (7.837,), (weight,))

    def flutters(n: int) -> float:
        return float(brentq(lambda f: ClampedRod(n).growths(lambda t: -f * t).real.max(), 60, 90, xtol=1e-4))

    load, theory = (float(extrapolated(flutters)),), "resistive force theory"
    what = "follower load at which a clamped rod begins to swing, σ = f l³/EI"
    yield Compared(what, "SkellySim, `clamped_buckling`", (76.0,), load)
    yield Compared("…", f"{theory}: ζ⊥ λ h = −h'''' − σ (1 − s) h''", (76.1,), load)
    spin = extrapolated(whirling).tolist()
    what = "spin at which twirling becomes whirling, ω ξ_r l²/EI; frequency, χ ζ⊥ l⁴/EI"
    yield Compared(what, "Wolgemuth et al. (2000), Maxian et al. (2022)", (8.9, 22.9), spin)
    yield Compared("…", theory, (8.865, 22.85), spin)


def helix(along: Floats, pitch: float) -> Floats:
    """Return the points of a helix of radius 1 at axial places, (m, 3)."""
    phase = 2 * np.pi * along / pitch
    return np.stack([np.cos(phase), np.sin(phase), along], 1)


def helix_drag(pitch: float, length: float, wire: float) -> Floats:
    """Compute thrust by spin, torque by spin and drag by speed of a rigid helix, in μ and its radius, (3,).

    Args:
        pitch, length: along the axis.
        wire: radius of the wire.
    """
    along = np.linspace(0, length, 2001)
    points = helix((along[1:] + along[:-1]) / 2, pitch)
    pieces = np.diff(helix(along, pitch), axis=0)
    size = np.linalg.norm(pieces, axis=1)
    parallel, perp = tail_coefficients(size.sum() / wire)
    tangent = pieces.T / size
    drag: Floats = np.array(
        node_resistance((tangent[0], tangent[1], tangent[2]), size * perp, size * (parallel - perp))
    )
    spin = np.stack([-points[:, 1], points[:, 0], np.zeros(len(points))])
    turning = np.einsum("abm,bm->am", drag, spin)
    return np.array([abs(turning[2].sum()), (spin * turning).sum(), drag[2, 2].sum()])


def helix_with_flow(pitch: float, length: float, wire: float) -> Floats:
    """Compute the same with the flow of each of _PIECES segments at each other (slender-body theory)."""
    along = np.linspace(0.0, length, _PIECES + 1)
    nodes, middles = helix(along, pitch), helix((along[1:] + along[:-1]) / 2, pitch)
    mobility = np.empty((_PIECES, 3, _PIECES, 3))
    for j, (start, end) in enumerate(zip(_points(nodes[:-1]), _points(nodes[1:]), strict=True)):
        for i, place in enumerate(_points(middles)):
            for k, force in enumerate(_points(np.eye(3))):
                mobility[i, :, j, k] = stokeslets(place, start, end, force, np.sqrt(np.e) * wire)
    spin, push = np.zeros((2, _PIECES, 3))
    spin[:, 0], spin[:, 1], push[:, 2] = -middles[:, 1], middles[:, 0], 1.0
    matrix = mobility.reshape(3 * _PIECES, -1)
    turning, moving = (np.linalg.solve(matrix, v.ravel()).reshape(-1, 3) for v in (spin, push))
    return np.array([abs(turning[:, 2].sum()), (spin * turning).sum(), moving[:, 2].sum()])


def _points(array: Floats) -> list[Vector]:
    return [(x, y, z) for x, y, z in array.tolist()]


# Thrust/(μ Ω R²), torque/(μ Ω R³), drag/(μ U R) of helices by λ/R: R = 6.3, L = 130, wire 0.397 mm in radius.
RODENBORN = {
    2.226: (6.2644, 131.928, 52.059),
    3.677: (9.5977, 100.803, 46.961),
    6.509: (11.0345, 81.928, 39.412),
    9.811: (9.5690, 72.691, 35.294),
    15.241: (7.8448, 68.072, 34.118),
}
# E. coli: A of drag, B of coupling, D of spin of the flagella, with the filament's shape of Darnton et al. (2007).
CHATTOPADHYAY = (1.48e-8, 7.9e-16, 7.0e-22)  # N s/m, N s, N s m
_PITCH, _RADIUS, _CONTOUR, _FILAMENT, _WATER = 2.2e-6, 0.2e-6, 8.3e-6, 12e-9, 1e-3  # m, Pa s


def helices() -> Iterator[Compared]:
    """Compare rigid helices, of bacteria and of wire."""
    length = _CONTOUR / np.hypot(1, 2 * np.pi * _RADIUS / _PITCH)
    thrust, torque, drag = helix_drag(*(a / _RADIUS for a in (_PITCH, length, _FILAMENT)))
    ours = _WATER * np.array([drag * _RADIUS, thrust * _RADIUS**2, torque * _RADIUS**3])
    what = "flagella of E. coli as one filament: A, B, D, in SI units"
    yield Compared(what, "Chattopadhyay et al. (2006)", CHATTOPADHYAY, ours.tolist())
    for label, model in (("drag alone", helix_drag), ("with flow", helix_with_flow)):
        for pitch, measured in RODENBORN.items():
            what = f"helix, λ/R = {pitch:.1f}, {label}: thrust, torque, drag"
            found = model(pitch, 130 / 6.3, 0.397 / 6.3)
            yield Compared(what, "Rodenborn et al. (2013)", measured, found.tolist())


def falling(balls: str, spheres: str) -> Iterator[Compared]:
    """Compare drag coefficients that measured falls give with those of textbooks."""
    if balls:
        drag = _fitted(falling_balls.balls(balls), {"gravity": 9.81, "quadratic_drag": 0.4})[1]
        yield Compared("C_D of falling balls, one for all", "sphere at 10⁴ < Re < 10⁵, 0.47", (0.47,), (drag,))
    for name in ("KW2023", "ZK2026") if spheres else ():
        size = _fitted(falling_balls.spheres(spheres, name), {"viscosity": 1.0, "wall": 1.0})[1]
        yield Compared(f"beads in glycerine, {name}: size of the wall's correction", "Faxén, 1", (1.0,), (size,))


def _fitted(model: Any, start: dict[str, float]) -> Floats:
    """Fit parameters of a model of the calibration by least squares."""

    def residual(values: Floats) -> Floats:
        parameters = dict(zip(start, values.tolist(), strict=True))
        return np.asarray(model.predict([parameters])[0, :, 0] - model.runs.y[:, 0])

    return np.asarray(least_squares(residual, list(start.values())).x)


def main(balls: str = "", spheres: str = "") -> None:
    """Print the table."""
    print(heading("what", "source", "published", "here", "difference"))
    for part in (rods(), helices(), falling(balls, spheres)):
        for compared in part:
            print(compared.line(), flush=True)
