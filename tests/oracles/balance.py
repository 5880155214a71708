"""The balance of head and tails by torch, for any table of the tails: a reference for `surrogate.wrench.balance`.

Broyden's method for all robots at once. Its derivative is found by differences that evaluate the table, and again
after some steps.
"""

from __future__ import annotations

import torch
from torch import Tensor

from surrogate.wrench.heads import Heads, Numbers, full_motion, straight_resistance, unbalanced
from surrogate.wrench.tails import Tails, linear_thrust, linear_torque

STEPS, CORRECTION = 40, 1e-9  # the correction is relative
_RENEWED = 8  # steps after which the derivative is found again
_DIFFERENCE, _LEAST_SHARE = 1e-6, 1e-3  # steps of finite differences, relative
_FIRST_SPIN = 0.6  # ω_t/ω in the first guess
_LONGEST = 0.5  # relative change of ω_t in one step


def solve(heads: Heads, tails: Tails, numbers: Numbers, start: Tensor | None = None) -> tuple[Tensor, Tensor]:
    """Solve for the velocities in balance.

    Args:
        numbers: the table of the tails.
        start: first guess (M, 4); by default linear theory.

    Returns:
        (v_x, v_z, ω_yr, ω_h, ω_t), (M, 5), for a positive motor; and which robots converged, (M,).
    """
    u = linear_guess(heads, tails) if start is None else start.clone()
    waiting = torch.arange(len(u))
    waiting_robots, inverse = (heads, tails), torch.zeros(len(u), 4, 4, dtype=u.dtype)
    residual = torch.zeros_like(u)
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
    converged = torch.ones(len(u), dtype=torch.bool)
    converged[waiting] = False
    motion = full_motion(heads, u)
    return motion, converged & torch.isfinite(u).all(1) & (motion[:, 4] > 0)


def _residual_and_inverse(heads: Heads, tails: Tails, u: Tensor, numbers: Numbers) -> tuple[Tensor, Tensor]:
    """Return the residual (M, 4) and the inverse of its derivative (M, 4, 4), by differences."""
    width = _DIFFERENCE * (u.abs() + _LEAST_SHARE * u.abs().amax(1, keepdim=True))
    moved = torch.cat([u, *[u + width * unit for unit in torch.eye(4, dtype=u.dtype)]])
    heads = Heads(*[part.repeat(5, *[1] * (part.dim() - 1)) for part in heads])
    tails = Tails(*[part.repeat(5, *[1] * (part.dim() - 1)) for part in tails])
    residual = unbalanced(heads, tails, moved, numbers).reshape(5, -1, 4)
    slope = ((residual[1:] - residual[0]) / width.T[:, :, None]).permute(1, 2, 0)
    return residual[0], torch.linalg.inv_ex(slope)[0]


def _updated(inverse: Tensor, step: Tensor, change: Tensor) -> Tensor:
    """Update the inverse after a step that changed the balance by `change` (Broyden's good update)."""
    predicted = (inverse @ change[..., None])[..., 0]
    direction = (step[:, None, :] @ inverse)[:, 0]
    size = (direction * change).sum(1)[:, None, None]
    update = (step - predicted)[:, :, None] * direction[:, None, :] / size
    return inverse + torch.nan_to_num(update, nan=0.0, posinf=0.0, neginf=0.0)


def _shortened(heads: Heads, tails: Tails, u: Tensor, step: Tensor) -> Tensor:
    """Shorten the step where ω_t would change by more than _LONGEST of itself."""
    change = (heads.gain * step[:, 3]).abs() / (heads.speed + heads.gain * u[:, 3])
    return step * torch.clamp(_LONGEST / change, max=1.0)[:, None]


def _relative(step: Tensor, u: Tensor) -> Tensor:
    speed = torch.hypot(u[:, 0], u[:, 1]) + u[:, 2].abs()
    moved = torch.maximum(step[:, 0].abs(), step[:, 1].abs()) / speed
    return torch.maximum(moved, torch.maximum((step[:, 2] / u[:, 2]).abs(), (step[:, 3] / u[:, 3]).abs()))


def linear_guess(heads: Heads, tails: Tails) -> Tensor:
    """Guess velocities u (M, 4) with the torque of linear theory and the side forces of straight tails."""
    spin = _FIRST_SPIN * heads.speed
    for _ in range(3):
        torque = tails.number * tails.zeta_perp * tails.offset**2 * linear_torque(tails.zeta_perp * spin)
        head, disc = heads.resistance[:, 3, 3], heads.resistance[:, 3, 4]
        spin = heads.speed * head / (head + heads.gain * (torque + disc))
    head_spin = (spin - heads.speed) / heads.gain
    matrix = heads.resistance[:, :3, :3].clone()
    matrix = matrix + straight_resistance(tails)
    push = -heads.resistance[:, :3, 3] * head_spin[:, None] - heads.resistance[:, :3, 4] * spin[:, None]
    thrust = (tails.zeta_perp - tails.zeta_parallel) * spin * tails.offset**2
    thrust = tails.number * thrust * linear_thrust(tails.zeta_perp * spin)
    push = push + torch.stack([torch.zeros_like(thrust), thrust, torch.zeros_like(thrust)], -1)
    return torch.cat([torch.linalg.solve(matrix, push), head_spin[:, None]], 1)
