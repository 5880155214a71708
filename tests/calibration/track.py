"""A camera track, drawn."""

from __future__ import annotations

import numpy as np
import pandas as pd

RATE, RADIUS, SLIP = -0.14, 10.0, 70.0


def track(seed: int, *, rate: float = RATE, seconds: float = 60.0, wobble: float = 0.1) -> pd.DataFrame:
    """A robot on a circle, wobbling with its disc, seen with noise."""
    rng = np.random.default_rng(seed)
    time = np.arange(0, seconds, 0.2)
    angle = 0.4 + rate * time
    heading = angle + np.sign(rate) * np.pi / 2 + np.radians(SLIP)
    swing = wobble * np.cos(1.7 * time + rng.uniform(0, 6))
    return pd.DataFrame(
        {
            "run": 1,
            "time_s": time,
            "x_cm": 3 + (RADIUS + swing) * np.cos(angle) + rng.normal(scale=0.05, size=len(time)),
            "y_cm": -2 + (RADIUS + swing) * np.sin(angle) + rng.normal(scale=0.05, size=len(time)),
            "heading_deg": np.degrees(heading + rng.normal(scale=0.01, size=len(time))) % 360,
        }
    )
