"""The track of a robot that turns at a constant rate and reverses it at known times."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd

RATE, SPEED = 0.1, 2e-3  # rad/s, m/s
DWELLS = np.random.default_rng(0).uniform(3.0, 6.0, 60)  # s
FLIPS = np.append(0.0, np.cumsum(DWELLS))
PLAN: dict[str, Any] = {"id": "p1", "first_direction": -1, "dwell_s": DWELLS.tolist()}


def poses_at(time: np.ndarray, flips: np.ndarray = FLIPS) -> np.ndarray:
    """Integrate the motion (n, 3) [m, rad]; before the first dwell and after the last one the robot rests."""
    fine = np.linspace(0.0, flips[-1], 200_001)
    sense = np.where((np.searchsorted(flips, fine, side="right") - 1) % 2, 1.0, -1.0)
    step = fine[1]
    heading = 3.0 + np.append(0.0, np.cumsum(RATE * step * sense[:-1]))
    x, y = (np.append(0.0, np.cumsum(SPEED * step * side(heading)[:-1])) for side in (np.cos, np.sin))
    return np.stack([np.interp(time, fine, values) for values in (x, y, heading)], 1)


def track(
    every: float = 0.4, *, rest: float = 0.0, noise: float = 1.0, seed: int = 1, flips: np.ndarray = FLIPS
) -> pd.DataFrame:
    """Make the track that a camera sees, with headings from −180° to 180°; noise: of 0.3 mm and 0.5°."""
    time = np.arange(-rest, flips[-1] + rest + 1e-9, every)
    poses = poses_at(time, flips)
    poses += noise * np.random.default_rng(seed).normal(size=poses.shape) * [3e-4, 3e-4, np.radians(0.5)]
    dwell = np.searchsorted(flips, time, side="right") - 1
    turning = (time >= 0) & (time < flips[-1])
    return pd.DataFrame({
        "time_s": time, "x_cm": 100 * poses[:, 0], "y_cm": 100 * poses[:, 1],
        "heading_deg": np.degrees((poses[:, 2] + np.pi) % (2 * np.pi) - np.pi),
        "direction": np.where(dwell % 2, 1, -1) * turning,
    })  # fmt: skip
