"""What a camera measures of a steady motion: the outputs of a table and their derivatives.

    v = v_head + ω_yr × (p L ahead),   θ = ∠(v, axis),   |v + U| along the path,   R = |v + U|/|ω_yr|,

with the tracked point p head lengths L ahead of the head's centre, and a current U of the fluid in the lab, along
the path. A path that covers a part of a circle, followed at the rate of the heading, has this radius.
Outputs are ln |output|, θ in radians.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from common.arrays import Floats


@dataclass(frozen=True)
class Observation:
    """How m runs are observed."""

    outputs: tuple[str, ...]
    time: Floats  # (m,) time scale [s]
    length: Floats  # (m,) tail length [m]
    ahead: Floats  # (m,) L/l
    point: Floats  # (m,) p
    current: Floats  # (m,) U along the path [m/s]
    camera: Floats  # (m,) lengths and speeds as seen over the true ones

    def see(self, motion: Mapping[str, Floats]) -> Floats:
        """Compute outputs (m, k) of motions (m,) in the simulator's units."""
        yaw, surge = motion["omega_yr_bar"], motion["v_z"]
        sway = motion["v_x"] + yaw * self.point * self.ahead
        seen = np.hypot(sway, surge) * self.length / self.time + self.current
        with np.errstate(divide="ignore", invalid="ignore"):
            values = {
                "omega_h": np.log(np.abs(motion["omega_h_bar"]) / self.time),
                "omega_t": np.log(np.abs(motion["omega_t_bar"]) / self.time),
                "omega_yr": np.log(np.abs(yaw) / self.time),
                "R_yr": np.log(self.camera * seen * self.time / np.abs(yaw)),
                "theta": np.arctan2(np.abs(sway), surge),
                "v": np.log(self.camera * seen),
            }
        return np.stack([values[name] for name in self.outputs], 1)

    def slopes(
        self,
        motion: Mapping[str, Floats],
        change: Mapping[str, Floats],
        *,
        point: float = 0.0,
        current: float = 0.0,
        camera: float = 0.0,
        scales: Mapping[str, Floats] | None = None,
    ) -> Floats:
        """Compute derivatives (m, k) along a change of motion, tracked point, current and scales.

        Args:
            camera: change of ln of the camera's scale.
            scales: changes (m,) of ln "time", ln "length" and ln "ahead".
        """
        none = np.zeros(len(self.time))
        slower, longer, further = (dict(scales or {}).get(name, none) for name in ("time", "length", "ahead"))
        yaw, surge = motion["omega_yr_bar"], motion["v_z"]
        sway = motion["v_x"] + yaw * self.point * self.ahead
        turn, rise = change.get("omega_yr_bar", none), change.get("v_z", none)
        side = change.get("v_x", none) + (turn * self.point + yaw * (point + self.point * further)) * self.ahead
        speed = np.hypot(sway, surge)
        faster = (sway * side + surge * rise) / speed
        seen = speed * self.length / self.time + self.current
        along = ((faster + speed * (longer - slower)) * self.length / self.time + current) / seen + camera
        values = {
            "omega_h": change.get("omega_h_bar", none) / motion["omega_h_bar"] - slower,
            "omega_t": change.get("omega_t_bar", none) / motion["omega_t_bar"] - slower,
            "omega_yr": turn / yaw - slower,
            "R_yr": along + slower - turn / yaw,
            "theta": np.sign(sway) * (surge * side - sway * rise) / speed**2,
            "v": along,
        }
        return np.stack([values[name] for name in self.outputs], 1)
