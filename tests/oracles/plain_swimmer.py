"""The simulator's equations solved by scipy's BDF on positions, with a right-hand side in NumPy.

At low Reynolds number velocities follow from positions: elastic force on a free node is balanced by its drag,
v_k = R_k⁻¹ f_k, what the clamps transmit by head and disc; so ẋ_k = v_k − G_k w with the body's velocities from
four linear equations. State: nodes of all tails in the disc frame, disc phase, heading, ∫h_x, ∫v_z. The formulas
are those of `sim.mechanics`; frames as in `sim.mechanics.balance`. Tails may differ from each other (`Hardware`).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from common.arrays import Floats
from sim.linear.vectors import Vector
from sim.mechanics import rod
from sim.mechanics.balance import motor_gain
from sim.mechanics.drag import node_resistance, tail_coefficients
from sim.model.body import Body
from sim.model.groups import Groups
from sim.solve.assembly import bodies


@dataclass(frozen=True)
class Hardware:
    """What differs from equal tails, clamped rigidly along the axis, in a uniform fluid."""

    lengths: tuple[float, ...] = ()  # of the first tails, over l; 0: a tail is missing
    stiffness: tuple[float, ...] = ()  # of the first tails, over EI
    compliance: float = 0.0  # turning of each root for a moment [l/EI]
    tilt: float = 0.0  # of the disc's normal towards the first clamp [rad]
    stratification: float = 0.0  # g: drag on the tails goes with e^(g y), y up from the axis [1/l]


NOMINAL = Hardware()


class PlainSwimmer:
    """One robot with N tails of n edges; `columns`: its tails, at one instant or at several."""

    def __init__(self, groups: Groups, edges: int, hardware: Hardware = NOMINAL, *, instants: int = 1):
        self.body: Body = bodies(groups)[0]
        self.n, self.compliance, self.stratification = edges, hardware.compliance, hardware.stratification
        padding = np.ones(groups.N)
        lengths, stiffness = (
            np.append(given, padding)[: groups.N] for given in (hardware.lengths, hardware.stiffness)
        )
        angle = 2 * np.pi * np.arange(groups.N) / groups.N
        angle, self.stiffness, lengths = (np.tile(v[lengths > 0], instants) for v in (angle, stiffness, lengths))
        self.columns = len(angle)
        cos, sin = np.cos(hardware.tilt), np.sin(hardware.tilt)
        on_disc = self.body.offset * np.stack([np.cos(angle), np.sin(angle), 0 * angle], 1)  # (N, 3)
        self.root = on_disc @ np.array([[cos, 0, -sin], [0, 1, 0], [sin, 0, cos]])
        self.down = np.broadcast_to([-sin, 0.0, -cos], (self.columns, 3))  # of each root
        self.cell = lengths / edges
        self.voronoi = np.tile(self.cell, (edges + 1, 1))
        self.voronoi[[0, -1]] *= 0.5
        own, nominal = (tail_coefficients(length / self.body.tail_radius) for length in (lengths, 1.0))
        self.zeta_parallel = self.body.zeta_parallel * own[0] / nominal[0]
        self.zeta_perp = self.body.zeta_perp * own[1] / nominal[1]

    def start(self) -> Floats:
        """Return straight tails at rest."""
        x = self.root + self.down * (np.arange(1, self.n + 1)[:, None, None] * self.cell[:, None])
        return np.concatenate([x.ravel(), np.zeros(4)])

    def rates(self, _: float, state: Floats) -> Floats:
        """Compute d(state)/dt."""
        x, phase = state[:-4].reshape(self.n, self.columns, 3), state[-4]
        cos, sin = np.cos(phase), np.sin(phase)
        e_x, e_y, e_z = np.array([cos, -sin, 0.0]), np.array([sin, cos, 0.0]), np.array([0.0, 0.0, 1.0])
        force, moment, resistance, elastic = self.loads(x, e_y)
        root = self.directions(self.root, e_x, e_y, e_z)  # (4, N, 3)
        drag = np.einsum("nij,anj->ani", resistance[0], root)
        on_disc = np.stack([(force @ e_x).sum(), force[:, 2].sum(), (moment @ e_y).sum(), moment[:, 2].sum()])
        matrix = np.einsum("ani,bni->ab", root, drag)
        gain = np.array([1.0, 1.0, 1.0, motor_gain(self.body)])
        head = self.body.resistance[:, :4] + 0.0
        head[:, 3] += motor_gain(self.body) * self.body.resistance[:, 4]
        motor = self.body.omega * (matrix[:, 3] + self.body.resistance[:, 4])
        u = np.linalg.solve(matrix * gain + head, on_disc - motor)
        w = u * gain + np.array([0.0, 0.0, 0.0, self.body.omega])
        carried = np.einsum("aknj,a->knj", self.directions(x, e_x, e_y, e_z), w)
        relative = np.linalg.solve(resistance[1:], elastic[..., None])[..., 0]
        sway = u[0] + u[2] * self.body.head_length / 2
        return np.concatenate([(relative - carried).ravel(), [w[3], u[2], sway, u[1]]])

    @staticmethod
    def directions(x: Floats, e_x: Floats, e_y: Floats, e_z: Floats) -> Floats:
        return np.stack(
            [np.broadcast_to(e_x, x.shape), np.broadcast_to(e_z, x.shape), np.cross(e_y, x), np.cross(e_z, x)]
        )

    def loads(self, x: Floats, up: Floats) -> tuple[Any, ...]:
        """Compute clamp force and moment (N, 3), resistance (n + 1, N, 3, 3) and elastic force of nodes.

        Args:
            x: free nodes, (n, N, 3).
            up: e_y, (3,) or (N, 3).
        """
        nodes = np.concatenate([self.root[None], x])
        edge = np.diff(nodes, axis=0)
        length = np.linalg.norm(edge, axis=-1)
        tangent = np.concatenate([self.down[None], edge / length[..., None]])
        before, after = _components(tangent[:-1]), _components(tangent[1:])
        stiff = np.tile(self.stiffness / self.cell, (self.n, 1))
        stiff[0] = 1 / (0.5 / stiff[0] + self.compliance)
        length_before = np.concatenate([np.ones((1, self.columns)), length[:-1]])
        _, first, _, by_after, by_before = rod.bend(before, after, length_before, length, stiff)
        first_next, *by_next = (np.concatenate([a[1:], 0 * a[:1]]) for a in (first, *by_before))
        x, y, z = by_next
        axial = self.body.axial_stiffness * self.stiffness
        stretched = rod.edge_force(after, length, 1 / self.cell, axial, first, by_after, first_next, (x, y, z))
        carried = np.stack(stretched, -1)
        elastic = np.concatenate([carried[1:], 0 * carried[:1]]) - carried
        total = np.concatenate([tangent[:-1] + tangent[1:], tangent[-1:]])
        unit = _components(total / np.linalg.norm(total, axis=-1, keepdims=True))
        cell = self.voronoi * np.exp(self.stratification * (nodes * up).sum(-1))
        excess = cell * (self.zeta_parallel - self.zeta_perp)
        resistance: Floats = np.array(node_resistance(unit, cell * self.zeta_perp, excess))
        bent = rod.clamp_moment(_components(self.down), _components(tangent[1]), first[0])
        moment = np.cross(self.root, carried[0]) + np.stack(bent, -1)
        return carried[0], moment, np.moveaxis(resistance, (0, 1), (-2, -1)), elastic


def _components(a: Floats) -> Vector:
    return a[..., 0], a[..., 1], a[..., 2]


def settle_plainly(
    groups: Groups, hardware: Hardware = NOMINAL, *, edges: int = 16, tolerance: float = 1e-5
) -> Floats:
    """Settle from rest: (ω_t, ω_yr, v_x, v_z) of the head's centre, means over the last whole turn of the disc.

    Runs for three time units, or for two and a turn where that is longer (at 0.4 of the motor's speed).
    """
    swimmer = PlainSwimmer(groups, edges, hardware)
    time = max(3.0, 2.0 + 2 * np.pi / (0.4 * abs(float(groups.omega_bar[0]))))
    answer = solve_ivp(
        swimmer.rates, (0.0, time), swimmer.start(), method="BDF", rtol=tolerance, atol=1e-8, dense_output=True
    )
    dense = np.linspace(0, time, 4000)
    solution: Any = answer.sol
    sums = solution(dense)[-4:]
    phase = sums[0] * np.sign(sums[0, -1])
    start = np.interp(phase[-1] - 2 * np.pi, phase, dense)
    change = sums[:, -1] - solution(start)[-4:]
    return np.asarray(change / (time - start))
