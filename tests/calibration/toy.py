"""A robot with rigid straight tails: the balance in closed form, for fast tests of the statistics.

Tails are straight rods along the axis at radius a. Their thrust and torque grow less than in proportion to the
motor's speed, as if they bent. Head, drag on the tails and viscosity are those of the real model, effects
included. In a thinner fluid it moves as with a slower motor, all rates scaled, as the real robot does. It has
the columns of the simulator and no discretisation.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from calibration.swimmer.swimmer import Solver
from sim.effects import effect_named, is_effect
from sim.inputs import check_columns
from sim.mechanics.drag import UNIT_OF_TIME
from sim.model.groups import Groups
from sim.motion.sensitivity import Sensitivities
from sim.solve.assembly import assemble


def steady_columns(columns: Mapping[str, Any], **_: object) -> dict[str, np.ndarray]:
    """Stand-in for `sim.motion.batches.steady_columns`."""
    values = check_columns({k: np.asarray(v, float) for k, v in columns.items()})
    outputs: dict[str, np.ndarray] = {}
    for tails in np.unique(values["N"]):
        rows = values["N"] == tails
        for name, value in _robots({k: v[rows] for k, v in values.items()}).items():
            outputs.setdefault(name, np.empty(len(rows)))[rows] = value
    return outputs


def slopes(columns: Mapping[str, Any], parameters: tuple[str, ...], **_: object) -> Sensitivities:
    """Stand-in for `sim.motion.batches.sensitivity_columns`, by differences; all robots in one batch."""
    base = {name: np.asarray(value, float) for name, value in columns.items()}
    rows = len(base["N"])
    for name in (parameter for parameter in parameters if is_effect(parameter)):
        base.setdefault(name, np.full(rows, effect_named(name).null))
    stacked = {name: np.tile(value, (1 + len(parameters), 1)) for name, value in base.items()}
    widths = []
    for place, name in enumerate(parameters, 1):
        at = base[name]
        width = 1e-5 * np.abs(at)
        if is_effect(name):  # towards the inside
            effect = effect_named(name)
            step = 1e-5 * abs(effect.typical - effect.null)
            width = step * np.where(at + step <= effect.bounds[1], 1, -1)
        stacked[name][place] += width
        widths.append(width)
    moved = steady_columns({name: value.ravel() for name, value in stacked.items()})
    outputs = {name: value.reshape(1 + len(parameters), rows) for name, value in moved.items()}
    derivatives = {
        name: np.stack([(v - value[0]) / width for v, width in zip(value[1:], widths, strict=True)], 1)
        for name, value in outputs.items()
        if parameters
    }
    return Sensitivities(parameters, {name: value[0] for name, value in outputs.items()}, derivatives)


def _robots(columns: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Robots of one number of tails, (B,) each."""
    groups = Groups.from_columns(columns)
    R = 1 / groups.l_over_R
    body = assemble(groups)
    resistance = np.moveaxis(body.resistance, -1, 0)  # (B, 4, 5)
    head = resistance[:, :, :4].copy()
    head[:, :, 3] += resistance[:, :, 4]
    parallel, perp, viscosity = body.zeta_parallel, body.zeta_perp, body.viscosity
    a, n, omega = groups.a_over_R * R, groups.N, groups.omega_bar
    terms = body.nonlocal_terms
    time = UNIT_OF_TIME * body.tail_radius**4 * np.exp(terms.shear_thinning_time)
    rate = np.abs(omega) * a / body.tail_radius  # at the clamps
    thinned = (1 + (time * rate) ** 2) ** (-terms.shear_thinning / 2)
    thinned = thinned * (rate * UNIT_OF_TIME * body.tail_radius**4) ** terms.tail_drag_by_speed
    parallel, perp = parallel * thinned, perp * thinned
    end = np.exp(terms.tail_drag_along / 2)  # drag of the rear half over the mean, as yaw feels it
    a = a * np.exp(terms.natural_splay / 10)
    bent = 1 / (1 + 0.05 * viscosity * np.abs(omega))
    tails = np.zeros_like(head)
    tails[:, 0, 0] = n * perp
    tails[:, 0, 2] = tails[:, 2, 0] = -n * perp / 2
    tails[:, 2, 2] = n * perp * end / 3
    tails[:, 1, 1] = n * parallel
    tails[:, 3, 3] = n * (3 * perp * a**2 + 4 * np.pi * terms.tail_spin_drag * body.tail_radius**2) * bent
    thrust = 0.5 * n * (perp - parallel) * a**2 * bent
    tails[:, 1, 3] = -thrust * np.sign(omega)
    push = (tails[:, :, 3] + resistance[:, :, 4]) * omega[:, None]
    u = np.linalg.solve(head + tails, -push[..., None])[..., 0]
    sway, surge, yaw, spin = u[:, 0] + u[:, 2] * groups.L_over_R * R / 2, u[:, 1], u[:, 2], u[:, 3]
    return {
        "omega_h_bar": spin,
        "omega_t_bar": spin + omega,
        "omega_yr_bar": yaw,
        "v_x": sway,
        "v_z": surge,
        "R_yr_over_l": np.hypot(sway, surge) / np.abs(yaw),
        "theta_deg": np.degrees(np.arctan2(np.abs(sway), surge)),
    }


SOLVER = Solver(steady_columns, slopes)
