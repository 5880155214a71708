"""Proportions with their 95 % intervals (Wilson 1927): p hits of n, as benchmarks print them."""

from __future__ import annotations

import numpy as np
from scipy.stats import norm


def wilson(hits: int, count: int) -> tuple[float, float]:
    """Return the 95 % Wilson interval of a proportion."""
    z = float(norm.ppf(0.975))
    share = hits / count
    centre = (share + z**2 / (2 * count)) / (1 + z**2 / count)
    half = z / (1 + z**2 / count) * np.sqrt(share * (1 - share) / count + z**2 / (4 * count**2))
    return max(centre - half, 0.0), min(centre + half, 1.0)


def per_cent(hits: int, count: int) -> str:
    """Write a proportion with its interval."""
    low, high = wilson(hits, count)
    return f"{100 * hits / count:.1f} % ({100 * low:.0f} to {100 * high:.0f})"
