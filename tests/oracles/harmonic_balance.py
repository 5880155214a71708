"""Steady motion of a robot whose tails differ: harmonic balance over a turn of the disc, in NumPy.

Unknown are the shapes of all tails and the velocities u = (v_x, v_z, ω_yr, ω_h) at P phases of the disc; time
derivatives are those of their Fourier series, ẋ = ω_t dx/dφ. The balance of nodes and of the robot is that of
`tests.oracles.plain_swimmer`. Newton-Krylov; the approximate inverse takes the tails' derivatives at each phase as
their mean over a turn, so that harmonics of a tail decouple, and couples them through u exactly. No symmetry
between tails is used.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.sparse.linalg import LinearOperator, gmres

from common.arrays import Floats
from sim.mechanics.balance import motor_gain
from sim.model.groups import Groups
from tests.oracles.plain_swimmer import NOMINAL, Hardware, PlainSwimmer

_STEP = 1e-6  # of differences, in l
_SETTLED = 1e-6  # largest turn of an edge
_MOST = 40  # corrections


class Turn(PlainSwimmer):
    """A turn of the disc at P phases; columns are phases times tails."""

    def __init__(self, groups: Groups, hardware: Hardware, edges: int, phases: int):
        super().__init__(groups, edges, hardware, instants=phases)
        self.P, self.N = phases, self.columns // phases
        phase = np.repeat(2 * np.pi * np.arange(phases) / phases, self.N)
        none, one = 0 * phase, 1 + 0 * phase
        self.e_x = np.stack([np.cos(phase), -np.sin(phase), none], -1)
        self.e_y = np.stack([np.sin(phase), np.cos(phase), none], -1)
        self.e_z = np.stack([none, none, one], -1)
        self.orders = np.arange(phases // 2 + 1.0)
        self.orders[-1] = 0.0  # the derivative of the highest harmonic is zero at the phases
        self.x = self.start()[:-4].reshape(edges, -1, 3)
        self.u = np.zeros((phases, 4))

    def by_phase(self, x: Floats) -> Floats:
        """Compute dx/dφ of x (n, P N, 3)."""
        waves = np.fft.rfft(x.reshape(self.n, self.P, self.N, 3), axis=1) * (1j * self.orders[:, None, None])
        return np.asarray(np.fft.irfft(waves, self.P, axis=1).reshape(x.shape))

    def balance(self, x: Floats, slope: Floats, u: Floats) -> tuple[Floats, Floats, Floats]:
        """Compute the balance of nodes (P N, n, 3), the wrench of each tail (P N, 4), and that of the head (P, 4).

        Args:
            slope: dx/dφ.
        """
        axes = (self.e_x, self.e_y, self.e_z)
        force, moment, self.resistance, elastic = self.loads(x, self.e_y)
        w = u * [1, 1, 1, motor_gain(self.body)] + [0, 0, 0, self.body.omega]  # v_x, v_z, ω_yr, ω_t
        every = np.repeat(w, self.N, 0)
        velocity = np.einsum("aknj,na->knj", self.directions(x, *axes), every) + every[:, 3:] * slope
        nodes = elastic - np.einsum("knij,knj->kni", self.resistance[1:], velocity)
        drag = np.einsum("nij,anj,na->ni", self.resistance[0], self.directions(self.root, *axes), every)
        force, moment = force - drag, moment - np.cross(self.root, drag)
        wrench = np.stack([(force * self.e_x).sum(-1), force[:, 2], (moment * self.e_y).sum(-1), moment[:, 2]], -1)
        return nodes.swapaxes(0, 1), wrench, -np.concatenate([u, w[:, 3:]], 1) @ self.body.resistance.T

    def residual(self, x: Floats, u: Floats) -> Floats:
        """Compute the balance of all nodes and of the robot, flat."""
        nodes, wrench, head = self.balance(x, self.by_phase(x), u)
        return np.append(nodes, wrench.reshape(self.P, self.N, 4).sum(1) + head)

    def correct(self) -> float:
        """Apply one correction; return the largest turn of an edge."""
        count = self.x.size
        here = self.residual(self.x, self.u)

        def parts(z: Floats) -> tuple[Floats, Floats]:
            return z[:count].reshape(-1, self.n, 3).swapaxes(0, 1), z[count:].reshape(-1, 4)

        def along(z: Floats) -> Floats:
            dx, du = parts(z * (_STEP / max(abs(z).max(), 1e-300)))
            return (self.residual(self.x + dx, self.u + du) - here) * (abs(z).max() / _STEP)

        shape = (len(here), len(here))
        inverse = LinearOperator(shape, self.approximate_inverse(), dtype=float)
        dx, du = parts(gmres(LinearOperator(shape, along, dtype=float), -here, rtol=1e-3, maxiter=3, M=inverse)[0])
        largest, share = self.turn(dx)
        self.u = self.u + share * du
        return largest

    def approximate_inverse(self) -> Callable[[Floats], Floats]:
        """Return the solution of the linearised balance, to the mean of the tails' derivatives over a turn."""
        n, P, N = self.n, self.P, self.N
        slope = self.by_phase(self.x)
        nodes, wrench, head = self.balance(self.x, slope, self.u)
        resistance = self.resistance[1:].reshape(n, P, N, 3, 3).mean(1)
        A, C = np.zeros((P * N, n, 3, n, 3)), np.zeros((P * N, 4, 2, 3))
        for colour, c in np.ndindex(min(5, n), 3):  # a node moves the balance of two neighbours on either side
            moved = self.x.copy()
            moved[colour::5, :, c] += _STEP
            by_node, by_tail, _ = self.balance(moved, slope, self.u)
            for k in range(colour, n, 5):
                near = slice(max(k - 2, 0), k + 3)
                A[:, near, :, k, c] = (by_node - nodes)[:, near] / _STEP
            if colour < 2:
                C[:, :, colour, c] = (by_tail - wrench) / _STEP
        B, D = np.zeros((P * N, n, 3, 4)), np.zeros((P, 4, 4))
        for a in range(4):  # linear
            by_node, by_tail, by_head = self.balance(self.x, slope, self.u + np.eye(4)[a])
            B[..., a] = by_node - nodes
            D[..., a] = (by_tail - wrench).reshape(P, N, 4).sum(1) + by_head - head
        matrix = A.reshape(P, N, 3 * n, 3 * n).mean(0) + 0j * self.orders[:, None, None, None]
        spin = self.body.omega + motor_gain(self.body) * self.u[:, 3].mean()
        for k in range(n):
            block = slice(3 * k, 3 * k + 3)
            matrix[:, :, block, block] -= 1j * spin * self.orders[:, None, None, None] * resistance[k]
        waves = np.exp(-2j * np.pi / P * np.outer(np.arange(P // 2 + 1), np.arange(P)))
        sources = np.einsum("hp,pjra->hjrpa", waves, B.reshape(P, N, 3 * n, 4)).reshape(-1, N, 3 * n, 4 * P)
        inverse = np.linalg.inv(matrix)
        by_u = np.fft.irfft(inverse @ sources, P, axis=0)
        C = C.reshape(P, N, 4, 6)
        schur = -np.einsum("pjar,pjrq->paq", C, by_u[:, :, :6]).reshape(P, 4, P, 4)
        schur[np.arange(P), :, np.arange(P)] += D
        schur = np.linalg.inv(schur.reshape(4 * P, 4 * P))

        def solve(z: Floats) -> Floats:
            loads = np.fft.rfft(z[: nodes.size].reshape(P, N, 3 * n, 1), axis=0)
            dx = np.fft.irfft(inverse @ loads, P, axis=0)[..., 0]
            du = schur @ (z[nodes.size :] - np.einsum("pjar,pjr->pa", C, dx[..., :6]).ravel())
            return np.append(dx - by_u @ du, du)

        return solve

    def turn(self, dx: Floats) -> tuple[float, float]:
        """Turn edges by a correction, at most by half their length; their lengths change in first order only."""
        edge, change = (
            np.diff(a, axis=0)
            for a in (np.concatenate([self.root[None], self.x]), np.concatenate([0 * dx[:1], dx]))
        )
        length = np.linalg.norm(edge, axis=-1, keepdims=True)
        largest = float((np.linalg.norm(change, axis=-1) / length[..., 0]).max())
        share = min(1.0, 0.5 / largest)
        turned = edge + share * change
        turned *= (length + share * (edge * change).sum(-1, keepdims=True) / length) / np.linalg.norm(
            turned, axis=-1, keepdims=True
        )
        self.x = self.root + np.cumsum(turned, axis=0)
        return largest, share

    def means(self) -> Floats:
        """Return (ω_t, ω_yr, v_x, v_z) of the head's centre, means over the time of a turn."""
        spin = self.body.omega + motor_gain(self.body) * self.u[:, 3]
        sway = self.u[:, 0] + self.u[:, 2] * self.body.head_length / 2
        table = np.stack([spin, self.u[:, 2], sway, self.u[:, 1]]) / spin
        return np.asarray(table.mean(1) / (1 / spin).mean())


def settle_in_harmonics(
    groups: Groups, hardware: Hardware = NOMINAL, *, edges: int = 12, phases: int = 12
) -> Floats:
    """Solve at rising speeds of the motor: (ω_t, ω_yr, v_x, v_z) of the head's centre, means over a turn.

    Raises:
        ArithmeticError: Newton's method did not settle.
    """
    speeds = np.arange(1, 2 + abs(groups.omega_bar.item()) // 20)
    turn = Turn(groups, hardware, edges, phases)
    for speed in speeds / speeds[-1] * groups.omega_bar:
        turn.body = turn.body._replace(omega=float(speed))
        for _ in range(_MOST):
            if turn.correct() < _SETTLED:
                break
        else:
            raise ArithmeticError(f"no steady motion at the motor speed {speed:.4g}")
    return turn.means()
