"""Robots for the simulator's tests."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from dataset.design import load_design
from sim.mechanics.balance import head_drag
from sim.model.body import Body
from sim.model.groups import Groups
from sim.model.presets import PRESETS
from sim.motion.stability import growths, growths_on_mesh
from sim.solve.assembly import bodies, row
from sim.solve.march import Marcher, State, equal_steps, side_by_side
from sim.solve.orbit import residuals_on_orbits, solve_orbits_in_place, straight_starts
from sim.solve.refinement import MESHES, OrbitOnMeshes, extrapolate

CONTROL_VALUES = PRESETS["paper-control"].group_values()


def control(count: int = 1, **changes: object) -> Groups:
    """Make `count` copies of the paper's control robot with changed columns (numbers or arrays)."""
    values = {**CONTROL_VALUES, **changes}
    return Groups.from_columns({k: np.broadcast_to(np.asarray(v, float), count).copy() for k, v in values.items()})


def first_body(groups: Groups) -> Body:
    """Assemble the first robot for the compiled loops."""
    return bodies(groups)[0]


def straight_start(body: Body, n: int, phases: int, tails: int) -> tuple[np.ndarray, np.ndarray]:
    """Guess x (n, M, 3) and u (P, 4) of one robot: straight tails."""
    x, u = straight_starts(row(body), n, phases, tails)
    return x[0], u[0]


def solve_orbit(body: Body, x: np.ndarray, u: np.ndarray, tolerance: float) -> float:
    """Improve the orbit x (n, M, 3), u (P, 4) of one robot in place; return the size of the last correction."""
    return float(solve_orbits_in_place(row(body), x[None], u[None], tolerance)[0])


def residual_on_orbit(body: Body, x: np.ndarray, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Compute the residual of one robot at x (n, M, 3), u (P, 4): r (n, M, 3) and t (P, 4)."""
    r, t, _ = residuals_on_orbits(row(body), x[None], u[None])
    return r[0], t[0]


def growth(body: Body, tails: int, x: np.ndarray, u: np.ndarray) -> float:
    """Compute the growth on an orbit x (n, M, 3), u (P, 4) of one robot."""
    return float(growths_on_mesh(row(body), tails, x[None], u[None])[0])


def growth_of_orbit(body: Body, tails: int, orbit: OrbitOnMeshes) -> float:
    """Compute the growth of one robot."""
    return float(growths(row(body), tails, [orbit])[0])


def mean_tail_wrench(body: Body, x: np.ndarray, u: np.ndarray) -> np.ndarray:
    """Return (F_x, F_z, M_y, M_z) of the tails on the disc about J, mean over the phases, (4,)."""
    _, t = residual_on_orbit(body, x, u)
    on_head = [[head_drag(body, now, a) for a in range(4)] for now in u]
    return np.asarray((t + np.array(on_head)).mean(0))


def held_loads(
    omega_bar: float, l_over_r0: float, offset: float, *, edges: int, **effects: float
) -> tuple[np.ndarray, np.ndarray]:
    """Average the wrench (F_x, F_z, M_y, M_z) of the fluid on a filament whose disc is held; nodes (n, 3), too."""
    body = held_filament(omega_bar, l_over_r0, offset, **effects)
    x, u = straight_start(body, edges, 2, 1)
    u[:] = 0.0
    size = solve_orbit(body, x, u, 1e-9)
    assert size < 1e-9
    return mean_tail_wrench(body, x, u), x[:, 0]


def extrapolated_loads(omega_bar: float, l_over_r0: float, offset: float, **effects: float) -> np.ndarray:
    """Compute the same at the default resolution: the direct route's meshes, extrapolated."""
    values = [held_loads(omega_bar, l_over_r0, offset, edges=n, **effects)[0] for n in MESHES]
    return extrapolate(np.array(values))


def held_filament(omega_bar: float, l_over_r0: float, offset: float, **effects: float) -> Body:
    """Assemble one filament at distance `offset` [l] from the axis of a disc that the motor alone turns."""
    offset *= CONTROL_VALUES["l_over_R"]
    body = first_body(control(1, N=1, omega_bar=omega_bar, l_over_r0=l_over_r0, a_over_R=offset, **effects))
    body.resistance[:, :4] += 1e9 * np.eye(4)
    return body


def sweep_points(count: int) -> dict[str, np.ndarray]:
    """Return the columns of the first `count` robots of sweep.toml."""
    return load_design().with_rows(count).points()


class Advanced(NamedTuple):
    """What `advance` has done."""

    solved: bool
    poses: np.ndarray  # after every step
    shapes: np.ndarray  # after the last ones


def advance(body: Body, state: State, dt: float, count: int, tolerance: float, *, shapes: int = 0) -> Advanced:
    """Make equal steps at constant motor speed from a state, which is changed."""
    steps = equal_steps(dt * count, count)._replace(kept=np.arange(count) >= count - shapes)
    (swum,) = side_by_side([Marcher(body, body, state, steps)], tolerance)
    return Advanced(swum.done == count, swum.poses, swum.kept.x)
