"""The balance of head, disc and motor: algebra around the tails' mean wrench.

    W(v_x, v_z, ω_yr, ω_t) = R (v_x, v_z, ω_yr, ω_h, ω_t),    ω_t = ω + gain ω_h

R is the resistance of head and disc about J and the gain is that of the motor (`sim.mechanics.balance`), both
with the effects of the robot. W is the tails' mean wrench (`surrogate.tail`). These are four equations for (v_x,
v_z, ω_yr, ω_h), solved for many robots at once by Broyden's method. Forces are in balance exactly, whatever the
table says.

A reversed motor is solved for as a positive one in the mirror image. So effects that make left and right turns
differ are right in both directions. Left out: several motions of one robot; the solution next to linear theory
is found. Units: l, μ0 l⁴/EI, EI/l².
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from typing import Any, NamedTuple

import numpy as np
import torch
from torch import Tensor

from sim.arrays import Floats
from sim.effects import catalogue
from sim.io.errors import InputError
from sim.model.groups import Groups
from sim.solve.assembly import assemble
from surrogate import tail
from surrogate.tail import Tails

Numbers = Callable[[Tensor], Tensor]  # inputs (M, 7) -> y (M, 6) of `surrogate.tail`

STEPS, CORRECTION = 40, 1e-9  # of Broyden's method; the correction is relative
_RENEWED = 8  # steps after which the derivative is found again
_DIFFERENCE, _LEAST_SHARE = 1e-6, 1e-3  # steps of finite differences, relative
_ON_TAILS = ("tail_sag",)  # local, but on the tails
_FIRST_SPIN = 0.6  # ω_t/ω in the first guess
_LONGEST = 0.5  # relative change of ω_t in one step
_SENSES = (-1.0, 1.0, -1.0, -1.0, -1.0)  # mirror image of (v_x, v_z, ω_yr, ω_h, ω_t)


class Heads(NamedTuple):
    """Head, disc and motor of M robots, in the mirror image if the motor is reversed."""

    speed: Tensor  # (M,) |ω|
    gain: Tensor  # (M,) ∂ω_t/∂ω_h
    resistance: Tensor  # (M, 4, 5)
    length: Tensor  # (M,) L
    sense: Tensor  # (M,) sign of ω


def at(heads: Heads, rows: Tensor) -> Heads:
    """The heads of the robots at `rows`."""
    return Heads(*[part[rows] for part in heads])


def robots_of(columns: Mapping[str, Floats | Tensor], keep: Collection[str] = ()) -> tuple[Heads, Tails]:
    """Heads and tails of robots by column name, each (M,), a_over_R and effects included; differentiable.

    Args:
        columns: robots.
        keep: effects to keep even if no robot has them.

    Raises:
        InputError: an effect changes the tails themselves.
    """
    tensors = {name: as_tensor(values) for name, values in columns.items()}
    count = tensors.pop("N")
    own = {name: tensors.pop(name) for name in Groups.__dataclass_fields__ if name in tensors}
    effects = {name: size for name, size in tensors.items() if name in keep or bool((size != 0).any())}
    for name in effects:
        if not is_of_head(name):
            raise InputError(
                f"{name} changes more than head, disc and motor, so the look-up table does not know it; make the "
                "robot a table of its own: python -m surrogate robot ROBOT.toml --out TABLE.json"
            )
    tails_of_each: Any = count  # a batch of the simulator has one N, formulas take N by row as well
    body = assemble(Groups(**own, N=tails_of_each, effects=effects))
    sense = torch.sign(body.omega)
    mirror = torch.where(sense[:, None] < 0, torch.tensor(_SENSES, dtype=torch.float64), 1.0)
    resistance = body.resistance.permute(2, 0, 1) * mirror[:, :4, None] * mirror[:, None, :]
    heads = Heads(body.omega.abs(), 1 + body.droop * resistance[:, 3, 3], resistance, body.head_length, sense)
    tails = Tails(body.zeta_perp, body.zeta_parallel, body.offset, body.tail_radius, count, resistance[:, 3, 3])
    return heads, tails


def as_tensor(values: Floats | Tensor) -> Tensor:
    """Tensors as they are, arrays copied."""
    return values if isinstance(values, Tensor) else torch.tensor(np.asarray(values), dtype=torch.float64)


def is_of_head(effect: str) -> bool:
    """Whether an effect enters the balance by algebra: it changes head, disc, motor, or all drag alike."""
    found = catalogue()[effect]
    return found.reach == "local" and effect not in _ON_TAILS


def full_motion(heads: Heads, u: Tensor) -> Tensor:
    """(v_x, v_z, ω_yr, ω_h, ω_t), (M, 5), from the four velocities u (M, 4)."""
    return torch.cat([u, (heads.speed + heads.gain * u[:, 3])[:, None]], 1)


def unbalanced(heads: Heads, tails: Tails, u: Tensor, numbers: Numbers) -> Tensor:
    """W − R (v_x, v_z, ω_yr, ω_h, ω_t), (M, 4)."""
    motion = full_motion(heads, u)
    wrench = tail.wrench_of(tails, motion, numbers(tail.inputs_of(tails, motion)))
    return wrench - (heads.resistance @ motion[..., None])[..., 0]


def linear_guess(heads: Heads, tails: Tails) -> Tensor:
    """Velocities u (M, 4) with the torque of linear theory and the side forces of straight tails."""
    spin = _FIRST_SPIN * heads.speed
    for _ in range(3):
        torque = tails.number * tails.zeta_perp * tails.offset**2 * tail.torque_of(tails.zeta_perp * spin)
        head, disc = heads.resistance[:, 3, 3], heads.resistance[:, 3, 4]
        spin = heads.speed * head / (head + heads.gain * (torque + disc))
    head_spin = (spin - heads.speed) / heads.gain
    matrix = heads.resistance[:, :3, :3].clone()
    matrix = matrix + straight_resistance(tails)
    push = -heads.resistance[:, :3, 3] * head_spin[:, None] - heads.resistance[:, :3, 4] * spin[:, None]
    thrust = (tails.zeta_perp - tails.zeta_parallel) * spin * tails.offset**2
    thrust = tails.number * thrust * tail.thrust_of(tails.zeta_perp * spin)
    push = push + torch.stack([torch.zeros_like(thrust), thrust, torch.zeros_like(thrust)], -1)
    return torch.cat([torch.linalg.solve(matrix, push), head_spin[:, None]], 1)


def straight_resistance(tails: Tails) -> Tensor:
    """Resistance of straight tails to (v_x, v_z, ω_yr), (M, 3, 3)."""
    across, along = tails.number * tails.zeta_perp, tails.number * tails.zeta_parallel
    none = torch.zeros_like(across)
    rows = [[across, none, -across / 2], [none, along, none], [-across / 2, none, across / 3]]
    return torch.stack([torch.stack(row, -1) for row in rows], -2)


def solve(heads: Heads, tails: Tails, numbers: Numbers, start: Tensor | None = None) -> tuple[Tensor, Tensor]:
    """Velocities in balance.

    Args:
        numbers: the table of the tails.
        start: first guess (M, 4); by default linear theory.

    Returns:
        (v_x, v_z, ω_yr, ω_h, ω_t), (M, 5), for a positive motor; and which robots converged, (M,).
    """
    u = linear_guess(heads, tails) if start is None else start.clone()
    waiting = torch.arange(len(u))
    own, inverse = (heads, tails), torch.zeros(len(u), 4, 4, dtype=u.dtype)
    left = torch.zeros_like(u)
    for count in range(STEPS):
        now = u[waiting]
        if count % _RENEWED == 0:
            left, inverse = _left_and_inverse(*own, now, numbers)
        step = _shortened(*own, now, (inverse @ left[..., None])[..., 0])
        u[waiting] = now - step
        more = ~(_relative(step, u[waiting]) < CORRECTION)
        waiting = waiting[more]
        if not len(waiting):
            break
        own = at(own[0], more), tail.at(own[1], more)
        step, inverse, before = step[more], inverse[more], left[more]
        left = unbalanced(*own, u[waiting], numbers)
        inverse = _updated(inverse, -step, left - before)
    converged = torch.ones(len(u), dtype=torch.bool)
    converged[waiting] = False
    motion = full_motion(heads, u)
    return motion, converged & torch.isfinite(u).all(1) & (motion[:, 4] > 0)


def _left_and_inverse(heads: Heads, tails: Tails, u: Tensor, numbers: Numbers) -> tuple[Tensor, Tensor]:
    """What is unbalanced (M, 4), and the inverse of its derivative (M, 4, 4), by differences."""
    width = _DIFFERENCE * (u.abs() + _LEAST_SHARE * u.abs().amax(1, keepdim=True))
    moved = torch.cat([u, *[u + width * unit for unit in torch.eye(4, dtype=u.dtype)]])
    heads = Heads(*[part.repeat(5, *[1] * (part.dim() - 1)) for part in heads])
    tails = Tails(*[part.repeat(5) for part in tails])
    left = unbalanced(heads, tails, moved, numbers).reshape(5, -1, 4)
    slope = ((left[1:] - left[0]) / width.T[:, :, None]).permute(1, 2, 0)
    return left[0], torch.linalg.inv_ex(slope)[0]


def _updated(inverse: Tensor, step: Tensor, change: Tensor) -> Tensor:
    """The inverse after a step that changed the balance so (Broyden's good update)."""
    predicted = (inverse @ change[..., None])[..., 0]
    along = (step[:, None, :] @ inverse)[:, 0]
    size = (along * change).sum(1)[:, None, None]
    update = (step - predicted)[:, :, None] * along[:, None, :] / size
    return inverse + torch.nan_to_num(update, nan=0.0, posinf=0.0, neginf=0.0)


def _shortened(heads: Heads, tails: Tails, u: Tensor, step: Tensor) -> Tensor:
    """The step, shortened where ω_t would change by more than _LONGEST of itself."""
    change = (heads.gain * step[:, 3]).abs() / (heads.speed + heads.gain * u[:, 3])
    return step * torch.clamp(_LONGEST / change, max=1.0)[:, None]


def value_and_slope(function: Callable[[Tensor], Tensor], u: Tensor) -> tuple[Tensor, Tensor]:
    """f(u) (M, 4) and ∂f/∂u (M, 4, 4) of a function that takes every row alone."""
    unit = torch.eye(u.shape[1], dtype=u.dtype)

    def along(direction: Tensor) -> Tensor:
        change: Tensor = torch.func.jvp(function, (u,), (direction.expand_as(u),))[1]
        return change

    slope = torch.func.vmap(along, out_dims=-1)(unit)
    return function(u), slope


def _relative(step: Tensor, u: Tensor) -> Tensor:
    speed = torch.hypot(u[:, 0], u[:, 1]) + u[:, 2].abs()
    moved = torch.maximum(step[:, 0].abs(), step[:, 1].abs()) / speed
    return torch.maximum(moved, torch.maximum((step[:, 2] / u[:, 2]).abs(), (step[:, 3] / u[:, 3]).abs()))
