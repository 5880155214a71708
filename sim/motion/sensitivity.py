"""Derivatives of the steady motion in every input and effect size, by the implicit function theorem.

The orbit z(p) satisfies F(z, p) = 0, so dz/dp = −(∂F/∂z)⁻¹ ∂F/∂p with the matrix of Newton's method. p are a
robot's numbers (`sim.solve.assembly`); a direction in them costs one more right-hand side, by central differences,
where differences of orbits would cost two more solutions. The numbers depend on the inputs and effect sizes. That
part is differentiated by the complex step (`sim.linear.complex_step`), so an effect needs no code for its
derivative. Derivatives are extrapolated in the mesh, like the means. Units: l, μ0 l⁴/EI.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from common.arrays import Floats
from common.errors import InputError
from sim.effects import catalogue, effect_named, is_effect
from sim.lanes import width
from sim.linear.complex_step import derivative
from sim.model.groups import SLOPE_INPUTS, SLOPE_OUTPUTS, Groups
from sim.solve.assembly import are_local, batch, numbers
from sim.solve.grouping import by_kind, slices
from sim.solve.orbit import mean_motion, residuals_on_orbits, solve_at_orbits
from sim.solve.refinement import (
    MESHES,
    PHASES_FOR_SLOPES,
    SOLVED,
    OrbitOnMeshes,
    extrapolate,
    refined_orbits,
    stacked,
)

WIDTH = 1e-5  # finite-difference step in a robot's numbers; the balance depends almost linearly on them


@dataclass(frozen=True)
class Sensitivities:
    """Steady outputs of B robots and their derivatives in K parameters; NaN where there is no orbit."""

    parameters: tuple[str, ...]
    values: dict[str, Floats]  # SLOPE_OUTPUTS -> (B,)
    derivatives: dict[str, Floats]  # SLOPE_OUTPUTS -> (B, K), per unit of the parameter


def sensitivities(groups: Groups, parameters: Sequence[str], *, phases: int = PHASES_FOR_SLOPES) -> Sensitivities:
    """Simulate steady motion and its derivatives.

    Args:
        groups: robots of one N.
        parameters: names out of SLOPE_INPUTS and `sim.effects.catalogue()`; an effect that the robots do not carry
            is differentiated at its null.
        phases: number of phases to begin with; an effect at its null may need more phases than the motion.

    Raises:
        InputError: an unknown parameter.
    """
    names = tuple(parameters)
    for name in names:
        if name not in SLOPE_INPUTS and not is_effect(name):
            allowed = ", ".join((*SLOPE_INPUTS, *catalogue()))
            raise InputError(f"no parameter {name!r} to differentiate in; there are {allowed}")
    rows = numbers(groups)
    moved = [_direction(groups, name) for name in names]
    scales = np.stack([scale for _, scale in moved], 1) if names else np.empty((len(groups), 0))
    directions = np.stack([d for d, _ in moved], 1) if names else np.empty((len(groups), 0, rows.shape[1]))
    parts = [_at_once(rows[part], directions[part], groups.N, phases) for part in slices(len(rows))]
    means, slopes = (np.concatenate(columns) for columns in zip(*parts, strict=True))
    slopes /= scales[:, :, None]
    values = dict(zip(SLOPE_OUTPUTS, means.T, strict=False))
    derivatives = {name: slopes[:, :, i] for i, name in enumerate(SLOPE_OUTPUTS[:5])}
    sway, surge, yaw = values["v_x"], values["v_z"], values["omega_yr_bar"]
    speed = np.hypot(sway, surge)
    values["R_yr_over_l"] = speed / np.abs(yaw)
    values["theta_rad"] = np.arctan2(np.abs(sway), surge)
    d_sway, d_surge, d_yaw = (derivatives[k] for k in ("v_x", "v_z", "omega_yr_bar"))
    sway, surge, yaw, speed = (a[:, None] for a in (sway, surge, yaw, speed))
    d_speed = (sway * d_sway + surge * d_surge) / speed
    derivatives["R_yr_over_l"] = d_speed / np.abs(yaw) - speed * d_yaw / (yaw * np.abs(yaw))
    derivatives["theta_rad"] = np.sign(sway) * (surge * d_sway - sway * d_surge) / speed**2
    return Sensitivities(names, values, derivatives)


def _direction(groups: Groups, name: str) -> tuple[Floats, Floats]:
    """Compute the derivative of the robots' numbers in parameter/scale, (B, K'), and the scale, (B,)."""
    if name in SLOPE_INPUTS:
        value = getattr(groups, name)
        size = np.abs(value)

        def changed_numbers(changed: Floats) -> Floats:
            return numbers(replace(groups, **{name: changed}))  # type: ignore[arg-type]
    else:
        effect = effect_named(name)
        value = groups.effects.get(name, np.full(len(groups), effect.null))
        size = np.full(len(groups), abs(effect.typical - effect.null))

        def changed_numbers(changed: Floats) -> Floats:
            return numbers(replace(groups, effects={**groups.effects, name: changed}))

    return derivative(changed_numbers, value, size), size


def _at_once(rows: Floats, directions: Floats, tails: int, phases: int) -> tuple[Floats, Floats]:
    """Compute means (B, 5) and derivatives (B, K, 5) of as many robots as there is room for; NaN where lost."""
    orbits = refined_orbits(rows, tails, phases)
    solved = [i for i, orbit in enumerate(orbits) if orbit.status == SOLVED]
    slopes = np.full((*directions.shape[:2], 5), np.nan)
    if directions.shape[1]:
        slopes[solved] = slopes_of_orbits(rows[solved], directions[solved], [orbits[i] for i in solved])
    return np.array([orbit.means for orbit in orbits]).reshape(-1, 5), slopes


def slopes_of_orbits(rows: Floats, directions: Floats, orbits: Sequence[OrbitOnMeshes]) -> Floats:
    """Compute the derivatives of the extrapolated means (`sim.solve.orbit.mean_motion`), (B, K, 5).

    Args:
        rows: the robots' numbers (`sim.solve.assembly.numbers`), (B, K').
        directions: in the numbers, (B, K, K').
        orbits: of the robots, all solved.
    """
    slopes = np.empty((len(MESHES), len(rows), directions.shape[1], 5))
    local = are_local(rows)
    for alike in by_kind(range(len(rows)), lambda i: (orbits[i].x[0].shape, bool(local[i]))):
        for first in range(0, len(alike), width()):
            robots = alike[first : first + width()]
            for mesh in range(len(MESHES)):
                x, u = stacked([orbits[i] for i in robots], mesh)
                slopes[mesh, robots] = _slopes(rows[robots], directions[robots], x, u)
    return extrapolate(slopes)


def _slopes(rows: Floats, directions: Floats, x: Floats, u: Floats) -> Floats:
    """Compute the derivatives of the means on one mesh, (B, K, 5), at x (B, n, M, 3) and u (B, P, 4)."""
    count = directions.shape[1]
    ends = [(rows[:, None] + way * WIDTH * directions).reshape(-1, rows.shape[1]) for way in (-1, 1)]
    shapes, velocities = np.repeat(x, count, 0), np.repeat(u, count, 0)
    below, above = (residuals_on_orbits(end, shapes, velocities) for end in ends)
    r, t = ((low - high) / (2 * WIDTH) for low, high in zip(below[:2], above[:2], strict=True))
    _, du = solve_at_orbits(rows, x, u, r.reshape(-1, count, *x.shape[1:]), t.reshape(-1, count, *u.shape[1:]))
    changes = WIDTH * du.reshape(velocities.shape)
    fall, rise = (
        mean_motion(batch(end), velocities + way * changes) for way, end in zip((-1, 1), ends, strict=True)
    )
    return ((rise - fall) / (2 * WIDTH)).reshape(-1, count, 5)
