"""How close the tails come to each other.

gap = min |x − y| / (2 r0) over nodes x of one tail and segments y of another: at 1 they touch. The model
has no contact, so rows below 1 are kept and flagged. (Distances from nodes to segments; two segments
that cross between nodes are seen to within half an edge.)
"""

from __future__ import annotations

import torch
from torch import Tensor

from sim.balance import Swimmer


def tail_gap(swimmer: Swimmer, x: Tensor) -> Tensor:
    """Smallest distance between two tails over 2 r0, (B,); infinite for one tail; x is (n, 3, N, B)."""
    nodes = torch.cat([swimmer.root, x])
    smallest = torch.full_like(swimmer.tail_radius, torch.inf)
    for j in range(swimmer.tails):
        for k in range(swimmer.tails):
            if j != k:
                smallest = torch.minimum(smallest, _node_to_segment(nodes[:, :, j], nodes[:, :, k]))
    return smallest / (2 * swimmer.tail_radius)


def _node_to_segment(points: Tensor, chain: Tensor) -> Tensor:
    """Smallest distance from points (P, 3, B) to the segments of chain (n + 1, 3, B), (B,)."""
    start, along = chain[:-1], chain[1:] - chain[:-1]
    away = points.unsqueeze(1) - start.unsqueeze(0)  # (P, n, 3, B)
    share = ((away * along).sum(2) / (along * along).sum(1)).clamp(0, 1)
    distance = (away - share.unsqueeze(2) * along).square().sum(2)
    return distance.amin((0, 1)).sqrt()
