"""Who gives way to whom: priorities between robots that come too near to each other.

At first nobody gives way. Of two robots that come too near to each other one must give way to the other. Both
choices are tried, depth first; the later robot of the list gives way first. A robot that gives way is timed among
all that go before it, directly or through others, and so are those that give way to it and now meet one of them.
Robots that never come near each other have no priorities. The search ends where two robots could not keep apart
if they were alone. This is priority-based search, of Ma, Harabor, Stuckey,
Li and Koenig, "Searching with consistent prioritization for multi-agent path finding", AAAI 2019.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import combinations
from typing import Generic, NamedTuple, TypeVar

M = TypeVar("M")  # a motion
Pairs = frozenset[tuple[int, int]]  # of robots: the first goes before the second


class Resolved(NamedTuple, Generic[M]):
    """Motions that keep apart."""

    motions: tuple[M, ...]
    order: tuple[int, ...]  # of the robots: each gives way only to some of those before it


@dataclass
class Priorities(Generic[M]):
    """The search.

    Args:
        alone: the motions of robots that give way to nobody.
        timed: times the motion of a robot among others; None if there is no such timing.
        meet: returns when two motions come too near to each other first; infinite if they never do.
        most: timings that are tried.
        progress: called now and then with the share of them that are tried.
    """

    alone: tuple[M, ...]
    timed: Callable[[int, tuple[M, ...]], M | None]
    meet: Callable[[M, M], float]
    most: int
    progress: Callable[[float], object] | None = None
    tried: int = 0
    refused: list[tuple[int, dict[int, M]]] = field(default_factory=list)  # a robot, and those before it
    impossible: tuple[int, int] | None = None  # two robots that cannot keep apart, whichever gives way

    def resolve(self) -> Resolved[M] | None:
        """Change motions until no two meet; None if no priorities are found with which this is possible."""
        return self._resolve(self.alone, frozenset())

    def _resolve(self, motions: tuple[M, ...], before: Pairs) -> Resolved[M] | None:
        pairs = combinations(range(len(motions)), 2)
        time, pair = min((self.meet(motions[i], motions[j]), (i, j)) for i, j in pairs)
        if time == math.inf:
            return Resolved(motions, _order(before, len(motions)))
        for first, second in (pair, pair[::-1]):
            more = before | {(first, second)}
            changed = self._giving_way(motions, more, second)
            found = None if changed is None else self._resolve(changed, more)
            if found is not None:
                return found
        return None

    def _giving_way(self, motions: tuple[M, ...], before: Pairs, who: int) -> tuple[M, ...] | None:
        """Time a robot again that has to give way, and those that give way to it."""
        changed = list(motions)
        for k in _order(before, len(motions)):
            above = {each: changed[each] for each in sorted(_above(before, k))}
            met = who in above and any(self.meet(changed[k], each) < math.inf for each in above.values())
            if k != who and not met:
                continue
            if self.impossible is not None or self.tried >= self.most:
                return None
            if self.progress is not None:
                self.progress(self.tried / self.most)
            self.tried += 1
            timed = self.timed(k, tuple(above.values()))
            if timed is None:
                self.refused.append((k, above))
                self.impossible = next(((k, each) for each in above if not self._can_keep_apart(k, each)), None)
                return None
            changed[k] = timed
        return tuple(changed)

    def _can_keep_apart(self, one: int, two: int) -> bool:
        """Tell whether one of two robots can give way to the other, if they are alone."""
        ways = ((one, two), (two, one))
        return any(self.timed(later, (self.alone[first],)) is not None for later, first in ways)


def _above(before: Pairs, k: int) -> set[int]:
    """Find the robots that go before one, directly or through others."""
    above: set[int] = set()
    new = {k}
    while new:
        new = {first for first, second in before if second in new} - above
        above |= new
    return above


def _order(before: Pairs, count: int) -> tuple[int, ...]:
    """Sort robots so that each comes after those that go before it."""
    return tuple(sorted(range(count), key=lambda k: (len(_above(before, k)), k)))
