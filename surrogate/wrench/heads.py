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

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from sim.arrays import Flags, Floats, Integers
from sim.effects import catalogue
from sim.io.errors import InputError
from sim.model.groups import Groups
from sim.solve.assembly import assemble
from surrogate.input_ranges import ROBOT
from surrogate.wrench.tails import TAIL_NUMBERS, Tails, head_inputs

# A robot for the compiled loops: |ω|, gain, resistance (20), L and sense of the head; then the tails, as packed.
RESISTANCE, HEAD_LENGTH, SENSE, HEAD_NUMBERS = 2, 22, 23, 24
ROBOT_NUMBERS = HEAD_NUMBERS + TAIL_NUMBERS
COUPLE = RESISTANCE + 5 * 2 + 4  # in yaw, of the tails' spin
NUMBER = HEAD_NUMBERS + Tails._fields.index("number")

_ON_TAILS = ("tail_sag",)  # local, but on the tails
_SENSES = np.array([-1.0, 1.0, -1.0, -1.0, -1.0])  # mirror image of (v_x, v_z, ω_yr, ω_h, ω_t)


class Heads(NamedTuple):
    """Head, disc and motor of M robots, in the mirror image if the motor is reversed."""

    speed: Floats  # (M,) |ω|
    gain: Floats  # (M,) ∂ω_t/∂ω_h
    resistance: Floats  # (M, 4, 5)
    length: Floats  # (M,) L
    sense: Floats  # (M,) sign of ω

    def at(self, rows: Integers | Flags | slice) -> Heads:
        """Return the heads of the robots at indices, flags or a slice (M',)."""
        return Heads(*[part[rows] for part in self])


def pack_robots(heads: Heads, tails: Tails) -> Floats:
    """Return heads and tails for the compiled loops, (M, ROBOT_NUMBERS)."""
    resistance = heads.resistance.reshape(-1, 20).T
    return np.ascontiguousarray(
        np.vstack(
            [*heads[:2], resistance, *heads[3:], *tails[:-1], tails.head.T]
        ).T  # in the order of the constants
    )


def unpack_robots(robots: Floats) -> tuple[Heads, Tails]:
    """Return heads and tails of packed robots (M, ROBOT_NUMBERS), without copying them."""
    head, tail = robots[:, :HEAD_NUMBERS].T, robots[:, HEAD_NUMBERS:].T
    resistance = robots[:, RESISTANCE:HEAD_LENGTH].reshape(-1, 4, 5)
    return Heads(head[0], head[1], resistance, head[HEAD_LENGTH], head[SENSE]), Tails(*[*tail[:6], tail[6:].T])


def packed_robots(columns: Mapping[str, Floats]) -> tuple[Floats, Floats]:
    """Return robots by column name, each (M,), for the compiled loops: groups (M, 9), and (M, ROBOT_NUMBERS).

    Raises:
        InputError: an effect changes the tails themselves.
    """
    groups = np.array([columns[name] for name in ROBOT]).T.copy()
    if any(size.any() for name, size in columns.items() if name not in ROBOT):
        return groups, pack_robots(*heads_and_tails(columns))
    from surrogate.wrench.balance import robots_of_groups

    return groups, robots_of_groups(groups)


def heads_and_tails(columns: Mapping[str, Floats]) -> tuple[Heads, Tails]:
    """Return heads and tails of robots by column name, each (M,), a_over_R and effects included.

    Raises:
        InputError: an effect changes the tails themselves.
    """
    sizes = dict(columns)
    count = sizes.pop("N")
    groups = {name: sizes.pop(name) for name in Groups.__dataclass_fields__ if name in sizes}
    effects = {name: size for name, size in sizes.items() if size.any()}
    for name in effects:
        if not needs_no_learning(name):
            raise InputError(
                f"{name} changes more than head, disc and motor, so the look-up table does not know it; make the "
                "robot a table of its own: softflagella surrogate robot ROBOT.toml --out TABLE.json"
            )
    tails_of_each: Any = count  # a batch of the simulator has one N, formulas take N by row as well
    body = assemble(Groups(**groups, N=tails_of_each, effects=effects))
    sense = np.sign(body.omega)
    mirror = np.where(sense[:, None] < 0, _SENSES, 1.0)
    resistance = np.ascontiguousarray(
        body.resistance.transpose(2, 0, 1) * mirror[:, :4, None] * mirror[:, None, :]
    )
    gain = 1 + body.droop * resistance[:, 3, 3]
    heads = Heads(np.abs(body.omega), gain, resistance, body.head_length, sense)
    around = head_inputs(resistance, body.head_length, gain, count * body.zeta_perp, body.offset)
    tails = Tails(
        body.zeta_perp, body.zeta_parallel, body.offset, body.tail_radius, count, resistance[:, 3, 3], around
    )
    return heads, tails


def needs_no_learning(effect: str) -> bool:
    """Return whether an effect enters the balance by algebra: it changes head, disc, motor, or all drag alike."""
    entry = catalogue()[effect]
    return entry.reach == "local" and entry.term not in _ON_TAILS


def straight_resistance(tails: Tails) -> Floats:
    """Return the resistance of straight tails to (v_x, v_z, ω_yr), (M, 3, 3)."""
    across, along = tails.number * tails.zeta_perp, tails.number * tails.zeta_parallel
    none = np.zeros(len(across))
    rows = [[across, none, -across / 2], [none, along, none], [-across / 2, none, across / 3]]
    return np.stack([np.stack(row, -1) for row in rows], -2)
