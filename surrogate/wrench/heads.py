"""The balance of head, disc and motor: algebra around the tails' mean wrench.

    W(v_x, v_z, ω_yr, ω_t) = R (v_x, v_z, ω_yr, ω_h, ω_t),    ω_t = ω + gain ω_h

R is the resistance of head and disc about J and the gain is that of the motor (`sim.mechanics.balance`), both
with the effects of the robot. W is the tails' mean wrench (`surrogate.wrench.tails`). These are four equations for
(v_x, v_z, ω_yr, ω_h), which `surrogate.wrench.balance` solves. Forces are in balance exactly, whatever the table
says.

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
from surrogate.wrench.tails import Tails, head_inputs, inputs_with_head, total_wrench

Numbers = Callable[
    [Tensor], Tensor
]  # inputs with those of the head (M, 14) -> y (M, 6) of `surrogate.wrench.tails`

_ON_TAILS = ("tail_sag",)  # local, but on the tails
_SENSES = (-1.0, 1.0, -1.0, -1.0, -1.0)  # mirror image of (v_x, v_z, ω_yr, ω_h, ω_t)


class Heads(NamedTuple):
    """Head, disc and motor of M robots, in the mirror image if the motor is reversed."""

    speed: Tensor  # (M,) |ω|
    gain: Tensor  # (M,) ∂ω_t/∂ω_h
    resistance: Tensor  # (M, 4, 5)
    length: Tensor  # (M,) L
    sense: Tensor  # (M,) sign of ω

    def at(self, rows: Tensor) -> Heads:
        """Return the heads of the robots at indices or flags (M',)."""
        return Heads(*[part[rows] for part in self])


def heads_and_tails(columns: Mapping[str, Floats | Tensor], keep: Collection[str] = ()) -> tuple[Heads, Tails]:
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
        if not needs_no_learning(name):
            raise InputError(
                f"{name} changes more than head, disc and motor, so the look-up table does not know it; make the "
                "robot a table of its own: softflagella surrogate robot ROBOT.toml --out TABLE.json"
            )
    tails_of_each: Any = count  # a batch of the simulator has one N, formulas take N by row as well
    body = assemble(Groups(**own, N=tails_of_each, effects=effects))
    sense = torch.sign(body.omega)
    mirror = torch.where(sense[:, None] < 0, torch.tensor(_SENSES, dtype=torch.float64), 1.0)
    resistance = body.resistance.permute(2, 0, 1) * mirror[:, :4, None] * mirror[:, None, :]
    heads = Heads(body.omega.abs(), 1 + body.droop * resistance[:, 3, 3], resistance, body.head_length, sense)
    around = head_inputs(resistance, body.head_length, count * body.zeta_perp)
    tails = Tails(
        body.zeta_perp, body.zeta_parallel, body.offset, body.tail_radius, count, resistance[:, 3, 3], around
    )
    return heads, tails


def as_tensor(values: Floats | Tensor) -> Tensor:
    """Tensors as they are, arrays copied."""
    return values if isinstance(values, Tensor) else torch.tensor(np.asarray(values), dtype=torch.float64)


def needs_no_learning(effect: str) -> bool:
    """Whether an effect enters the balance by algebra: it changes head, disc, motor, or all drag alike."""
    found = catalogue()[effect]
    return found.reach == "local" and effect not in _ON_TAILS


def full_motion(heads: Heads, u: Tensor) -> Tensor:
    """(v_x, v_z, ω_yr, ω_h, ω_t), (M, 5), from the four velocities u (M, 4)."""
    return torch.cat([u, (heads.speed + heads.gain * u[:, 3])[:, None]], 1)


def unbalanced(heads: Heads, tails: Tails, u: Tensor, numbers: Numbers) -> Tensor:
    """W − R (v_x, v_z, ω_yr, ω_h, ω_t), (M, 4)."""
    motion = full_motion(heads, u)
    wrench = total_wrench(tails, motion, numbers(inputs_with_head(tails, motion)))
    return wrench - (heads.resistance @ motion[..., None])[..., 0]


def straight_resistance(tails: Tails) -> Tensor:
    """Resistance of straight tails to (v_x, v_z, ω_yr), (M, 3, 3)."""
    across, along = tails.number * tails.zeta_perp, tails.number * tails.zeta_parallel
    none = torch.zeros_like(across)
    rows = [[across, none, -across / 2], [none, along, none], [-across / 2, none, across / 3]]
    return torch.stack([torch.stack(row, -1) for row in rows], -2)


def value_and_slope(function: Callable[[Tensor], Tensor], u: Tensor) -> tuple[Tensor, Tensor]:
    """f(u) (M, 4) and ∂f/∂u (M, 4, 4) of a function that takes every row alone."""
    unit = torch.eye(u.shape[1], dtype=u.dtype)

    def along(direction: Tensor) -> Tensor:
        change: Tensor = torch.func.jvp(function, (u,), (direction.expand_as(u),))[1]
        return change

    slope = torch.func.vmap(along, out_dims=-1)(unit)
    return function(u), slope
