"""The balance of head and tails with arrays, for any table of the tails: reference for `surrogate.wrench.balance`.

Broyden's method for all robots at once. Its derivative is found by differences that evaluate the table, and again
after some steps.
"""

from __future__ import annotations

import numpy as np

from sim.arrays import Flags, Floats
from surrogate.wrench.balance import inverses_of
from surrogate.wrench.heads import Heads, Numbers, full_motion, straight_resistance, unbalanced
from surrogate.wrench.tails import Tails, linear_thrust, linear_torque

STEPS, CORRECTION = 40, 1e-9  # the correction is relative
_RENEWED = 8  # steps after which the derivative is found again
_DIFFERENCE, _LEAST_SHARE = 1e-6, 1e-3  # steps of finite differences, relative
_FIRST_SPIN = 0.6  # ω_t/ω in the first guess
_LONGEST = 0.5  # relative change of ω_t in one step


def solve(heads: Heads, tails: Tails, numbers: Numbers, start: Floats | None = None) -> tuple[Floats, Flags]:
    """Solve for the velocities in balance.

    Args:
        numbers: the table of the tails.
        start: first guess (M, 4); by default linear theory.

    Returns:
        (v_x, v_z, ω_yr, ω_h, ω_t), (M, 5), for a positive motor; and which robots converged, (M,).
    """
    u = linear_guess(heads, tails) if start is None else start.copy()
    waiting = np.arange(len(u))
    waiting_robots, inverse = (heads, tails), np.zeros((len(u), 4, 4))
    residual = np.zeros_like(u)
    for count in range(STEPS):
        now = u[waiting]
        if count % _RENEWED == 0:
            residual, inverse = _residual_and_inverse(*waiting_robots, now, numbers)
        step = _shortened(*waiting_robots, now, (inverse @ residual[..., None])[..., 0])
        u[waiting] = now - step
        more = ~(_relative(step, u[waiting]) < CORRECTION)
        waiting = waiting[more]
        if not len(waiting):
            break
        waiting_robots = waiting_robots[0].at(more), waiting_robots[1].at(more)
        step, inverse, before = step[more], inverse[more], residual[more]
        residual = unbalanced(*waiting_robots, u[waiting], numbers)
        inverse = _updated(inverse, -step, residual - before)
    converged = np.ones(len(u), dtype=bool)
    converged[waiting] = False
    motion = full_motion(heads, u)
    return motion, converged & np.isfinite(u).all(1) & (motion[:, 4] > 0)


def _residual_and_inverse(heads: Heads, tails: Tails, u: Floats, numbers: Numbers) -> tuple[Floats, Floats]:
    """Return the residual (M, 4) and the inverse of its derivative (M, 4, 4), by differences."""
    width = _DIFFERENCE * (np.abs(u) + _LEAST_SHARE * np.abs(u).max(1, keepdims=True))
    moved = np.concatenate([u, *[u + width * unit for unit in np.eye(4)]])
    heads = Heads(*[np.concatenate([part] * 5) for part in heads])
    tails = Tails(*[np.concatenate([part] * 5) for part in tails])
    residual = unbalanced(heads, tails, moved, numbers).reshape(5, -1, 4)
    slope = ((residual[1:] - residual[0]) / width.T[:, :, None]).transpose(1, 2, 0)
    return residual[0], inverses_of(np.ascontiguousarray(slope))


def _updated(inverse: Floats, step: Floats, change: Floats) -> Floats:
    """Update the inverse after a step that changed the balance by `change` (Broyden's good update)."""
    predicted = (inverse @ change[..., None])[..., 0]
    direction = (step[:, None, :] @ inverse)[:, 0]
    size = (direction * change).sum(1)[:, None, None]
    update = (step - predicted)[:, :, None] * direction[:, None, :] / size
    return inverse + np.nan_to_num(update, nan=0.0, posinf=0.0, neginf=0.0)


def _shortened(heads: Heads, tails: Tails, u: Floats, step: Floats) -> Floats:
    """Shorten the step where ω_t would change by more than _LONGEST of itself."""
    change = np.abs(heads.gain * step[:, 3]) / (heads.speed + heads.gain * u[:, 3])
    return step * np.minimum(_LONGEST / change, 1.0)[:, None]


def _relative(step: Floats, u: Floats) -> Floats:
    speed = np.hypot(u[:, 0], u[:, 1]) + np.abs(u[:, 2])
    moved = np.maximum(np.abs(step[:, 0]), np.abs(step[:, 1])) / speed
    return np.maximum(moved, np.maximum(np.abs(step[:, 2] / u[:, 2]), np.abs(step[:, 3] / u[:, 3])))


def linear_guess(heads: Heads, tails: Tails) -> Floats:
    """Guess velocities u (M, 4) with the torque of linear theory and the side forces of straight tails."""
    spin = _FIRST_SPIN * heads.speed
    for _ in range(3):
        torque = tails.number * tails.zeta_perp * tails.offset**2 * linear_torque(tails.zeta_perp * spin)
        head, disc = heads.resistance[:, 3, 3], heads.resistance[:, 3, 4]
        spin = heads.speed * head / (head + heads.gain * (torque + disc))
    head_spin = (spin - heads.speed) / heads.gain
    matrix = heads.resistance[:, :3, :3] + straight_resistance(tails)
    push = -heads.resistance[:, :3, 3] * head_spin[:, None] - heads.resistance[:, :3, 4] * spin[:, None]
    thrust = (tails.zeta_perp - tails.zeta_parallel) * spin * tails.offset**2
    thrust = tails.number * thrust * linear_thrust(tails.zeta_perp * spin)
    push = push + np.stack([np.zeros_like(thrust), thrust, np.zeros_like(thrust)], -1)
    return np.concatenate([np.linalg.solve(matrix, push[..., None])[..., 0], head_spin[:, None]], 1)
