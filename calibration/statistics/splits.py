"""Splits of the runs: sessions, or blocks of conditions if sessions are few, are held out or left out together.

Blocks are drawn from the conditions within a session; repeats stay together. The shift of a single session cannot
be estimated. Its variance is taken to be `noise.SESSION_SHARE`, so a shift of all its runs is no evidence.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from calibration.statistics.forward_model import Runs
from sim.arrays import Flags, Integers

_FEWEST = 3
_BLOCKS = 4  # in all

Labels = Integers


@dataclass(frozen=True)
class Split:
    """Which runs are fitted, and which are kept for the test."""

    held_out: Flags  # (n,) whole sessions or blocks
    outliers: Flags  # (n,) neither fitted nor tested
    names: str = ""  # of the held-out groups
    reasons: tuple[str, ...] = field(default=())  # for each outlier

    @property
    def fitted(self) -> Flags:
        """(n,) runs from which everything is learnt."""
        return ~self.held_out & ~self.outliers

    @property
    def test(self) -> Flags:
        """(n,) runs on which errors are stated."""
        return self.held_out & ~self.outliers

    @property
    def kept(self) -> Flags:
        """(n,) all runs but outliers, for the final refit."""
        return ~self.outliers


def groups(data: Runs) -> tuple[Labels, tuple[str, ...]]:
    """Number the groups that stay together, (n,), and name them."""
    count = len(data.session_names)
    if count >= _FEWEST:
        return data.session, data.session_names
    parts = _BLOCKS // count
    block = np.empty_like(data.session)
    rng = np.random.default_rng(0)
    for session in range(count):
        members = data.session == session
        condition = np.unique(data.condition[members], return_inverse=True)[1].reshape(-1)
        block[members] = session * parts + rng.permutation(condition.max() + 1)[condition] % parts
    names = (f"{name}, block {i + 1} of its conditions" for name in data.session_names for i in range(parts))
    return block, tuple(names)


def middle_session(data: Runs) -> Flags:
    """Choose the middle session by name, which needs no extrapolation, or a block if sessions are few; (n,)."""
    group, names = groups(data)
    return np.asarray(group == len(names) // 2)


def held_out_names(data: Runs, held_out: Flags) -> str:
    """Name the groups of the `held_out` runs (n,)."""
    group, names = groups(data) if divided(data, held_out) else (data.session, data.session_names)
    return ", ".join(names[g] for g in np.unique(group[held_out]))


def leave_one_group_out(group: Labels, used: Flags) -> Iterator[tuple[Flags, Flags]]:
    """Yield the runs (n,) to learn from and the runs (n,) left out, for every group among those in `used`."""
    for label in np.unique(group[used]):
        yield used & (group != label), used & (group == label)


def divided(data: Runs, held_out: Flags) -> bool:
    """Tell whether some runs of a session are held out and others are not."""
    return bool(set(data.session[held_out]) & set(data.session[~held_out]))


def split_caveats(data: Runs, held_out: Flags) -> tuple[str, ...]:
    """Say what is weaker if the `held_out` runs (n,) are not whole sessions."""
    count = len(data.session_names)
    if count >= _FEWEST or not divided(data, held_out):
        return ()
    caveat = (
        f"{count} session{'s' * (count > 1)} only: the held-out runs are a quarter of the conditions, not a "
        "session of their own, so the error on them does not contain the differences between sessions"
    )
    if count == 1:
        caveat += ", and a shift that is equal in all runs is no evidence for an effect"
    return (caveat,)
