"""How close the tails come to each other.

gap = min |x − y| / (2 r0) over nodes x of one tail and points y on the edges of another. At 1 the tails touch. The
base model has no contact, so rows below 1 are kept and flagged. With the effect `tail_contact`, rows are flagged
only where the gap is not kept (`sim.effects.tail_contact.least_gap`). Distances are from nodes to edges. Where two
edges cross between their nodes, the error of the distance is at most half an edge. Units: l.
"""

from __future__ import annotations

import numpy as np

from sim.arrays import Floats
from sim.jit import compiled


@compiled
def tail_gap(x: Floats, offset: float, radius: float) -> float:
    """Compute the smallest distance between two tails over 2 r0; infinite for one tail.

    Args:
        x: free nodes at one instant, (n, N, 3), every tail turned so that its clamp lies at (offset, 0, 0).
        offset, radius: a/l and r0/l.
    """
    n, tails, _ = x.shape
    smallest = np.inf
    for i in range(tails):
        for j in range(tails):
            if i == j:
                continue
            angle = 2 * np.pi * (j - i) / tails
            cos, sin = np.cos(angle), np.sin(angle)
            px, py, pz = cos * offset, sin * offset, 0.0
            for k in range(n):
                qx, qy, qz = cos * x[k, j, 0] - sin * x[k, j, 1], sin * x[k, j, 0] + cos * x[k, j, 1], x[k, j, 2]
                ex, ey, ez = qx - px, qy - py, qz - pz
                scale = 1 / (ex * ex + ey * ey + ez * ez)
                for node in range(n):
                    ax, ay, az = x[node, i, 0] - px, x[node, i, 1] - py, x[node, i, 2] - pz
                    share = min(max((ax * ex + ay * ey + az * ez) * scale, 0.0), 1.0)
                    ax, ay, az = ax - share * ex, ay - share * ey, az - share * ez
                    smallest = min(smallest, ax * ax + ay * ay + az * az)
                px, py, pz = qx, qy, qz
    return np.sqrt(smallest) / (2 * radius)


@compiled
def smallest_gaps(shapes: Floats, offset: Floats, radius: Floats) -> Floats:
    """Compute the smallest `tail_gap` of B robots with a/l and r0/l (B,) over S shapes, (B, S, n, N, 3)."""
    gaps = np.full(len(shapes), np.inf)
    for i in range(len(shapes)):
        for k in range(shapes.shape[1]):
            gaps[i] = min(gaps[i], tail_gap(shapes[i, k], offset[i], radius[i]))
    return gaps
