"""Derivatives of the steady motion in every input and effect size, by the implicit function theorem.

The orbit depends on a robot's numbers (`sim.motion.orbit_slopes`). These depend on its inputs and effect sizes
(`sim.solve.assembly`), and that part is differentiated by the complex step (`sim.linear.complex_step`). So an
effect needs no code for its derivative. Derivatives are extrapolated in the mesh, like the means.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from sim.arrays import Floats
from sim.effects import catalogue
from sim.io.errors import InputError
from sim.linear.complex_step import derivative
from sim.model.groups import Groups
from sim.model.sweepable import SLOPE_INPUTS, SLOPE_OUTPUTS
from sim.motion.orbits import solve_orbits
from sim.solve.assembly import numbers
from sim.solve.refinement import PHASES_FOR_SLOPES


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
        if name not in SLOPE_INPUTS and name not in catalogue():
            allowed = ", ".join((*SLOPE_INPUTS, *catalogue()))
            raise InputError(f"no parameter {name!r} to differentiate in; there are {allowed}")
    rows = numbers(groups)
    moved = [_direction(groups, name) for name in names]
    scales = np.stack([scale for _, scale in moved], 1) if names else np.empty((len(groups), 0))
    directions = np.stack([d for d, _ in moved], 1) if names else np.empty((len(groups), 0, rows.shape[1]))
    solution = solve_orbits(rows, groups.N, directions, phases=phases)
    slopes = solution.slopes / scales[:, :, None]  # (B, K, 5)
    values = dict(zip(SLOPE_OUTPUTS, solution.means.T, strict=False))
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
        effect = catalogue()[name]
        value = groups.effects.get(name, np.full(len(groups), effect.null))
        size = np.full(len(groups), abs(effect.typical - effect.null))

        def changed_numbers(changed: Floats) -> Floats:
            return numbers(replace(groups, effects={**groups.effects, name: changed}))

    return derivative(changed_numbers, value, size), size
