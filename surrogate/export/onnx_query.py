"""The whole query of the look-up table as one ONNX graph, for other languages and runtimes.

Inputs are the nine groups of M robots without effects, outputs the steady motion and `outside`, which says that a
robot is outside the domain. The graph solves the balance of forces as `surrogate.wrench.balance` does, with the
same stopping rule, so answers agree to 1e-8 of themselves. Left out: effects, intervals, the response to a flip.
Needs the package onnx (the extra `onnx`).
"""

from __future__ import annotations

import json
import math
from itertools import combinations, combinations_with_replacement
from pathlib import Path
from typing import Any

import numpy as np

from sim.io.errors import InputError
from sim.io.files import whole_file
from sim.motion.steady_motion import STEADY_OUTPUTS
from surrogate.input_ranges import ROBOT
from surrogate.networks.ensemble import Ensemble
from surrogate.table import lookup
from surrogate.table.lookup import OUTSIDE, NeuralTable
from surrogate.table.support import DEGREE
from surrogate.wrench import balance
from surrogate.wrench.tails import SMALL_DEFLECTION, SMALL_SURGE, SOFT, TINY, TYPICAL, linear_thrust, linear_torque

UNITS = {
    "C_t": "1", "C_r": "1", "C_yr": "1", "l_over_R": "1", "L_over_R": "1", "l_over_r0": "1",
    "omega_bar": "EI/(mu0 l^4), signed", "N": "1, a whole number", "a_over_R": "1",
    "omega_t_bar": "EI/(mu0 l^4)", "omega_h_bar": "EI/(mu0 l^4)", "omega_yr_bar": "EI/(mu0 l^4)",
    "v_x": "EI/(mu0 l^3)", "v_z": "EI/(mu0 l^3)", "R_yr_over_l": "l", "theta_deg": "degree", "tail_gap": "2 r0",
    OUTSIDE: "flag: the table has not learned this robot",
}  # fmt: skip


def save_onnx(table: NeuralTable, path: str | Path) -> None:
    """Write the query of a table as an ONNX file.

    Raises:
        InputError: the package onnx is not installed.
    """
    try:
        from surrogate.export.onnx_builder import Builder
    except ModuleNotFoundError as missing:
        raise InputError(
            f"an ONNX file needs the package {missing.name}; install it with pip install 'softflagella[onnx]'"
        ) from None
    data = _Query(Builder(), table).model().SerializeToString(deterministic=True)
    with whole_file(path) as part:
        part.write_bytes(data)


