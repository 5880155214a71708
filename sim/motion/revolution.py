"""Steady motions in which the tails may move differently: fixed points of the map over one turn of the disc.

    Φ(x, s): shape of all tails at disc phase 0  ->  shape one turn later

Inertia is left out, so the shape x (n, N, 3) is the whole state. The map is made of implicit time steps
(`sim.solve.march`), a fixed number of equal ones. A motion whose shape repeats after each turn is a fixed point,

    F(x, s) = Φ(x, s) − x = 0.

Most perturbations decay within a turn, so nearly all eigenvalues of Φ' are close to 0, and GMRES solves with
Φ' − 1 in about as many products as there are others. A product is a difference of two maps. Perturbations
that grow are eigenvalues μ of Φ' outside the unit circle:

    growth in a motor revolution = ln |μ| ω_t/(ω_t − ω_h).

The same map settles a robot in time. Units: l, μ0 l⁴/EI.
Source: Sánchez, Net, García-Archilla, Simó (2004), Newton-Krylov continuation of periodic orbits for Navier-Stokes
flows.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from sim.arrays import Floats
from sim.mechanics.balance import motor_gain, tail_spin
from sim.model.body import Body
from sim.motion.run import copied
from sim.motion.stability import Leading
from sim.solve.march import PHASE, SURGE, SWAY, YAW, State, advance, new_state

STEPS = 48  # a motor revolution
MOST_STEPS = 6000  # a turn of the disc
_TOLERANCE = 1e-8  # on the last correction of a time step
_WIDTH = 1e-5  # finite-difference step, in l and s
_PRODUCTS = 60  # of GMRES
_RESIDUAL = 1e-2  # share of the right-hand side that GMRES may leave in a correction
_RESIDUAL_OF_TANGENT = 1e-3
_VECTORS = 20  # of Arnoldi's method
_TURN = 2 * np.pi


class Turn(NamedTuple):
    """One turn of the disc."""

    state: State  # at its end
    time: float  # that it took
    means: Floats  # (5,): ω_t, ω_h, ω_yr, v_x, v_z of the head's centre
    phases: Floats  # (K,) of the disc after each step
    shapes: Floats  # (K, n, N, 3) then; empty unless asked for


class Revolutions:
    """The map of a robot with N tails whose numbers depend on s."""

    tolerance = 1e-6

    def __init__(self, body_at: Callable[[float], Body], tails: int, edges: int, steps: int):
        """Prepare the map with a number of steps in a turn of the disc."""
        self.body_at, self.tails, self.edges, self.steps = body_at, tails, edges, steps
        self._scale = np.sqrt(edges * tails)
        self._state = new_state(tails, edges, body_at(0.5).offset)  # velocities of the last turn, as a guess
        self._time = np.nan
        self._last: tuple[bytes, Turn | None] = (b"", None)  # the latest fixed point, and its turn

    def turn(self, state: State, s: float, time: float, *, shapes: bool = False) -> Turn | None:
        """Step a state (changed) from disc phase 0 by about a turn in a given time; None where it breaks down."""
        body = self.body_at(s)
        state.pose[:] = 0.0
        count = self.steps
        solved, poses, seen = advance(body, state, time / count, count, _TOLERANCE, shapes=count * shapes)
        if not solved:
            return None
        spin = tail_spin(body, state.u)
        end = state.pose
        rest = np.sign(spin) * _TURN - end[PHASE]  # corrected at first order: exact where it is small
        if not abs(rest) < 0.5:
            return Turn(state, time * _TURN / max(abs(end[PHASE]), 0.1), np.full(5, np.nan), poses[:, PHASE], seen)
        later = rest / spin
        state.x[:] += later * state.x_dot
        whole = time + later
        heading = state.u[0] + state.u[2] * body.head_length / 2
        omega_t = np.sign(spin) * _TURN / whole
        means = np.array(
            [
                omega_t,
                (omega_t - body.omega) / motor_gain(body),
                (end[YAW] + later * state.u[2]) / whole,
                (end[SWAY] + later * heading) / whole,
                (end[SURGE] + later * state.u[1]) / whole,
            ]
        )
        return Turn(state, whole, means, poses[:, PHASE], seen)

    def timed(self, state: State, s: float, time: float, *, shapes: bool = False) -> Turn | None:
        """Step by a turn, and find the time that it takes."""
        for _ in range(6):
            turn = self.turn(copied(state), s, time, shapes=shapes)
            if turn is None:
                return None
            if abs(turn.time / time - 1) < 1e-3:
                return turn
            time = turn.time
        return None

    def start(self, state: State, s: float, time: float) -> Floats:
        """Return y for a state at disc phase 0, and keep its velocities as a guess for those of its neighbours."""
        self._state, self._time = copied(state), time
        return np.append(state.x.ravel() / self._scale, s)

    def state(self, y: Floats) -> State:
        """Return the state at disc phase 0."""
        guess = copied(self._state)
        return State(y[:-1].reshape(guess.x.shape) * self._scale, guess.x_dot, guess.pose, guess.u)

    def at(self, y: Floats) -> Turn | None:
        """Step one turn from the fixed point y, and keep its velocities and its time."""
        key = y.tobytes()
        if key != self._last[0]:
            turn = self.timed(self.state(y), float(y[-1]), self._time)
            if turn is not None:
                self._state, self._time = copied(turn.state), turn.time
            self._last = key, turn
        return self._last[1]

    def correction(self, y: Floats, row: Floats, defect: float) -> Floats:
        """See `sim.motion.continuation.Equations`."""
        image = self._fixed_image(y)
        if image is None:
            return np.full(len(y), np.nan)
        return self._solved(y, image, row, np.append(y[:-1] - image, -defect), _RESIDUAL)

    def tangent(self, y: Floats, row: Floats) -> Floats:
        """See `sim.motion.continuation.Equations`."""
        image = self._fixed_image(y)
        if image is None:
            return np.full(len(y), np.nan)
        return self._solved(y, image, row, np.append(np.zeros(len(y) - 1), 1.0), _RESIDUAL_OF_TANGENT)

    def moved(self, y: Floats, dy: Floats) -> Floats:
        """See `sim.motion.continuation.Equations`."""
        return y + dy

    def is_valid(self, y: Floats) -> bool:
        """Tell whether the tails complete a turn."""
        turn = self.at(y)
        return turn is not None and bool(np.isfinite(turn.means).all())

    def leading(self, y: Floats) -> Leading:
        """Find the perturbation that decays least, by Arnoldi's method (`sim.motion.stability.Leading`)."""
        turn, image = self.at(y), self._fixed_image(y)
        if turn is None or image is None:
            return Leading(np.nan, np.nan, 1)
        size = len(y) - 1
        count = min(_VECTORS, size - 1)
        basis, projected = np.zeros((count + 1, size)), np.zeros((count + 1, count))
        first = np.random.default_rng(0).normal(size=self._state.x.shape)
        first *= (np.arange(1, self.edges + 1) / self.edges)[:, None, None] ** 2
        basis[0] = first.ravel() / np.linalg.norm(first)
        for i in range(count):
            vector = self._product(y, image, np.append(basis[i], 0.0))
            for _ in range(2):
                parts = basis[: i + 1] @ vector
                projected[: i + 1, i] += parts
                vector = vector - parts @ basis[: i + 1]
            projected[i + 1, i] = np.linalg.norm(vector)
            basis[i + 1] = vector / max(projected[i + 1, i], 1e-300)
        if not np.isfinite(projected).all():
            return Leading(np.nan, np.nan, 1)
        values = np.linalg.eigvals(projected[:count])
        largest = values[np.argmax(np.abs(values))]
        omega_t, omega_h = turn.means[:2]
        share = abs(omega_t / (omega_t - omega_h))
        return Leading(float(np.log(abs(largest)) * share), float(abs(np.angle(largest)) / _TURN), 1)

    def _image(self, y: Floats) -> Floats | None:
        """Compute Φ(y), scaled like y; None where time steps fail, and where y has numbers that are not finite."""
        if not np.isfinite(y).all():
            return None
        turn = self.turn(self.state(y), float(y[-1]), self._time)
        return None if turn is None else turn.state.x.ravel() / self._scale

    def _fixed_image(self, y: Floats) -> Floats | None:
        """Compute Φ(y) with the velocities and the time of a turn from there; None where there is none."""
        return None if self.at(y) is None else self._image(y)

    def _product(self, y: Floats, image: Floats, vector: Floats) -> Floats:
        """Multiply the derivative of Φ in (x, s) with a vector, by a difference."""
        width = _WIDTH / max(float(np.abs(vector).max()), 1e-12) / self._scale
        moved = self._image(y + width * vector)
        return np.full(len(image), np.nan) if moved is None else (moved - image) / width

    def _solved(self, y: Floats, image: Floats, row: Floats, right: Floats, residual: float) -> Floats:
        """Solve (Φ' − 1) dx + Φ_s ds = right, row·dy = its last entry."""
        from scipy.sparse.linalg import LinearOperator, gmres

        def product(vector: Floats) -> Floats:
            vector = np.asarray(vector).ravel()
            return np.append(self._product(y, image, vector) - vector[:-1], row @ vector)

        size = len(y)
        operator = LinearOperator((size, size), matvec=product, dtype=float)
        solution, _ = gmres(operator, right, rtol=residual, atol=0.0, restart=_PRODUCTS, maxiter=1)
        return np.asarray(solution)
