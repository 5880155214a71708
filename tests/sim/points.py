"""Points of the shipped sweep for tests."""

from __future__ import annotations

import numpy as np

from dataset.rows.design import load_design


def sweep_points(count: int) -> dict[str, np.ndarray]:
    """Return the columns of the first `count` robots of sweep.toml."""
    return load_design().with_rows(count).points()