class _Query:
    """The formulas of `wrench.heads`, `wrench.tails` and `table.wrench_table`, as nodes of a graph.

    Robots are sorted by the network that they need. Values have the axes (K, M, …): K trial motions of M robots.
    """

    def __init__(self, graph: Any, table: NeuralTable):
        self.g, self.table = graph, table
        columns = {name: graph.input(name, ("robots",), UNITS[name]) for name in ROBOT}
        self._sort(columns["N"])
        own = {name: graph.gather(column, self.order, 0) for name, column in columns.items()}
        self.own, self.N = own, own["N"]
        self.sense, self.speed = graph.op("Sign", own["omega_bar"]), graph.abs(own["omega_bar"])
        slender = graph.log(own["l_over_r0"])
        self.along, self.across = 2 * math.pi / (slender - 0.5), 4 * math.pi / (slender + 0.5)
        radius = 1 / own["l_over_R"]
        self.length = own["L_over_R"] * radius
        self.offset = own["a_over_R"] * radius
        self.drag = 6 * math.pi * own["C_t"] * radius  # of the head, across and along
        self.spin_drag = 8 * math.pi * own["C_r"] * radius * radius * radius
        self.side = own["C_yr"] * radius * self.length

    def _sort(self, count: Any) -> None:
        """Order of the robots by network, and the way back."""
        g = self.g
        kind = g.minimum(g.maximum(count, 1.0), 3.0)
        parts = []
        for k in (1.0, 2.0, 3.0):
            own = (kind < k + 0.5) & (kind > k - 0.5)
            parts.append(g.reshape(g.op("NonZero", own), [-1]))
        self.order = g.concat(parts, 0)
        self.counts = g.concat([g.op("Shape", part) for part in parts], 0)
        self.back = g.ops("TopK", 2, self.order, g.op("Shape", self.order), axis=0, largest=0)[1]

    def model(self) -> Any:
        g = self.g
        u, converged = self._solved()
        outputs, outside = self._outputs(u, converged)
        for name, value in outputs.items():
            g.output(name, g.gather(value, self.back, 0), ("robots",), UNITS[name])
        g.output(OUTSIDE, g.gather(outside, self.back, 0), ("robots",), UNITS[OUTSIDE], flag=True)
        metadata = {
            "table": self.table.identity,
            "units": json.dumps({name: UNITS[name] for name in (*ROBOT, *STEADY_OUTPUTS, OUTSIDE)}),
            "domain": json.dumps(self.table.ranges),
            "errors": json.dumps(self.table.errors),
        }
        words = "Steady motion of soft flagellated robots; lengths in tail lengths l, times in mu0 l^4/EI."
        return g.model("softflagella", words, metadata)

    # ---- the balance of forces

    def _networks(self, inputs: Any, networks: Any, width: int) -> Any:
        """Numbers (K, M, width) of networks, one for each group of sorted robots."""
        groups = self.g.ops("Split", len(networks), inputs, self.counts, axis=1)
        found = []
        for network, part in zip(networks, groups, strict=True):
            if network is None:
                unknown = self.g.gather(part, [0] * width)
                found.append(unknown * np.nan)
            else:
                own = list(range(network.shape["inputs"]))
                found.append(self._network(network, self.g.gather(part, own)))
        return self.g.concat(found, 1)

    def _network(self, network: Ensemble, inputs: Any) -> Any:
        g, state = self.g, {name: part.detach().numpy() for name, part in network.state_dict().items()}
        first = (inputs - state["shift"]) / state["scale"]
        depth, members = network.shape["depth"], network.shape["members"]
        total = 0.0
        for k in range(members):
            hidden = first
            for i in range(depth):
                hidden = g.tanh(hidden @ state[f"weights.{i}"][k] + state[f"biases.{i}"][k])
            last = hidden @ state[f"weights.{depth}"][k] + state[f"biases.{depth}"][k]
            total = last + first @ state["bypass"][k] + total
        return total * (state["spread"] / members) + state["mean"]

    def _tail_inputs(self, motion: Any) -> Any:
        g = self.g
        v_x, v_z, yaw, _, spin = motion
        drag_number = self.across * spin
        sideways = g.sqrt(v_x * v_x + yaw * yaw + TINY)
        deflection = sideways / spin * drag_number / (drag_number + SOFT)
        like = 0.0 * spin  # gives all inputs the same axes
        return g.stack(
            [
                g.log(drag_number),
                g.log(self.offset) + like,
                g.log(self.own["l_over_r0"]) + like,
                g.asinh(deflection / SMALL_DEFLECTION),
                g.atan2(v_x, yaw),
                g.asinh(v_z / (self.offset * spin) / SMALL_SURGE),
                g.log(self.spin_drag / (self.N * self.across * self.offset * self.offset)) + like,
            ]
        )

    def _head_inputs(self, like: Any) -> Any:
        """`tail.head_inputs` of robots without effects; `like` gives all inputs the same axes."""
        g = self.g
        total = self.N * self.across
        drag, length = g.log(self.drag / total) + like, g.log(self.length) + like
        turning = drag + 2 * (length - math.log(2))
        return g.stack([drag, drag, turning, length, 1 + like, g.log(self.side / total) + like, like])

    def _motion(self, u: Any) -> Any:
        v_x, v_z, yaw, head_spin = (self.g.gather(u, i) for i in range(4))
        return v_x, v_z, yaw, head_spin, self.speed + head_spin

    def _numbers(self, u: Any) -> Any:
        """Numbers of the tails (K, M, 6) at the velocities u (K, M, 4)."""
        motion = self._motion(u)
        inputs = self.g.concat([self._tail_inputs(motion), self._head_inputs(0.0 * motion[4])], -1)
        return self._networks(inputs, self.table.tails.wrench, len(TYPICAL[0]))

    def _unbalanced(self, u: Any, numbers: Any) -> Any:
        """Forces and moments (K, M, 4) that are left at the velocities u (K, M, 4)."""
        g = self.g
        v_x, v_z, yaw, head_spin, spin = self._motion(u)
        y = [g.gather(numbers, i) for i in range(len(TYPICAL[0]))]
        S, across = self.across * spin, self.N * self.across
        sideways = g.sqrt(v_x * v_x + yaw * yaw + TINY)
        squared = sideways / (self.offset * spin)
        squared = squared * squared
        couple = self.N * spin * self.offset * self.offset
        force = across * sideways
        thrust = (self.across - self.along) * couple * linear_thrust(S)
        torque = self.across * couple * linear_torque(S)
        lever = 0.5 * self.length
        on_head = self.drag * (v_x + lever * yaw) + self.side * head_spin
        return g.stack(
            [
                across * (0.5 * yaw - v_x) + force * y[0] - on_head,
                thrust * (y[1] + squared * y[4]) - (self.N * self.along + self.drag) * v_z,
                across * (0.5 * v_x - yaw / 3) + force * y[2] - lever * on_head,
                -torque * (y[3] + squared * y[5]) - self.spin_drag * head_spin,
            ]
        )

    def _guess(self) -> Any:
        """Velocities (1, M, 4) of linear theory, see `surrogate.wrench.balance`."""
        g = self.g
        across = self.N * self.across
        spin = balance._FIRST_SPIN * self.speed
        for _ in range(3):
            torque = across * self.offset * self.offset * linear_torque(self.across * spin)
            spin = self.speed * self.spin_drag / (self.spin_drag + torque)
        head_spin = spin - self.speed
        thrust = self.N * (self.across - self.along) * spin * self.offset * self.offset
        v_z = thrust * linear_thrust(self.across * spin) / (self.drag + self.N * self.along)
        lever = 0.5 * self.length
        a, b, d = self.drag + across, self.drag * lever - 0.5 * across, self.drag * lever * lever + across / 3
        push = -(self.side * head_spin)
        v_x = push * (d - b * lever) / (a * d - b * b)
        yaw = push * (a * lever - b) / (a * d - b * b)
        return g.op("Unsqueeze", g.stack([v_x, v_z, yaw, head_spin]), np.array([0], dtype=np.int64))

    def _solved(self) -> tuple[Any, Any]:
        """Velocities (1, M, 4) in balance, and which robots converged, (M,), as in `surrogate.wrench.balance`."""
        g, guess = self.g, self._guess()
        u, found = self._solved_from(guess, exact=False)
        other, again = self._solved_from(guess, exact=True)

        def off(motion: Any) -> Any:
            return g.abs(g.gather(g.gather(motion - guess, 0, 0), 1))

        better = (self.N < 1.5) & again & ((off(other) < off(u)) | ~found)
        return g.where(g.op("Unsqueeze", better, np.array([0, 2], dtype=np.int64)), other, u), found | better

    def _solved_from(self, u: Any, *, exact: bool) -> tuple[Any, Any]:
        """The same from a first guess, with the derivative of the networks as well, or without."""
        g = self.g
        done = ~g.finite(g.gather(g.gather(u, 0, 0), 0))  # none

        def goes_on(done: Any) -> Any:
            return g.op("Cast", g.any(~done), to=9)

        def step(u: Any, inverse: Any, left: Any, done: Any) -> tuple[Any, ...]:
            way = self._shortened(u, self._times(inverse, left))
            way = g.where(g.op("Unsqueeze", done, np.array([0, 2], dtype=np.int64)), 0.0, way)
            after = u - way
            done = done | (self._relative(way, after) < balance.CORRECTION)
            now = self._unbalanced(after, self._numbers(after))
            return goes_on(done), after, self._updated(inverse, -way, now - left), now, done

        left, inverse = self._left_and_inverse(u, exact=exact)
        u, _, _, done = g.loop(balance.STEPS, goes_on(done), (u, inverse, left, done), step, "dddb")
        return u, done

    def _times(self, matrix: Any, vector: Any) -> Any:
        """(M, 4, 4) times (1, M, 4)."""
        last = np.array([3], dtype=np.int64)
        return self.g.op("Squeeze", matrix @ self.g.op("Unsqueeze", vector, last), last)

    def _left_and_inverse(self, u: Any, *, exact: bool) -> tuple[Any, Any]:
        """What is unbalanced (1, M, 4), and the inverse of its derivative (M, 4, 4); if it need not be exact, with
        the tails' numbers held.
        """
        g = self.g
        largest = g.op("ReduceMax", g.abs(u), np.array([2], dtype=np.int64), keepdims=1)
        width = balance._DIFFERENCE * (g.abs(u) + balance._LEAST_SHARE * largest)
        trials = np.concatenate([np.zeros((1, 1, 4)), np.eye(4)[:, None, :]])
        moved = u + width * trials
        left = self._unbalanced(moved, self._numbers(moved if exact else u))
        first = g.gather(left, [0], 0)
        change = g.op("Transpose", g.gather(left, [1, 2, 3, 4], 0) - first, perm=[1, 2, 0])  # (M, 4, 4)
        slope = change / g.op("Transpose", width, perm=[1, 0, 2])
        return first, self._inverse(slope)

    def _inverse(self, matrix: Any) -> Any:
        """Of (M, 4, 4), by the minors of its upper and its lower half."""
        g = self.g
        flat = g.reshape(matrix, [-1, 16])
        pairs = [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)]

        def minors(row: int) -> Any:
            first, second = ([4 * row + p[i] for p in pairs] for i in (0, 1))
            below = [place + 4 for place in second], [place + 4 for place in first]
            return g.gather(flat, first) * g.gather(flat, below[0]) - g.gather(flat, second) * g.gather(
                flat, below[1]
            )

        upper, lower = minors(0), minors(2)
        size = g.sum(upper * g.gather(lower, [5, 4, 3, 2, 1, 0]) * np.array([1.0, -1, 1, 1, -1, 1]), -1)
        both = g.concat([upper, lower], -1)
        total = 0.0
        for entries, others, signs in _COFACTORS:
            total = g.gather(flat, entries) * g.gather(both, others) * signs + total
        return g.reshape(total / g.op("Unsqueeze", size, np.array([1], dtype=np.int64)), [-1, 4, 4])

    def _shortened(self, u: Any, way: Any) -> Any:
        g = self.g
        change = g.abs(g.gather(way, [3])) / (g.op("Unsqueeze", self.speed, np.array([1])) + g.gather(u, [3]))
        return way * g.minimum(balance._LONGEST / change, 1.0)

    def _relative(self, way: Any, u: Any) -> Any:
        """Size of a correction, (M,)."""
        g = self.g
        way, u = g.gather(way, 0, 0), g.gather(u, 0, 0)
        (a, b, c, d), (v_x, v_z, yaw, spin) = ([g.gather(part, i) for i in range(4)] for part in (way, u))
        moved = g.maximum(g.abs(a), g.abs(b)) / (g.sqrt(v_x * v_x + v_z * v_z) + g.abs(yaw))
        return g.maximum(moved, g.maximum(g.abs(c / yaw), g.abs(d / spin)))

    def _updated(self, inverse: Any, way: Any, change: Any) -> Any:
        g = self.g
        way, change = g.gather(way, 0, 0), g.gather(change, 0, 0)
        column, row = np.array([2], dtype=np.int64), np.array([1], dtype=np.int64)
        along = g.op("Unsqueeze", way, row) @ inverse  # (M, 1, 4)
        size = along @ g.op("Unsqueeze", change, column)
        missed = g.op("Unsqueeze", way, column) - inverse @ g.op("Unsqueeze", change, column)
        update = missed * along / size
        return inverse + g.where(g.finite(update), update, 0.0)

    # ---- what comes out

    def _outputs(self, u: Any, converged: Any) -> tuple[dict[str, Any], Any]:
        g = self.g
        motion = self._motion(u)
        inputs = self._tail_inputs(motion)
        gap = self._network(self.table.tails.gap, g.concat([inputs, g.stack([g.log(self.N) + 0 * motion[4]])], -1))
        v_x, v_z, yaw, head_spin, spin = (g.gather(part, 0, 0) for part in motion)
        sway = v_x + 0.5 * yaw * self.length
        distance = 2 * self.offset * g.op("Sin", math.pi / g.maximum(self.N, 2.0))
        share = g.gather(g.gather(gap, 0, 0), 0)
        found = (
            self.sense * spin,
            self.sense * head_spin,
            self.sense * yaw,
            self.sense * sway,
            v_z,
            g.sqrt(sway * sway + v_z * v_z) / g.abs(yaw),
            g.atan2(g.abs(sway), v_z) * (180 / math.pi),
            g.where(self.N < 1.5, math.inf, 0.5 * share * distance * self.own["l_over_r0"]),
        )
        inside = converged & g.finite(g.sum(g.gather(u, 0, 0), -1)) & (spin > 0)
        for name in lookup._NOT_OF_HEAD:
            low, high = self.table.ranges[name]
            size = g.abs(self.own[name])
            inside = inside & (low * (1 - 1e-9) <= size) & (size <= high * (1 + 1e-9))
        inside = inside & (g.abs(yaw / spin) <= lookup.BRANCHES) & (self._remoteness(inputs) <= 1.0)
        return dict(zip(STEADY_OUTPUTS, found, strict=True)), ~inside

    def _remoteness(self, inputs: Any) -> Any:
        """How far robots are outside of what was learned, (M,), see `surrogate.table.support`."""
        g = self.g
        groups = g.ops("Split", len(self.table.support), g.gather(inputs, 0, 0), self.counts, axis=0)
        found = []
        for support, part in zip(self.table.support, groups, strict=True):
            if support is None:
                found.append(g.gather(part, 0) * np.nan)
                continue
            x = (part - support.shift.numpy()) / support.scale.numpy()
            with_one = g.concat([g.gather(x, [0]) * 0.0 + 1.0, x], 1)
            features = 1.0
            for places in _monomials(len(support.shift)).T:
                features = g.gather(with_one, places) * features
            solved = features @ np.linalg.inv(support.factor.numpy()).T
            found.append(g.sum(solved * solved, -1) / (len(support.factor) * support.limit))
        return g.concat(found, 0)


