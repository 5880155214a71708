"""The balance of head, disc and motor with the mean wrench of the tails, which the table learns: all its formulas.

    W(v_x, v_z, ω_yr, ω_t) = R (v_x, v_z, ω_yr, ω_h, ω_t),    ω_t = ω + gain ω_h

R is the resistance of head and disc about J and the gain is that of the motor (`sim.mechanics.balance`), both
with the effects of the robot. These are four equations for (v_x, v_z, ω_yr, ω_h), which `surrogate.balance`
solves. Forces are in balance exactly, whatever the table says. A reversed motor is solved for as a positive one in
the mirror image. So effects that make left and right turns differ are right in both directions.

What must be simulated is the mean wrench W of one tail over a turn. In the units of the simulator it depends on

    S = ζ⊥ ω_t              drag number: drag over bending stiffness
    a, r0                   where the tail is clamped, and how thick it is
    m = √(v_x² + ω_yr²)/(a ω_t)    sideways motion of the tail over the speed of its clamp
    β = atan2(v_x, ω_yr)    about which point the tail turns
    v_z/(a ω_t)             forward motion

The network sees m as the deflection δ = m a S/(S + 12) that this motion makes. With three or more tails the
velocities hardly change over a turn, and the wrench of one tail does not depend on N. With one or two tails they
do. So N = 1 and N = 2 have networks of their own.

Two tails push and turn the robot twice in each turn, and how far it goes depends on the drag of the head. So the
network of N = 2 sees the drag of the head against sway, surge and turning as well, and that of head, disc and
motor against spin (PAIR_INPUTS), if it learned from many rows. It does not see side force and couple of the head,
which drive the mean motion.

A single tail pushes the robot from side to side in each turn, and how far it goes depends on all drag of the head.
So the network of N = 1 sees S, a, r0 and the whole resistance of the head (HEAD_INPUTS). These determine the
motion, and the network must not see it: from the drag of the head and the velocities it would learn that
forces are in balance, and a query could not tell the true motion from others.

The network gives six numbers y, near (0, 1, 0, 1, 0, 0):

    F_x = N ζ⊥ (ω_yr/2 − v_x + m a ω_t y_0)
    F_z = N (−ζ∥ v_z + (ζ⊥ − ζ∥) ω_t a² T(S) (y_1 + m² y_4))
    M_y = N ζ⊥ (v_x/2 − ω_yr/3 + m a ω_t y_2)
    M_z = −N ζ⊥ ω_t a² Q(S) (y_3 + m² y_5)

The terms without y are the drag of straight tails. T and Q are simple fits to thrust and torque in linear theory
(`sim.mechanics.linear_theory`). The network learns what is left.

Frame: body axes at the centre J of the disc, motor positive. Left out: effects on the tails themselves, and
several motions of one robot; the solution next to linear theory is found. Units: l, μ0 l⁴/EI, EI/l². Source: the
paper's model (arXiv 2103.05712).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from common.arrays import Flags, Floats, Integers
from common.errors import InputError
from sim.effects import effect_named
from sim.jit import compiled_fast, formula
from sim.mechanics.drag import tail_coefficients
from sim.model.body import head_resistance, places
from sim.model.groups import Groups
from sim.solve.assembly import assemble
from surrogate.domain import ROBOT

INPUTS = ("ln S", "ln a", "ln 1/r0", "asinh δ", "β", "asinh v_z", "ln spin drag of head over tails")
HEAD_INPUTS = (
    "ln sway drag", "ln surge drag", "ln drag against turning", "ln L", "coupling of sway and turn",
    "ln side force", "spin drag of the disc over that of the head", "yaw couple of the tails' spin", "ln gain",
)  # fmt: skip
SINGLE_INPUTS = ("ln S", "ln a", "ln 1/r0", "ln spin drag of head over tails", *HEAD_INPUTS)
PAIR_INPUTS = (
    *INPUTS[:-1], "ln spin drag of head, disc and motor over tails",
    "ln sway drag", "ln surge drag", "ln drag against turning", "coupling of sway and turn",
)  # fmt: skip
SMOOTHNESS = (0.7, 1.3, 8.0, 2.0, 4.0, 4.0, 5.0)  # over how many standard deviations the wrench changes
PAIR_SMOOTHNESS = (*SMOOTHNESS, 3.0, 3.0, 3.0, 3.0)
SINGLE_SMOOTHNESS = (0.7, 1.3, 8.0, 5.0) + (3.0,) * len(HEAD_INPUTS)
TYPICAL = ((0.0, 1.0, 0.0, 0.9, 0.2, 0.0), (0.04, 0.4, 0.03, 0.1, 0.3, 0.05))  # mean and spread of y
SOFT = 12.0  # S from which a tail bends with the flow while it turns
SMALL_DEFLECTION, SMALL_SURGE = 0.05, 0.05  # below, an input is linear; above, logarithmic
TINY = 1e-30
MIN_SURGE = 0.05  # of the speed: errors of v_z are relative to this at least
THRUST, THRUST_SOFT, THRUST_POWER = 0.125, 8.0, 1.35  # of T
TORQUE_SOFT, TORQUE_POWER = 6.0, -0.125  # of Q
_ON_TAILS = ("tail_sag",)  # local, but on the tails
_SENSES = np.array([-1.0, 1.0, -1.0, -1.0, -1.0])  # mirror image of (v_x, v_z, ω_yr, ω_h, ω_t)


class RobotColumns(NamedTuple):
    """M robots, in the mirror image if the motor is reversed; each (M,) where nothing else is said."""

    speed: Floats  # |ω|
    gain: Floats  # ∂ω_t/∂ω_h
    resistance: Floats  # (M, 4, 5), of head and disc
    head_length: Floats  # L
    sense: Floats  # sign of ω
    perp: Floats  # ζ⊥
    parallel: Floats  # ζ∥
    offset: Floats  # a
    radius: Floats  # r0
    number: Floats  # N
    spin_drag: Floats  # moment on the head per ω_h
    head: Floats  # (M, 9) HEAD_INPUTS; drag over that of the tails

    def at(self, rows: Integers | Flags | slice) -> RobotColumns:
        """Return the robots at indices, flags or a slice (M',)."""
        return RobotColumns(*[part[rows] for part in self])


_SHAPES = [{"resistance": (4, 5), "head": (len(HEAD_INPUTS),)}.get(name, ()) for name in RobotColumns._fields]
PLACES: Any = RobotColumns._make(places(_SHAPES))  # of a robot's numbers for the compiled loops
ROBOT_NUMBERS = PLACES.head.stop
COUPLE = PLACES.resistance.start + 5 * 2 + 4  # in yaw, of the tails' spin


def pack_robots(robots: RobotColumns) -> Floats:
    """Return robots for the compiled loops, (M, ROBOT_NUMBERS), in the order of the fields."""
    parts = zip(_SHAPES, robots, strict=True)
    return np.concatenate([part.reshape(len(part), math.prod(shape)) for shape, part in parts], 1)


def unpack_robots(packed: Floats) -> RobotColumns:
    """Return packed robots (M, ROBOT_NUMBERS) by field, without copying them."""
    parts = zip(_SHAPES, PLACES, strict=True)
    return RobotColumns._make(packed[:, columns].reshape(len(packed), *shape) for shape, columns in parts)


def packed_robots(columns: Mapping[str, Floats]) -> tuple[Floats, Floats]:
    """Return robots by column name, each (M,), for the compiled loops: groups (M, 9), and (M, ROBOT_NUMBERS).

    Raises:
        InputError: an effect changes the tails themselves.
    """
    groups = np.array([columns[name] for name in ROBOT]).T.copy()
    if any(size.any() for name, size in columns.items() if name not in ROBOT):
        return groups, pack_robots(robots_of(columns))
    return groups, robots_of_groups(groups)


@np.errstate(all="ignore")  # a robot that cannot be has no motion, and is refused for that
def robots_of(columns: Mapping[str, Floats]) -> RobotColumns:
    """Return robots by column name, each (M,), a_over_R and effects included.

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
    spin_drag = resistance[:, 3, 3]
    gain = 1 + body.droop * spin_drag
    entries = resistance[:, [0, 1, 2, 3, 0, 0, 3, 2], [0, 1, 2, 3, 2, 3, 4, 4]].T
    numbers: Any = (*entries, body.head_length, gain, count * body.zeta_perp, body.offset)
    head = inputs_of_head(*numbers)
    return RobotColumns(
        np.abs(body.omega), gain, resistance, body.head_length, sense, body.zeta_perp, body.zeta_parallel,
        body.offset, body.tail_radius, count, spin_drag, np.stack(head, -1),
    )  # fmt: skip


@compiled_fast
def robots_of_groups(groups: Floats) -> Floats:
    """Return robots without effects as `pack_robots` packs them, (M, ROBOT_NUMBERS).

    Args:
        groups: (M, 9), in the order of `surrogate.domain.ROBOT`.
    """
    robots = np.empty((len(groups), ROBOT_NUMBERS))
    for row in range(len(groups)):
        C_t, C_r, C_yr, l_over_R, L_over_R, l_over_r0, speed, number, a_over_R = groups[row]
        radius, robot = 1 / l_over_R, robots[row]
        length, offset = L_over_R * radius, a_over_R * radius
        parallel, perp = tail_coefficients(l_over_r0)
        resistance, head = robot[PLACES.resistance], robot[PLACES.head]
        robot[PLACES.speed], robot[PLACES.gain] = abs(speed), 1.0
        for i, numbers in enumerate(head_resistance(C_t, C_r, C_yr, radius, length)):
            for j, value in enumerate(numbers):
                resistance[5 * i + j] = value
        robot[PLACES.head_length], robot[PLACES.sense] = length, 1.0 if speed > 0 else -1.0
        robot[PLACES.perp], robot[PLACES.parallel] = perp, parallel
        robot[PLACES.offset], robot[PLACES.radius] = offset, 1 / l_over_r0
        robot[PLACES.number], robot[PLACES.spin_drag] = number, resistance[18]
        around = inputs_of_head(
            resistance[0], resistance[6], resistance[12], resistance[18], resistance[2], resistance[3],
            resistance[19], resistance[14], length, 1.0, number * perp, offset,
        )  # fmt: skip
        for i, value in enumerate(around):
            head[i] = value
    return robots


def needs_no_learning(effect: str) -> bool:
    """Return whether an effect enters the balance by algebra: it changes head, disc, motor, or all drag alike."""
    entry = effect_named(effect)
    return entry.reach == "local" and entry.term not in _ON_TAILS


@formula
def inputs_of_head(
    sway: Any, surge: Any, turn: Any, spin: Any, coupling: Any, side: Any, disc: Any, couple: Any,
    length: Any, gain: Any, across: Any, offset: Any,
) -> tuple[Any, ...]:  # fmt: skip
    """Return HEAD_INPUTS.

    Args:
        sway, surge, turn, spin: the diagonal of the resistance of head and disc.
        coupling, side, disc, couple: its entries for sway and turn, sway and ω_h, spin and ω_t, turn and ω_t.
        length, gain, across, offset: L, ∂ω_t/∂ω_h, N ζ⊥ and a.
    """
    return (
        np.log(sway / across),
        np.log(surge / across),
        np.log(turn / across),
        np.log(length),
        coupling / np.sqrt(sway * turn),
        np.log(side / across),
        disc / spin,
        couple / (across * offset**2),
        np.log(gain),
    )


@formula
def linear_thrust(S: Any) -> Any:
    """Return T: thrust/[(ζ⊥ − ζ∥) ω_t a²] of a tail in linear theory, roughly."""
    return THRUST * S / (1 + (S / THRUST_SOFT) ** THRUST_POWER)


@formula
def linear_torque(S: Any) -> Any:
    """Return Q: torque/[ζ⊥ ω_t a²] of a tail in linear theory, roughly."""
    return (1 + (S / TORQUE_SOFT) ** 2) ** TORQUE_POWER


@formula
def inputs_of_tail(
    perp: Any, offset: Any, radius: Any, number: Any, spin_drag: Any, motion: Any, beta: Any
) -> tuple[Any, ...]:
    """Return INPUTS.

    Args:
        perp, offset, radius, number, spin_drag: ζ⊥, a, r0, N and the moment on the head per ω_h.
        motion: (v_x of J, v_z, ω_yr, ω_h, ω_t), for a positive motor.
        beta: the angle β.
    """
    v_x, v_z, yaw, spin = motion[0], motion[1], motion[2], motion[4]
    drag_number = perp * spin
    deflection = np.sqrt(v_x**2 + yaw**2 + TINY) / spin * drag_number / (drag_number + SOFT)
    return (
        np.log(drag_number),
        np.log(offset),
        -np.log(radius),
        np.arcsinh(deflection / SMALL_DEFLECTION),
        beta,
        np.arcsinh(v_z / (offset * spin) / SMALL_SURGE),
        np.log(spin_drag / (number * perp * offset**2)),
    )


@formula
def inputs_of_pair(tail: Any, head: Any) -> tuple[Any, ...]:
    """Return PAIR_INPUTS from INPUTS (7, …) and HEAD_INPUTS (9, …)."""
    spin = tail[6] + np.log(np.exp(-head[8]) + head[6])
    return tail[0], tail[1], tail[2], tail[3], tail[4], tail[5], spin, head[0], head[1], head[2], head[4]


@formula
def inputs_of_single(perp: Any, offset: Any, radius: Any, spin_drag: Any, spin: Any) -> tuple[Any, ...]:
    """Return the SINGLE_INPUTS before those of the head.

    Args:
        perp, offset, radius, spin_drag: ζ⊥, a, r0 and the moment on the head per ω_h.
        spin: ω_t.
    """
    return np.log(perp * spin), np.log(offset), -np.log(radius), np.log(spin_drag / (perp * offset**2))


@formula
def wrench_terms(perp: Any, parallel: Any, offset: Any, number: Any, motion: Any) -> tuple[Any, ...]:
    """Return the terms of the tails' wrench.

    Returns:
        F_x, F_z and M_y of straight tails; then what y multiplies: the side force (F_x and M_y), thrust and torque
        at small m, and m².
    """
    v_x, v_z, yaw, spin = motion[0], motion[1], motion[2], motion[4]
    across = number * perp
    sideways = np.sqrt(v_x**2 + yaw**2 + TINY)
    couple = number * spin * offset**2
    return (
        across * (yaw / 2 - v_x),
        -number * parallel * v_z,
        across * (v_x / 2 - yaw / 3),
        across * sideways,
        (perp - parallel) * couple * linear_thrust(perp * spin),
        -perp * couple * linear_torque(perp * spin),
        (sideways / (offset * spin)) ** 2,
    )


def straight_resistance(robots: RobotColumns) -> Floats:
    """Return the resistance of straight tails to (v_x, v_z, ω_yr), (M, 3, 3)."""
    across, along = robots.number * robots.perp, robots.number * robots.parallel
    none = np.zeros(len(across))
    rows = [[across, none, -across / 2], [none, along, none], [-across / 2, none, across / 3]]
    return np.stack([np.stack(row, -1) for row in rows], -2)


def network_inputs(robots: RobotColumns, motion: Floats, count: int) -> Floats:
    """Return the inputs of a network of the wrench that has so many, (M, F): SINGLE_, PAIR_INPUTS or INPUTS.

    Args:
        robots: M of them.
        motion: (v_x of J, v_z, ω_yr, ω_h, ω_t) for a positive motor, (M, 5).
        count: F.
    """
    perp, offset, radius, spin_drag = robots.perp, robots.offset, robots.radius, robots.spin_drag
    if count == len(SINGLE_INPUTS):
        single = inputs_of_single(perp, offset, radius, spin_drag, motion[:, 4])
        return np.concatenate([np.stack(single, -1), robots.head], -1)
    beta = np.arctan2(motion[:, 0], motion[:, 2])
    tail = inputs_of_tail(perp, offset, radius, robots.number, spin_drag, motion.T, beta)
    return np.stack(inputs_of_pair(tail, robots.head.T) if count == len(PAIR_INPUTS) else tail, -1)


def wrench_slopes(robots: RobotColumns, motion: Floats) -> Floats:
    """Return ∂(wrench)/∂y at motions (M, 5), (M, 4, 6)."""
    *_, force, thrust, torque, squared = wrench_terms(
        robots.perp, robots.parallel, robots.offset, robots.number, motion.T
    )
    slopes = np.zeros((len(force), 4, 6))
    for (row, column), slope in {
        (0, 0): force, (1, 1): thrust, (1, 4): thrust * squared, (2, 2): force, (3, 3): torque,
        (3, 5): torque * squared,
    }.items():  # fmt: skip
        slopes[:, row, column] = slope
    return slopes


def motion_sensitivity(robots: RobotColumns, motion: Floats) -> Floats:
    """Return ∂(relative motion)/∂(wrench) with the drag of straight tails, (M, 4, 4)."""
    matrix = robots.resistance[:, :, :4].copy()
    matrix[:, :, 3] += robots.gain[:, None] * robots.resistance[:, :, 4]
    matrix[:, :3, :3] += straight_resistance(robots)
    drag_number = robots.perp * motion[:, 4]
    torque = robots.number * robots.perp * robots.offset**2 * linear_torque(drag_number)
    matrix[:, 3, 3] += robots.gain * torque
    v_x, v_z, yaw, head_spin, spin = motion.T
    speed = np.hypot(v_x, v_z)
    size = np.stack(
        [
            np.hypot(v_x, yaw / 2),
            np.maximum(np.abs(v_z), MIN_SURGE * speed),
            np.abs(yaw),
            np.minimum(np.abs(head_spin), spin) / 3,
        ],
        -1,
    )
    return np.linalg.inv(matrix) / size[:, :, None]
