"""What a camera measures of a steady motion: the outputs of a table.

    v = v_head + ω_yr × (p L ahead),   V = U_p + √(|v|² − U_n²),   θ = ∠(v, axis) + asin(U_n/|v|),   R = V/|ω_yr|,

with the tracked point p head lengths L ahead of the head's centre, and a current U of the fluid in the lab: U_p
along the path that is seen, whose direction is the course, and U_n to the side to which the robot turns. So v has
−U_n across it. A path that covers a part of a circle, followed at the rate of the heading,
has this radius.
Outputs are ln |output|, θ in radians.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from common.arrays import Floats


@dataclass(frozen=True)
class Observation:
    """How runs are observed; each number is (P, n), or broadcasts to it."""

    outputs: tuple[str, ...]
    time: Floats  # time scale [s]
    length: Floats  # tail length [m]
    ahead: Floats  # L/l
    point: Floats  # p
    along: Floats  # U_p [m/s]
    across: Floats  # U_n [m/s]
    camera: Floats  # lengths and speeds as seen over the true ones
    turned: Floats  # by which θ is off

    def see(self, motion: Mapping[str, Floats]) -> Floats:
        """Compute outputs (P, n, k) of motions (P, n) in the simulator's units."""
        yaw, surge = motion["omega_yr_bar"], motion["v_z"]
        sway = motion["v_x"] + yaw * self.point * self.ahead
        own = np.hypot(sway, surge) * self.length / self.time
        with np.errstate(divide="ignore", invalid="ignore"):
            tilt = np.arcsin(np.clip(self.across / own, -1, 1))
            seen = self.along + own * np.cos(tilt)
            values = {
                "omega_h": np.log(np.abs(motion["omega_h_bar"]) / self.time),
                "omega_t": np.log(np.abs(motion["omega_t_bar"]) / self.time),
                "omega_yr": np.log(np.abs(yaw) / self.time),
                "R_yr": np.log(self.camera * seen * self.time / np.abs(yaw)),
                "theta": np.arctan2(np.abs(sway), surge) + tilt + self.turned,
                "v": np.log(self.camera * seen),
            }
        return np.stack([values[name] for name in self.outputs], -1)
