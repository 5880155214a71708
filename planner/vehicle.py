"""The robot as a vehicle for the planner: two arcs and the response to a switch.

In motor direction σ = ±1 the robot moves on a circle with a constant body twist. After a flip, when the tails have
turned over, the robot is displaced by a fixed offset, the lag (`sim.motion.switching`). So a dwell T moves it by

    E_σ(T) = lag_σ(T) ∘ arc(twist_σ, T).

The two directions have their own numbers; those from the look-up table are mirror images. The first dwell starts
from straight tails, which are half way between the shapes of the two directions. So it has half a lag.

Between the dwells of the table the lag is interpolated; at a flip it is zero. For longer dwells than the longest
one of the table it is constant, because the tails have turned over long before. Poses are those of the head's
centre. Lengths are in l, times in μ0 l⁴/EI.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from sim.arrays import Floats
from sim.io.errors import InputError
from sim.mechanics import planar
from sim.model.robot import Robot
from surrogate.table import LookupTable

TURN_OVER = 0.7  # time units that the tails need after a flip
FROM_REST = 0.5  # share of a lag in the first dwell: straight tails are half way
_TABLE = 25  # number of dwells for which the look-up table is asked


@dataclass(frozen=True)
class Vehicle:
    """Twists and lags of both directions; index 0 is σ = +1, index 1 is σ = −1."""

    twist: Floats  # (2, 3): forward, left, yaw rate
    dwells: Floats  # (D,)
    lag: Floats  # (2, D, 3): x forward, y left, heading
    relative_error: Mapping[str, float]  # one-sigma errors of the look-up table
    tail_gap: float

    def lag_at(self, sense: int, time: Floats) -> Floats:
        """Lag of direction `sense` after `time` (...), (..., 3)."""
        table = self.lag[0 if sense > 0 else 1]
        parts = [np.interp(time, self.dwells, table[:, i]) for i in range(3)]
        return np.stack(parts, -1)

    def motion(self, sense: int, time: Floats, *, share: float = 1.0) -> Floats:
        """Pose change E_σ after `time` (...); `share` of the lag (½ from rest)."""
        twist = self.twist[0 if sense > 0 else 1]
        return planar.compose(share * self.lag_at(sense, time), planar.arc(twist, time))

    @property
    def yaw_rate(self) -> float:
        """Mean |Ω| of the two directions."""
        return float(np.abs(self.twist[:, 2]).mean())

    @property
    def pivot_distance(self) -> float:
        """a = R sin θ: distance from the pivot to the head's centre."""
        return float((self.twist[:, 1] / self.twist[:, 2]).mean())

    @property
    def pivot_radius(self) -> float:
        """R cos θ: turn radius of the pivot."""
        return float(np.abs(self.twist[:, 0] / self.twist[:, 2]).max())

    @property
    def turn_radius(self) -> float:
        """R_yr/l of the head's centre, the larger of the two."""
        return float((np.hypot(self.twist[:, 0], self.twist[:, 1]) / np.abs(self.twist[:, 2])).max())

    def net_speed(self, dwell: float) -> float:
        """Speed along a straight line with equal dwells."""
        one = self.motion(1, np.array(dwell))
        pair = planar.compose(one, self.motion(-1, np.array(dwell)))
        return float(np.hypot(pair[0], pair[1]) / (2 * dwell))

    def perturbed(self, rng: np.random.Generator) -> Vehicle:
        """The vehicle with random errors that are as large as the held-out errors of the table."""
        e = self.relative_error
        speed = float(np.hypot(self.twist[0, 0], self.twist[0, 1]))
        yaw = abs(float(self.twist[0, 2]))
        twist = self.twist.copy()
        twist[:, 1:] *= 1 + rng.normal(size=2) * [e["v_x"], e["omega_yr_bar"]]
        twist[:, 0] += rng.normal() * e["v_z"] * speed
        offset = rng.normal(size=3) * [e["lag_z"] * speed, e["lag_x"] * speed, e["lag_psi_rad"] * yaw]
        lag = self.lag + np.stack([offset, offset * planar.MIRROR])[:, None]
        return replace(self, twist=twist, lag=lag)


def vehicle_of(robot: Robot, lookup: LookupTable) -> Vehicle:
    """The vehicle that the look-up table predicts for a robot.

    Raises:
        InputError: the robot is outside the table's domain, or moves backwards on average.
    """
    low, high = lookup.domain["dwell_bar"]
    dwells = np.geomspace(low, high, _TABLE)
    values = {k: np.full(_TABLE, v) for k, v in robot.group_values().items()}
    found = lookup.query({**values, "dwell_bar": dwells})
    twist = np.array([found[k][0] for k in ("v_z", "v_x", "omega_yr_bar")])
    if twist[0] <= 0:
        raise InputError(
            f"robot {robot.name!r} does not move forward (v_z = {twist[0]:.3g}); turn its motor slower"
        )
    lag = np.stack([found["lag_z"], found["lag_x"], found["lag_psi_rad"]], -1)
    lag = np.concatenate([np.zeros((1, 3)), lag])
    dwells = np.concatenate([[0.0], dwells])
    return Vehicle(
        twist=np.stack([twist, twist * planar.MIRROR]),
        dwells=dwells,
        lag=np.stack([lag, lag * planar.MIRROR]),
        relative_error={name: error["rms"] for name, error in lookup.errors.items()},
        tail_gap=float(found["tail_gap"][0]),
    )
