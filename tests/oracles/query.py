"""A query of the look-up table with arrays: reference for its compiled loops. Robots are the last axis.

Networks, balance by Broyden's method, support, outputs, response at equal dwells, intervals and domain, written
from the formulas. Only the robots' numbers come from the package (`surrogate.tails.robots_of`).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from sim.inputs import check_columns
from sim.mechanics import planar
from sim.model.groups import DWELL
from sim.model.response import DWELLS
from sim.motion.steady_motion import STEADY_OUTPUTS
from surrogate import tails
from surrogate.domain import Support, products_of
from surrogate.held_out import RESPONSE_OUTPUTS, error_scale
from surrogate.network import Ensemble
from surrogate.table import NeuralTable

STEPS, CORRECTION, ACCEPTED = 60, 2e-12, 1e-9
RANGES = ("omega_bar", "l_over_R", "l_over_r0", "a_over_R")


class PositiveRobots(NamedTuple):
    """Numbers of M robots, seen with a positive motor."""

    own: tails.RobotColumns
    R: Any  # (4, 5, M)
    drag: Any  # (4, 5, M), with straight tails

    def at(self, rows: Any) -> PositiveRobots:
        return PositiveRobots(self.own.at(rows), self.R[..., rows], self.drag[..., rows])


def robots_of(values: dict[str, Any]) -> PositiveRobots:
    own = tails.robots_of(values)
    R, straight, across = (
        own.resistance.transpose(1, 2, 0),
        np.zeros((4, 5, len(own.number))),
        own.number * own.perp,
    )
    straight[0, 0], straight[1, 1], straight[2, 2] = across, own.number * own.parallel, across / 3
    straight[0, 2] = straight[2, 0] = -across / 2
    return PositiveRobots(own, R, R + straight)


def members(network: Ensemble, x: Any) -> Any:
    """Return what each member answers, (K, O, M), at inputs (F, M)."""
    h = x = (x.T - network.shift) / network.scale
    for weight, bias in zip(network.weights[:-1], network.biases[:-1], strict=True):
        h = np.tanh(h @ weight + bias)
    y = (h @ network.weights[-1] + network.biases[-1] + x @ network.bypass) * network.spread + network.mean
    return y.transpose(0, 2, 1)


def thrust(S: Any) -> Any:
    return 0.125 * S / (1 + (S / 8.0) ** 1.35)


def torque(S: Any) -> Any:
    return (1 + (S / 6.0) ** 2) ** -0.125


def side_speed(u: Any) -> Any:
    return np.sqrt(u[0] ** 2 + u[2] ** 2 + 1e-30)


def tail_inputs(r: PositiveRobots, u: Any) -> Any:
    """Return the inputs of networks, (7, M), at motions u (5, M)."""
    t, S = r.own, r.own.perp * u[4]
    deflection = side_speed(u) / u[4] * S / (S + 12.0)
    own = np.log(t.spin_drag / (t.number * t.perp * t.offset**2))
    bent, ahead = np.arcsinh(20.0 * deflection), np.arcsinh(20.0 * u[1] / (t.offset * u[4]))
    return np.array([np.log(S), np.log(t.offset), -np.log(t.radius), bent, np.arctan2(u[0], u[2]), ahead, own])


def single_inputs(r: PositiveRobots, u: Any) -> Any:
    """Return the inputs of the network of one tail, (13, M)."""
    return np.concatenate([tail_inputs(r, u)[[0, 1, 2, 6]], r.own.head.T])


def pair_inputs(r: PositiveRobots, u: Any) -> Any:
    """Return the inputs of the network of two tails, (11, M)."""
    t, x, (sway, surge, turn, _) = r.own, tail_inputs(r, u), r.R[[0, 1, 2, 3], [0, 1, 2, 3]]
    across, spin = t.number * t.perp, r.R[3, 3] / t.gain + r.R[3, 4]
    drags = np.log([spin / t.offset**2 / across, sway / across, surge / across, turn / across])
    return np.array([*x[:6], *drags, r.R[0, 2] / np.sqrt(sway * turn)])


INPUTS = {13: single_inputs, 11: pair_inputs, 7: tail_inputs}  # of networks, by their number


def residual(r: PositiveRobots, u: Any, y: Any) -> Any:
    """Return the wrench of the tails less that on the head, (4, ..., M), at motions u (5, ..., M)."""
    t, S, side = r.own, r.own.perp * u[4], side_speed(u)
    force, couple, m2 = (
        t.number * t.perp * side,
        t.number * u[4] * t.offset**2,
        (side / (t.offset * u[4])) ** 2,
    )
    along = (t.perp - t.parallel) * couple * thrust(S) * (y[1] + m2 * y[4])
    push = np.array([force * y[0], along, force * y[2], -t.perp * couple * torque(S) * (y[3] + m2 * y[5])])
    return push - np.einsum("ijm,j...m->i...m", r.drag, u)


def first_guess(r: PositiveRobots) -> Any:
    """Return motions (5, M) of linear theory."""
    t, gain, speed, spin = r.own, r.own.gain, r.own.speed, 0.6 * r.own.speed
    for _ in range(3):
        pull = t.number * t.perp * t.offset**2 * torque(t.perp * spin)
        spin = speed * r.R[3, 3] / (r.R[3, 3] + gain * (pull + r.R[3, 4]))
    head = (spin - speed) / gain
    push = -r.R[:3, 3] * head - r.R[:3, 4] * spin
    push[1] += t.number * (t.perp - t.parallel) * t.offset**2 * spin * thrust(t.perp * spin)
    return np.array([*np.linalg.solve(r.drag[:3, :3].transpose(2, 0, 1), push.T[..., None])[..., 0].T, head, spin])


def solve(network: Ensemble, r: PositiveRobots) -> tuple[Any, Any]:
    """Return motions (5, M) in balance, and which were found."""
    inputs = INPUTS[network.shape["inputs"]]
    u, rows = first_guess(r), np.arange(len(r.own.speed))
    motion, size, y = np.empty_like(u), np.empty(len(rows)), members(network, inputs(r, u)).mean(0)
    width = 1e-6 * (np.abs(u[:4]) + 1e-3 * np.abs(u[:4]).max(0))
    moved = np.repeat(u[:, None], 5, 1)
    for j in range(4):
        moved[j, j] += width[j]
    moved[4] = r.own.speed + r.own.gain * moved[3]
    at = residual(r, moved, y)
    left, slope = at[:, 4], ((at[:, :4] - at[:, 4:]) / width).transpose(2, 0, 1)
    slope = np.where(np.isfinite(slope), slope, np.eye(4))  # a robot that cannot be: it fails below
    inverse = np.linalg.inv(slope).transpose(1, 2, 0)
    for count in range(STEPS):
        step = -np.einsum("ijm,jm->im", inverse, left)
        step *= np.minimum(0.5 * u[4] / np.abs(r.own.gain * step[3]), 1.0)
        u[:4] += step
        u[4] = r.own.speed + r.own.gain * u[3]
        speed = np.hypot(u[0], u[1]) + np.abs(u[2])
        now = np.abs(step / np.array([speed, speed, u[2], u[3]])).max(0)
        some = np.flatnonzero((now >= CORRECTION) & np.isfinite(now) & (u[4] > 0))
        motion[:, rows], size[rows] = u, np.where(u[4] > 0, now, np.nan)
        if count + 1 == STEPS or not len(some):
            break
        rows, r, u, left, inverse, step = rows[some], r.at(some), *(p[..., some] for p in (u, left, inverse, step))
        before, left = left, residual(r, u, members(network, inputs(r, u)).mean(0))
        change, along = left - before, np.einsum("im,ijm->jm", step, inverse)
        missed = step - np.einsum("ijm,jm->im", inverse, change)
        inverse = inverse + (missed / (np.einsum("im,im->m", along, change) + 1e-300))[:, None] * along
    return motion, size < ACCEPTED


def novelty_of(support: Support, inputs: Any) -> Any:
    """Return the novelty, (M,), at inputs (F, M)."""
    x, features = (inputs.T - support.shift) / support.scale, [np.ones(inputs.shape[1])]
    for parent, factor in products_of(len(support.shift)).T[1:]:
        features.append(features[parent] * x[:, factor])
    q = (np.linalg.solve(support.factor, np.array(features)) ** 2).mean(0) / support.limit
    away = np.abs(x).max(1)
    return np.where(away > 1.02, np.fmax(q, away), q)


@np.errstate(all="ignore")
def answer(table: NeuralTable, columns: dict[str, Any]) -> dict[str, Any]:
    """Return outputs of robots (M,), their half-widths, and who is outside; with a dwell also the response."""
    values = check_columns({name: array for name, array in columns.items() if name != DWELL})
    kind, parts = np.minimum(values["N"], 3).astype(int) - 1, []
    box = np.array([table.ranges[name] for name in RANGES])
    sizes = np.abs([values[name] for name in RANGES])
    within = ((sizes >= box[:, :1] * (1 - 1e-9)) & (sizes <= box[:, 1:] * (1 + 1e-9))).all(0)
    for k in sorted(set(kind.tolist())):
        rows = np.flatnonzero(kind == k)
        dwells = columns[DWELL][rows] if DWELL in columns else None
        parts.append(_part(table, k, robots_of({n: v[rows] for n, v in values.items()}), within[rows], dwells))
    order = np.argsort(np.argsort(kind, kind="stable"), kind="stable")
    return {name: np.concatenate([part[name] for part in parts])[order] for name in parts[0]}


def _part(table: NeuralTable, k: int, r: PositiveRobots, within: Any, dwells: Any) -> dict[str, Any]:
    """Answer for robots with one network."""
    network, support, sense = table.tails.wrench[k], table.support[k], r.own.sense
    assert network is not None
    assert support is not None
    u, found = solve(network, r)
    x, own = tail_inputs(r, u), INPUTS[network.shape["inputs"]](r, u)
    novelty, number = novelty_of(support, own), r.own.number
    outside = ~(found & within & (novelty <= 1) & (np.abs(u[2]) <= 0.6 * np.abs(u[4])))
    sway, surge, yaw = u[0] + u[2] * r.own.head_length / 2, u[1], u[2]
    share = members(table.tails.gap, np.array([*x, np.log(number)]))[:, 0].mean(0)
    gap = np.where(number > 1, share * r.own.offset * np.sin(np.pi / number) / r.own.radius, np.inf)
    radius, slip = np.hypot(sway, surge) / np.abs(yaw), np.degrees(np.arctan2(np.abs(sway), surge))
    steady = (sense * u[4], sense * u[3], sense * yaw, sense * sway, surge, radius, slip, gap)
    result: dict[str, Any] = dict(zip(STEADY_OUTPUTS, steady, strict=True))
    if dwells is not None:
        result |= _response(table, np.array([surge, sway, yaw]), x, r, dwells)
    members_of = members(network, own)
    apart = (members_of - members_of.mean(0)).transpose(0, 2, 1)[..., None]
    weight = tails.motion_sensitivity(r.own, u.T) @ tails.wrench_slopes(r.own, u.T)
    spread = np.linalg.norm((weight @ apart)[..., 0], axis=-1).mean(0)
    extra = [np.log(novelty + 1e-12), np.log(spread + 1e-9), np.log(number), np.full(len(number), k == 0)]
    widths = _half_widths(table, np.nan_to_num(np.array([*x, *extra])), r, result)
    return {**result, **{f"{name}_half": half for name, half in widths.items()}, "outside": outside}


def _response(table: NeuralTable, twist: Any, x: Any, r: PositiveRobots, T: Any) -> dict[str, Any]:
    """Return RESPONSE_OUTPUTS at equal dwells T (M,); the twist is (surge, sway, yaw rate), (3, M)."""
    own = np.array([*x, *r.own.head.T[[0, 1, 2, 3, 5, 6]], np.log(r.own.number), r.own.number == 2])
    lag, memory = (members(network, own).mean(0).T for network in table.curves.networks[:2])
    basis = table.curves.equal_dwells
    curves = basis.mean + np.concatenate([lag, memory], 1)[:, : len(basis.vectors)] @ basis.vectors
    at, knots = np.log(np.minimum(T, DWELLS[-1])), np.log(DWELLS)
    z = np.empty((3, len(T)))
    for row, curve in enumerate(curves.reshape(len(T), len(DWELLS), 3)):
        first = int(np.clip(np.searchsorted(knots, at[row]) - 2, 0, len(knots) - 4))
        near = slice(first, first + 4)
        z[:, row] = np.linalg.solve(np.vander(knots[near] - at[row], 4), curve[near])[-1]  # of the cubic, at zero
    z *= [np.hypot(twist[0], 0.1 * twist[1]), twist[1], twist[2]]
    speed = planar.net_speed(twist.T, z.T, T)
    return dict(zip(RESPONSE_OUTPUTS, (speed, *z[::-1]), strict=True))


def _half_widths(table: NeuralTable, features: Any, r: PositiveRobots, result: dict[str, Any]) -> dict[str, Any]:
    """Return half of the widths of the intervals by output, (M,) each, from features (11, M)."""
    w, widths = table.intervals, {}
    assert w is not None
    third = 24 * (r.R[2, 4] != 0) + 3 * (r.own.number.astype(int) - 1) + np.searchsorted(w.speeds, r.own.speed)
    group = 2 * third + (features[7] > w.middle[third])
    z, pairs = np.clip((features.T - w.shift) / w.scale, -5, 5), np.triu_indices(len(features))
    design = np.column_stack([np.ones(len(z)), z, z[:, pairs[0]] * z[:, pairs[1]]])
    for name in [name for name in result if name in w.factor]:
        local = np.exp(np.clip(design @ w.weights[name], *w.bounds[name]))
        half = np.resize(w.factor[name], 96)[group] * local * error_scale(name, result)
        widths[name] = np.where(np.isfinite(result[name]), half, 0.0)
    return widths
