"""Groups of runs that are locked away or left out together: sessions, or blocks of conditions if sessions are few.

Blocks are drawn from the conditions within a session; repeats stay together. The shift of a single session cannot
be estimated. Its variance is taken to be `noise.SESSION_SHARE`, so a shift of all its runs is no evidence.
"""

from __future__ import annotations

import numpy as np

from calibration.statistics.forward_model import Runs
from sim.arrays import Flags, Integers

_FEWEST = 3
_BLOCKS = 4  # in all

Labels = Integers


def groups(data: Runs) -> tuple[Labels, tuple[str, ...]]:
    """Numbers (n,) of the groups, and their names."""
    count = len(data.session_names)
    if count >= _FEWEST:
        return data.session, data.session_names
    parts = _BLOCKS // count
    block = np.empty_like(data.session)
    rng = np.random.default_rng(0)
    for session in range(count):
        own = data.session == session
        place = np.unique(data.condition[own], return_inverse=True)[1].reshape(-1)
        block[own] = session * parts + rng.permutation(place.max() + 1)[place] % parts
    names = (f"{name}, block {i + 1} of its conditions" for name in data.session_names for i in range(parts))
    return block, tuple(names)


def divided(data: Runs, locked: Flags) -> bool:
    """Whether some runs of a session are `locked` (n,) and others are not."""
    return bool(set(data.session[locked]) & set(data.session[~locked]))


def limits(data: Runs, locked: Flags) -> tuple[str, ...]:
    """What is weaker if the `locked` runs (n,) are not whole sessions, in words."""
    count = len(data.session_names)
    if count >= _FEWEST or not divided(data, locked):
        return ()
    found = (
        f"{count} session{'s' * (count > 1)} only: the locked runs are a quarter of the conditions, not a session "
        "of their own, so the error on them does not contain the differences between sessions"
    )
    if count == 1:
        found += ", and a shift that is equal in all runs is no evidence for an effect"
    return (found,)
