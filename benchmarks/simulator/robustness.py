"""Convergence for 4,096 random robots over a range wider than the sweep's.

Every input lies between half the sweep's lower end and twice its upper one, N between 1 and 10.

Every row must either be converged and verified (balanced to 1e-5 in the direct route, unchanged mean in time
stepping) or say why it is not; no NaN in a converged row, no warning, no hang.

Usage: python -m benchmarks robustness [ROWS]

Takes 2 minutes.
"""

from __future__ import annotations

import time
import warnings
from collections import Counter

import numpy as np
from scipy.stats import qmc

from dataset.design import load_design
from sim.model.groups import GROUP_COLUMNS
from sim.motion.batches import steady_columns


def robots(rows: int, *, seed: int = 0) -> dict[str, np.ndarray]:
    """Draw columns of random robots over the wide domain."""
    axes = load_design().axes
    share = qmc.Sobol(len(GROUP_COLUMNS), scramble=True, rng=np.random.default_rng(seed)).random(rows)
    columns = {}
    for i, name in enumerate(GROUP_COLUMNS):
        low, high = axes[name].low / 2, 2 * axes[name].high
        columns[name] = low * (high / low) ** share[:, i]
    columns["N"] = 1.0 + np.floor(2 * axes["N"].high * share[:, GROUP_COLUMNS.index("N")])
    return columns


def main(rows: str = "4096") -> None:
    points = robots(int(rows))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        began = time.perf_counter()
        columns = steady_columns(points, title="robustness")
        spent = time.perf_counter() - began
    names = ("omega_t_bar", "omega_h_bar", "omega_yr_bar", "v_x", "v_z", "R_yr_over_l", "theta_deg", "error")
    good = columns["converged"]
    finite = np.all([np.isfinite(columns[name]) for name in names], 0)
    silent = int((~good & (columns["note"] == "")).sum())
    print(f"\n{rows} robots over the wide domain, {spent:.0f} s")
    print(f"  {int(good.sum())} converged, {int((good & (columns['method'] == 'direct')).sum())} of them directly")
    print(f"  NaN or infinity in converged rows: {int((good & ~finite).sum())}; others without a reason: {silent}")
    median, high, largest = 100 * np.quantile(columns["error"][good], [0.5, 0.99, 1.0])
    print(f"  error that rows state: median {median:.3f} %, 99th percentile {high:.2f} %, largest {largest:.1f} %")
    reasons = Counter(_kind(note) for note in columns["note"] if note)
    for reason, count in reasons.most_common():
        print(f"  {count:5} {reason}")
    lonely = ~good & (points["N"] == 1)
    print(f"  unconverged: {int((~good).sum())}, of which {int(lonely.sum())} with a single tail")


def _kind(note: str) -> str:
    return note.split(" by ")[0]
