"""A Gymnasium environment: keep a robot on a path with one binary input, the direction of its motor.

    import gymnasium
    import softflagella.gym  # registers the environment

    env = gymnasium.make("softflagella/Path-v0", plan="square/plan.json")

At equal times the agent keeps the motor's direction (0) or flips it (1). A flip before the plan's shortest dwell
is over does nothing. The reward of a step is

    −(1 + e/E) Δt/T,

with the distance e of the tracked point from the declared path, the predicted rms error E and the duration T of
the plan. So an episode is worth −(time/T)(1 + mean of e/E).

The robot begins at rest near the plan's start, and is drawn anew within what the plan is unsure of, or is
simulated in time steps as the plan's own robot. An episode is terminated at the end of the path and truncated
after LONGEST times the planned duration. Lengths in l, times in μ0 l⁴/EI, angles in rad.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any, Literal, NamedTuple

import gymnasium
import numpy as np

from common.arrays import Floats
from common.errors import InputError
from planner.files.saved_plan import restore_plan
from planner.guidance.law import REST
from planner.guidance.line_of_sight import LineOfSight
from planner.jobs.plan import plan as plan_path
from planner.paths.distance import closest_segment
from planner.paths.path import arc_length, polygon
from planner.planning.plan import Plan
from planner.planning.request import Camera
from sim.mechanics import planar
from sim.model.robot import Robot
from tracking.swim import SteppedSwimmer
from tracking.tracker import Tracker

LONGEST = 3.0  # planned durations
START = (0.02, 0.02, 0.03)  # standard deviations of the pose at the start
AHEAD = 8  # poses of the reference that are seen
APART = 0.25  # between them
_NEAR = 1.0  # of the path on both sides of the place reached, where the nearest point is searched
Observation = dict[str, Any]


class PathEnv(gymnasium.Env[Observation, np.int64]):
    """Keep a robot on the path of a plan; see the module.

    An observation has three arrays:

        pose        (3,) x, y and heading of the head's centre in the lab, with noise
        reference   (AHEAD, 3) where it should be, and APART later on the path, …: forward, left and turned to the
                    left, seen from this pose
        motor       (2,) direction of the motor, ±1, and time since its last flip

    and the information the exact `error`, the `time`, and whether this action `flipped` the motor.

    Args:
        plan: the plan, or plan.json; default: a square of 3 l for "paper-control".
        model: "table", thousands of steps a second, or "simulator".
        actions: steps in the plan's shortest dwell.
        noise: standard deviations of a pose: of x and y, of the heading.

    Raises:
        InputError: there is no such model, a number is not possible, or the plan cannot be read or simulated.
    """

    def __init__(
        self,
        plan: Plan | str | Path | None = None,
        *,
        model: Literal["table", "simulator"] = "table",
        actions: int = 4,
        noise: tuple[float, float] = (0.01, 0.01),
    ):
        if model not in ("table", "simulator"):
            raise InputError(f"model {model!r}; give 'table' or 'simulator'")
        if not isinstance(actions, int | np.integer) or actions < 1:
            raise InputError(f"actions is {actions!r}; give a whole number, 1 or more")
        if plan is None:
            plan = plan_path(polygon(4, side=3.0), "paper-control")
        if not isinstance(plan, Plan | str | Path):
            raise InputError(f"plan is {plan!r}; give a plan, or the path of a plan.json")
        self.plan = plan if isinstance(plan, Plan) else restore_plan(plan)
        self._is_reset = False
        if model == "simulator":
            self.plan.schedule()  # refuses a measured vehicle
        self.model, self.actions = model, actions
        self.noise = Camera(noise=noise).noise
        self.every = self.plan.minimum_dwell / actions
        reference, offset = self.plan.declared.reference, self.plan.tracked.offset
        path = np.column_stack([reference.p, reference.heading])
        head = planar.compose(path, np.array([-offset, 0.0, 0.0]))  # where the head's centre should be
        self._places, self._headings = head[:, 0] + 1j * head[:, 1], head[:, 2]
        self._offset, self._points = offset, reference.p[:-1]
        self._moves = np.diff(reference.p, axis=0)
        spacing = float(arc_length(reference.p)[-1]) / len(self._moves)
        self._ahead = np.round(np.arange(AHEAD) * APART / spacing).astype(int)
        self._near = int(np.ceil(_NEAR / spacing))
        self._price, self._scale = self.every / self.plan.duration, self.plan.predicted_rms
        self.action_space = gymnasium.spaces.Discrete(2)
        longest = 2 * LONGEST * self.plan.duration
        far = longest * self.plan.tracked.vehicle.speed + 2 * float(np.abs(reference.p).max()) + 1
        most = {"pose": [far, far, 4.0], "reference": [[far, far, 4.0]] * AHEAD, "motor": [1.0, longest]}
        self.observation_space = gymnasium.spaces.Dict(
            {name: gymnasium.spaces.Box(-np.array(m), np.array(m), dtype=np.float64) for name, m in most.items()}
        )

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Put another robot at rest near the start."""
        super().reset(seed=seed)
        rng, plan, self._is_reset = self.np_random, self.plan, True
        self._direction, self._kept, self._steps = plan.first_direction, 0, 0
        self._before = REST  # length of the last dwell
        x, y, heading = (plan.start + rng.normal(size=3) * START).tolist()
        self._pose = self._flipped = x, y, heading
        self._swimmer, vehicle = None, plan.tracked.vehicle
        if self.model == "table":
            vehicle = vehicle.drawn(rng)
        else:
            assert isinstance(plan.robot, Robot)
            self._swimmer = SteppedSwimmer(plan.robot, plan, self._direction, np.array(self._pose), (0.0, 0.0))
        self._law = LineOfSight(plan.declared.reference, vehicle, plan.guidance, self._offset)
        return self._seen(), self._info(False)

    def step(self, action: np.int64 | int) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Keep or flip the motor, and swim on until the next action.

        Raises:
            InputError: the action is neither 0 nor 1.
            ResetNeeded: the environment was never reset.
        """
        if not self._is_reset:
            raise gymnasium.error.ResetNeeded("call reset before the first step")
        if not self.action_space.contains(action):
            raise InputError(f"action {action!r}; give 0 (keep) or 1 (flip)")
        flipped = bool(action == 1 and self._kept >= self.actions)
        if flipped:
            self._before, self._flipped = self._kept * self.every, self._pose
            self._direction, self._kept = -self._direction, 0
        self._kept, self._steps = self._kept + 1, self._steps + 1
        if self._swimmer is None:
            self._pose = self._law.pose_after(
                self._flipped, self._direction, self._before, self._kept * self.every
            )
        else:
            if flipped:
                self._swimmer.flip()
            x, y, heading = self._swimmer.go(self.every)[1][-1].tolist()
            self._pose = x, y, heading
        seen, info = self._seen(), self._info(flipped)
        reward = -(1 + info["error"] / self._scale) * self._price
        return seen, reward, self._law.ended, self._steps * self._price >= LONGEST, info

    def _seen(self) -> Observation:
        self._law.integrate(self._pose, self._direction)  # moves its place along the path
        noise = self.np_random.normal(size=3) * [self.noise[0], self.noise[0], self.noise[1]]
        x, y, heading = (self._pose + noise).tolist()
        rows = np.minimum(self._law.state.step + self._ahead, len(self._places) - 1)
        from_here = (self._places[rows] - complex(x, y)) * cmath.exp(-1j * heading)
        turned = np.append(self._headings[rows] - heading, heading)
        turned -= 2 * np.pi * np.round(turned / (2 * np.pi))
        return {
            "pose": np.array([x, y, turned[-1]]),
            "reference": np.column_stack([from_here.real, from_here.imag, turned[:-1]]),
            "motor": np.array([self._direction, self._kept * self.every]),
        }

    def _info(self, flipped: bool) -> dict[str, Any]:
        x, y, heading = self._pose
        point = np.array([[x + self._offset * math.cos(heading), y + self._offset * math.sin(heading)]])
        index = self._law.state.step
        near = np.arange(max(index - self._near, 0), min(index + self._near, len(self._moves)))
        error = float(closest_segment(self._points, self._moves, point, near[None])[0][0])
        return {"error": error, "time": self._steps * self.every, "flipped": flipped}


class TrackerPolicy(Tracker):
    """Flip when the tracker would, at times of an action: its score is the one to beat.

    Args:
        env: the environment, which has just been reset.
    """

    def __init__(self, env: PathEnv):
        self._every = env.every
        super().__init__(env.plan, noise=env.noise)

    def _plan_flip(self) -> None:
        super()._plan_flip()
        self._flip_at = max(round(self._flip_at / self._every), math.ceil(self._now / self._every)) * self._every

    def __call__(self, seen: Observation, info: dict[str, Any]) -> int:
        """Return the action."""
        x, y, heading = seen["pose"].tolist()
        now = info["time"]
        command = self.update(now, (x, y, heading), now)
        if command.flip_at <= now:  # as the pose has shown
            command = self.update(now)
        return int(command.direction != seen["motor"][0])  # at the end it goes straight on


class Episode(NamedTuple):
    """What a policy achieved."""

    score: float  # sum of the rewards
    errors: Floats  # (K,) at the steps
    poses: Floats  # (K, 3), as seen
    finished: bool  # the path has ended


Policy = Callable[[Observation, dict[str, Any]], int]


def episode(env: PathEnv, policy: Callable[[PathEnv], Policy], seed: int) -> Episode:
    """Let a policy, made for the environment after its reset, steer for an episode."""
    seen, info = env.reset(seed=seed)
    act, score, rows = policy(env), 0.0, []
    finished = truncated = False
    while not (finished or truncated):
        seen, reward, finished, truncated, info = env.step(act(seen, info))
        score += reward
        rows.append([info["error"], *seen["pose"]])
    table = np.array(rows)
    return Episode(score, table[:, 0], table[:, 1:], finished)


gymnasium.register(id="softflagella/Path-v0", entry_point="softflagella.gym:PathEnv")
