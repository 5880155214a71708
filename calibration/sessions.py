"""Groups of runs: sessions, and where there are fewer than three, blocks of conditions in their place.

A whole group is locked away for the test and groups are left out in turn, so there must be a few. Blocks are drawn
from the conditions within a session, repeats together. A shift of a whole session is then not noise to anyone: the
coefficients and effects take it up, and the locked test cannot show it. That is said with the verdict (`limits`).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

FEWEST = 3
_BLOCKS = 4  # in all

Labels = NDArray[np.int64]


def groups(names: NDArray[np.str_], condition: Labels) -> tuple[Labels, tuple[str, ...], tuple[str, ...]]:
    """Sessions or their blocks.

    Args:
        names: (n,) session of each run.
        condition: (n,) repeats share a number.

    Returns:
        (n,) numbers of the groups, their names, and what having fewer than three sessions leaves unknown.
    """
    kinds, session = np.unique(names, return_inverse=True)
    session = session.reshape(-1).astype(np.int64)
    if len(kinds) >= FEWEST:
        return session, tuple(str(k) for k in kinds), ()
    parts = _BLOCKS // len(kinds)
    block = np.empty_like(session)
    found = []
    rng = np.random.default_rng(0)
    for s, name in enumerate(kinds):
        own = session == s
        place = np.unique(condition[own], return_inverse=True)[1].reshape(-1)
        block[own] = s * parts + rng.permutation(place.max() + 1)[place] % parts
        found += [f"{name}, block {i + 1} of its conditions" for i in range(parts)]
    count = "one session" if len(kinds) == 1 else f"{len(kinds)} sessions"
    limit = (
        f"runs of {count}: the locked runs are a quarter of the conditions, not a session of their own, so the "
        "error on them, the intervals and the verdict do not allow for what would differ in another session"
    )
    return block, tuple(found), (limit,)
