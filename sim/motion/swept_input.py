"""One input of a robot that is swept through a range, and slow sweeps of it by time steps.

`speed` is the motor's in rpm. All others are dimensionless: the groups of `sim.model.sweepable.SLOPE_INPUTS` and
the sizes of effects. The groups that are not swept keep their values.

In a slow sweep each value starts from the end of the one before, so hysteresis shows. At each value the robot is
perturbed a little and stepped turn by turn of the disc (`sim.motion.revolution`) until the means over a turn and
the shape repeat. Without the perturbation a symmetric motion would be kept long after it has become unstable. A
motion that does not repeat within the limit is flagged. Units: l, μ0 l⁴/EI.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from sim.arrays import Floats
from sim.effects import catalogue, is_effect
from sim.inputs import check_columns
from sim.io.errors import InputError
from sim.model.body import Body
from sim.model.groups import Groups
from sim.model.robot import Robot
from sim.model.sweepable import SLOPE_INPUTS
from sim.motion.revolution import MOST_STEPS, STEPS, Revolutions
from sim.motion.run import Resolution
from sim.motion.settling import settle_one
from sim.motion.steady_motion import RPM
from sim.solve.assembly import bodies
from sim.solve.march import PHASE, State, advance
from sim.solve.refinement import difference

SPEED = "speed"
PERTURBATION = 1e-3  # of the tips, in l
_DRIFT = 2e-4  # relative change of the means from turn to turn that counts as settled
_REPEATS = 3e-5  # largest displacement of a node from turn to turn that counts as settled, in l
_FEWEST, _MOST = 3, 120  # turns
_TOLERANCE = 1e-8


@dataclass(frozen=True)
class SweptInput:
    """A robot and the range of one of its inputs.

    Raises:
        InputError: an unknown input, or a range in which there are robots that cannot be simulated.
    """

    robot: Robot
    name: str  # SPEED, one of SLOPE_INPUTS, or an effect
    low: float
    high: float

    def __post_init__(self) -> None:
        if self.name != SPEED and self.name not in SLOPE_INPUTS and not is_effect(self.name):
            allowed = ", ".join((SPEED, *SLOPE_INPUTS, *catalogue()))
            raise InputError(f"no input {self.name!r} to sweep; there are {allowed}")
        ends = f"{self.low:g}:{self.high:g}"
        if not (math.isfinite(self.low) and math.isfinite(self.high) and self.low < self.high):
            raise InputError(f"the range {ends} of {self.name}; give two numbers, the lower one first")
        if self.name in (SPEED, "omega_bar") and self.low <= 0:
            raise InputError(f"the range {ends} of {self.name}; it must be above 0, for the motor must turn")
        columns = [self._columns(value) for value in (self.low, self.high)]
        check_columns({name: np.array([end[name] for end in columns]) for name in columns[0]})

    @property
    def column(self) -> str:
        """Name of the input in a table, with its unit."""
        return "speed_rpm" if self.name == SPEED else self.name

    @property
    def label(self) -> str:
        """Name of the input on an axis."""
        return "motor speed [rpm]" if self.name == SPEED else self.name

    def value(self, s: float) -> float:
        """Return the input at a place s of the range, from 0 to 1."""
        return self.low + s * (self.high - self.low)

    def groups_at(self, s: float) -> Groups:
        """Return the robot at s, as a batch of one."""
        return Groups.from_columns(self._columns(self.value(s)))

    def body_at(self, s: float) -> Body:
        """Return the robot's numbers at s."""
        return bodies(self.groups_at(s))[0]

    def _columns(self, value: float) -> dict[str, float]:
        columns = self.robot.group_values()
        if self.name == SPEED:
            return {**columns, "omega_bar": value * RPM * self.robot.time_scale}
        return {**columns, self.name: value}


@dataclass(frozen=True)
class SweptState:
    """Where time steps ended at one value of the input."""

    s: float
    means: Floats  # (5,): ω_t, ω_h, ω_yr, v_x, v_z of the head's centre, over the last turn; NaN where none
    settled: bool
    state: State  # at disc phase 0
    time: float  # of a turn
    steps: int  # in a turn


def from_rest(body_at: Callable[[float], Body], tails: int, s: float, edges: int) -> SweptState | None:
    """Step from straight tails at rest; None where the robot breaks down or completes no turn."""
    body = body_at(s)
    run = settle_one(body, tails, Resolution(edges, STEPS))
    if run.failed:
        return None
    omega_t = float(run.means[0])
    state = run.state
    turned = (state.pose[PHASE] * np.sign(omega_t)) % (2 * np.pi)
    rest = (2 * np.pi - turned) / abs(omega_t)
    count = max(2, int(np.ceil(rest * STEPS * abs(body.omega) / (2 * np.pi))))
    if not advance(body, state, rest / count, count, _TOLERANCE).solved:
        return None
    time = 2 * np.pi / abs(omega_t)
    return settled_from(body_at, tails, s, state, time)


def settled_from(body_at: Callable[[float], Body], tails: int, s: float, state: State, time: float) -> SweptState:
    """Step a state at disc phase 0 (not changed) until its motion repeats; `time` is about that of a turn."""
    body = body_at(s)
    steps = min(int(np.ceil(STEPS * abs(body.omega) * time / (2 * np.pi))), MOST_STEPS)
    family = Revolutions(body_at, tails, state.x.shape[0], steps)
    before, means = state, np.full(5, np.nan)
    for count in range(_MOST):
        turn = family.timed(before, s, time)
        if turn is None:
            break
        moved = float(np.abs(turn.state.x - before.x).max())
        change = float(difference(means, turn.means))
        before, time, means = turn.state, turn.time, turn.means
        if count >= _FEWEST and change < _DRIFT and moved < _REPEATS:
            return SweptState(s, means, True, before, time, steps)
    return SweptState(s, means, False, before, time, steps)


def perturbed(state: State, size: float, seed: int) -> State:
    """Return a state whose tails are bent a little, each in another way; `size` is that of the tips, in l."""
    edges, tails, _ = state.x.shape
    bend = ((np.arange(1, edges + 1) / edges) ** 2)[:, None, None]
    way = np.random.default_rng(seed).normal(size=(1, tails, 3)) * np.array([1.0, 1.0, 0.0])
    return State(state.x + size * bend * way, state.x_dot.copy(), state.pose.copy(), state.u.copy())


def slow_sweep(
    body_at: Callable[[float], Body],
    tails: int,
    places: Iterable[float],
    edges: int,
    start: SweptState | None = None,
) -> Iterator[SweptState]:
    """Step through the values of the input at `places`, from rest at the first one or from `start`."""
    here = start
    for seed, s in enumerate(places):
        if here is None:
            here = from_rest(body_at, tails, s, edges)
        else:
            here = settled_from(body_at, tails, s, perturbed(here.state, PERTURBATION, seed), here.time)
            if not np.isfinite(here.means).all():
                here = None
        if here is not None:
            yield here
