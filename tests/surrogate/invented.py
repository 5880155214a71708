"""A data set in closed form."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from dataset.store import write_rows
from tests.dataset import sweeps


def invented(folder: Path, rows: int = 512) -> Path:
    """A data set with outputs in closed form, so that learning is tested without simulating."""
    if (folder / "data").exists():
        return folder / "data"
    sweep = sweeps.design(rows)
    columns = sweeps.invented(sweep.points())
    whole = {"failed": np.zeros(rows, bool), "converged": np.ones(rows, bool), "row": np.arange(rows)}
    write_rows(folder / "data", sweep.config(), {**columns, **whole}, code="test")
    return folder / "data"
