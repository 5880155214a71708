"""Growth of small perturbations of steady motions: agreement with time steps, and how often they grow.

Perturbed robots are stepped in time beside unperturbed ones on the same mesh (`tests.oracles.stepped_growth`):
robots of the sweep, robots of the wide domain of `robustness` that yaw fast, and robots with effects on their
tails. A table counts the robots of `robustness` with N ≥ 2 whose orbit is unstable.

Usage: python -m benchmarks stability [ROBOTS]

Takes 2 minutes.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from benchmarks.simulator.robustness import robots
from benchmarks.simulator.speed import sweep
from sim.inputs import check_columns
from sim.model.groups import Groups
from sim.model.presets import PRESETS
from sim.motion.batches import one_thread
from sim.motion.stability import growths, growths_on_mesh
from sim.motion.steady import orbits
from sim.solve.assembly import bodies, row
from sim.solve.refinement import MESHES, PHASES, SOLVED, refined_orbit
from tests.oracles.stepped_growth import stepped_growth

_FOLLOWED = 7.0  # natural logarithm of the change that is followed in time
_MOST_REVOLUTIONS = 60
_YAWS = (0.0, 0.25, 0.4, 0.5, 0.6, 0.8, np.inf)  # limits of |ω_yr/ω_t| in the table
_QUICK = 0.5  # |ω_yr/ω_t| of robots that yaw fast
_EFFECTS = {
    "natural_curvature": (0.5, 1.5),
    "natural_twist": (1.0, 3.0),
    "tail_interaction": (0.5, 1.0),
    "shear_thinning": (0.3,),
    "rate_dependent_modulus": (0.1,),
}


def with_effects(base: Groups, name: str, size: float) -> Groups:
    """Return the robots of `base` with one effect."""
    return Groups(**{**vars(base), "effects": {name: np.full(len(base), size)}})


def groups_of(columns: dict[str, np.ndarray], row: int) -> Groups:
    """Return one robot of a table."""
    return Groups.from_columns(check_columns({name: values[row : row + 1] for name, values in columns.items()}))


def kinds(count: int) -> Iterator[tuple[str, list[Groups]]]:
    """Yield what the robots are, and the robots."""
    inside, wide = sweep(count), robots(4096)
    inside.pop("T_bar", None)
    yield "sweep", [groups_of(inside, i) for i in range(count)]
    quick: list[Groups] = []
    for i in np.flatnonzero(wide["N"] > 1).tolist():
        if len(quick) < count:
            groups = groups_of(wide, i)
            motion = orbits(groups)
            if abs(motion.omega_yr[0]) > _QUICK * abs(motion.omega_t[0]):
                quick.append(groups)
    yield f"|ω_yr/ω_t| > {_QUICK}", quick
    control = PRESETS["paper-control"].groups()
    yield (
        "effects on the tails",
        [with_effects(control, name, size) for name, sizes in _EFFECTS.items() for size in sizes],
    )


def agreement(title: str, selected: list[Groups]) -> None:
    """Print how far the growths are from those of time steps, on the same mesh."""
    away, seen = [], []
    for groups in selected:
        body = bodies(groups)[0]
        orbit = refined_orbit(body, groups.N, PHASES)
        if orbit.status != SOLVED:
            continue
        final = growths(row(body), groups.N, [orbit])[0]
        coarse = growths_on_mesh(row(body), groups.N, orbit.x[1][None], orbit.u[1][None])[0]
        edges = MESHES[1] if final == coarse else MESHES[2]
        revolutions = min(_FOLLOWED / abs(final), _MOST_REVOLUTIONS)
        measured = stepped_growth(body, groups.N, revolutions, edges=edges)
        away.append(abs(final - measured) / max(abs(measured), 0.1))
        seen.append(final)
    share = 100 * np.array(away)
    print(
        f"  {title:22} {len(seen):3} robots, growth {min(seen):.3g} to {max(seen):.3g}, "
        f"{sum(g > 0 for g in seen)} unstable; off by {np.median(share):.1f} % at the median, "
        f"{np.max(share):.1f} % at most"
    )


def domain() -> None:
    """Print how many orbits of the wide domain are unstable, by how fast the robot yaws."""
    wide, rows = robots(4096), []
    for tails in np.unique(wide["N"][wide["N"] > 1]):
        groups = Groups.from_columns({name: values[wide["N"] == tails] for name, values in wide.items()})
        motion = orbits(groups, stability=True)
        yaws = np.abs(motion.omega_yr / motion.omega_t)
        rows.append(np.column_stack([yaws, motion.growth])[motion.converged])
    yaws, grows = np.concatenate(rows).T
    for low, high in pairwise(_YAWS):
        inside = (low <= yaws) & (yaws < high)
        print(
            f"  |ω_yr/ω_t| from {low} to {high}: {inside.sum()} robots, {(grows[inside] > 0).sum()} unstable, "
            f"{np.isnan(grows[inside]).sum()} unknown, largest growth {np.nanmax(grows[inside]):.3f}"
        )


def main(count: str = "24") -> None:
    with one_thread(), np.errstate(all="ignore"):
        print("\ngrowth of small perturbations in a motor revolution, against time steps on the same mesh")
        for title, some in kinds(int(count)):
            agreement(title, some)
        print("\norbits of the wide domain, N ≥ 2")
        domain()