def _monomials(count: int) -> Any:
    """Which factors of (1, x) make each of the monomials of `surrogate.table.support`, (P, 3)."""
    found = [(0,) * DEGREE]
    for degree in range(1, DEGREE + 1):
        for names in combinations_with_replacement(range(1, count + 1), degree):
            found.append((0,) * (DEGREE - degree) + names)
    return np.array(found)


def _cofactors() -> Any:
    """For each entry of the inverse of a 4 × 4 matrix: three entries of the matrix, the minors, and signs."""
    number = {pair: i for i, pair in enumerate(combinations(range(4), 2))}
    terms: list[list[tuple[int, int, float]]] = []
    for i in range(4):
        for j in range(4):  # entry (i, j) of the inverse: without row j and column i of the matrix
            columns = [c for c in range(4) if c != i]
            partner = j ^ 1  # the row of the same half
            half = 6 if j < 2 else 0  # minors of the other half
            own = []
            for k, column in enumerate(columns):
                first, second = (c for c in columns if c != column)
                sign = (-1.0) ** (i + j + k)
                own.append((4 * partner + column, half + number[first, second], sign))
            terms.append(own)
    return [
        ([t[k][0] for t in terms], [t[k][1] for t in terms], np.array([t[k][2] for t in terms])) for k in range(3)
    ]


_COFACTORS = _cofactors()
