"""The shortest order of visits, each of which may be made in several ways.

A visit has C options, such as the headings at a place. Going from option c of visit i to option d of visit j costs
costs[i, c, j, d]. With up to EXACT visits the order is exact: dynamic programming over the sets of visits that are
done (Held and Karp, J. SIAM 10, 1962), with the options beside the last visit. Where the cost of ending depends on
the first visit, as on a closed tour, this is done for each first visit. With more, moves of up to three visits and
reversals improve the order until none helps. A lower bound says how far it may be from the shortest: the shortest
walk of as many visits, which may visit one twice and another never, with prices that make such walks expensive
(Christofides, Mingozzi and Toth, Networks 11, 1981), found by subgradient ascent.
"""

from __future__ import annotations

from heapq import heapify, heappop, heappush
from itertools import chain, repeat
from typing import NamedTuple

import numpy as np

from common.arrays import Floats, Integers
from common.errors import InputError

EXACT = 12  # visits
MOST = 80
_RIVALS = 40  # next best orders that are listed at most
_NEAR = 1.05  # times the cost of the best one; rivals cost no more
_STARTS = 6  # of the search for a short order
_LONGEST_MOVED = 3  # visits that are moved together
_PASSES = 200
_ASCENTS = 150  # of the prices
_BATCH = 4_000_000  # costs that are compared at once


class Order(NamedTuple):
    """Visits in their order, what it costs, and what no order can cost less than."""

    visits: list[int]
    cost: float
    bound: float
    rivals: list[list[int]]  # the next best orders, if they cost little more; none where the order is not exact

    @property
    def gap(self) -> float:
        """How much more than the shortest order it costs at most, as a share of it."""
        return max(self.cost / self.bound - 1.0, 0.0) if self.bound > 0 else 0.0


def shortest_order(costs: Floats, start: Floats, end: Floats) -> Order:
    """Find a short order of n visits with C options each.

    Args:
        costs: (n, C, n, C), from an option of one visit to an option of another; infinite where there is no way.
        start: (n, C), of beginning with a visit; infinite where that is not allowed.
        end: (n, C), of ending with it; or (n, n, C), of ending with the second visit, begun with the first.

    Raises:
        InputError: there are too many visits, or there is no order.
    """
    count = len(costs)
    if count > MOST:
        raise InputError(f"{count} visits; at most {MOST} can be ordered: leave some out, or plan in parts")
    order = _exact(costs, start, end) if count <= EXACT else _searched(costs, start, end)
    if not np.isfinite(order.cost):
        raise InputError("there is no way from each of the visits to another one")
    return order


def _exact(costs: Floats, start: Floats, end: Floats) -> Order:
    """Find the shortest order, and its rivals."""
    count = len(costs)
    if end.ndim == 2:
        found = _shortest(costs, start, end)
    else:
        begins = [np.where(np.arange(count)[:, None] == first, start, np.inf) for first in range(count)]
        found = sorted(chain.from_iterable(map(_shortest, repeat(costs), begins, end)))
    if not found:
        return Order([], np.inf, np.inf, [])
    (cost, visits), *others = found
    rivals = [order for total, order in others[:_RIVALS] if total <= _NEAR * cost]
    return Order(visits, cost, cost, rivals)


def _shortest(costs: Floats, start: Floats, end: Floats) -> list[tuple[float, list[int]]]:
    """List the shortest orders with their costs, by dynamic programming over sets of visits."""
    count, options = start.shape
    arriving = np.ascontiguousarray(costs.transpose(2, 0, 1, 3)).reshape(count, count * options, options)
    best = np.full((1 << count, count, options), np.inf)  # of a set of visits that ends with one of them
    best[1 << np.arange(count), np.arange(count)] = start
    for done in range(1, 1 << count):
        for j in _members(done):
            before = best[done ^ 1 << j]
            if np.isfinite(before).any():
                best[done, j] = (before.reshape(-1, 1) + arriving[j]).min(0)
    # Orders are put together from their ends; what their begins cost is known, so the shortest come first.
    found: list[tuple[float, list[int]]] = []
    done, limit = (1 << count) - 1, np.inf
    ends = [(float((best[done, j] + end[j]).min()), [j], done, end[j]) for j in range(count)]
    heapify(ends)
    while ends and len(found) <= _RIVALS and ends[0][0] < limit:
        total, visits, done, after = heappop(ends)
        done ^= 1 << visits[0]
        if not done:
            found.append((total, visits))
            limit = _NEAR * found[0][0] + 1e-9
        for i in _members(done):
            onward = (costs[i, :, visits[0]] + after).min(-1)
            heappush(ends, (float((best[done, i] + onward).min()), [i, *visits], done, onward))
    return found


def _members(done: int) -> list[int]:
    """List the visits of a set."""
    return [j for j in range(done.bit_length()) if done >> j & 1]


def _searched(costs: Floats, start: Floats, end: Floats) -> Order:
    """Improve orders by moves and reversals until none helps, and bound the shortest one from below."""
    count = len(costs)
    nearest = costs.min((1, 3))
    np.fill_diagonal(nearest, np.inf)
    firsts = np.argsort(start.min(1))[: min(_STARTS, count)]
    best, lowest = np.arange(count), np.inf
    for first in firsts[np.isfinite(start.min(1)[firsts])].tolist():
        order = _greedy(nearest, first)
        cost = float(_costs(costs, start, end, order[None])[0])
        for _ in range(_PASSES):
            neighbours = _neighbours(order)
            totals = _costs(costs, start, end, neighbours)
            at = int(totals.argmin())
            if not totals[at] < cost - 1e-9:
                break
            order, cost = neighbours[at], float(totals[at])
        if cost < lowest:
            best, lowest = order, cost
    return Order(best.tolist(), lowest, _bound(costs, start, end, lowest), [])


def _greedy(nearest: Floats, first: int) -> Integers:
    """Go to the nearest visit again and again."""
    order, left = [first], set(range(len(nearest))) - {first}
    while left:
        rows = sorted(left)
        order.append(rows[int(nearest[order[-1], rows].argmin())])
        left.remove(order[-1])
    return np.array(order)


def _neighbours(order: Integers) -> Integers:
    """List the orders (B, n) that differ by one reversed part, or by a few visits moved elsewhere."""
    count, found = len(order), []
    for i in range(count):
        for j in range(i + 1, count):
            found.append(np.concatenate([order[:i], order[i : j + 1][::-1], order[j + 1 :]]))
    for size in range(1, min(_LONGEST_MOVED, count - 1) + 1):
        for i in range(count - size + 1):
            part, rest = order[i : i + size], np.concatenate([order[:i], order[i + size :]])
            for j in range(len(rest) + 1):
                if j != i:
                    found += [np.concatenate([rest[:j], moved, rest[j:]]) for moved in (part, part[::-1])[:size]]
    return np.array(found)


def _costs(costs: Floats, start: Floats, end: Floats, orders: Integers) -> Floats:
    """Compute the costs (B,) of orders (B, n), with the best options of each."""
    options = start.shape[1]
    block = max(1, _BATCH // options**2)
    parts = []
    by_pair = costs.transpose(0, 2, 1, 3)
    for begin in range(0, len(orders), block):
        some = orders[begin : begin + block]
        total = start[some[:, 0]]
        for k in range(1, some.shape[1]):
            total = (total[:, :, None] + by_pair[some[:, k - 1], some[:, k]]).min(1)
        parts.append((total + _ending(end, some[:, 0], some[:, -1])).min(1))
    return np.concatenate(parts)


def _ending(end: Floats, first: Integers, last: Integers) -> Floats:
    """Return what ending with a visit costs (..., C) after beginning with another."""
    return np.asarray(end[last] if end.ndim == 2 else end[first, last])


def _bound(costs: Floats, start: Floats, end: Floats, cost: float) -> float:
    """Bound the cost of all orders from below."""
    count, options = start.shape
    end = end if end.ndim == 2 else end.min(0)
    flat = costs.reshape(count * options, count * options).copy()
    for j in range(count):  # no visit twice in a row
        flat[j * options : (j + 1) * options, j * options : (j + 1) * options] = np.inf
    prices, best, step = np.zeros(count), -np.inf, 1.0
    owner = np.repeat(np.arange(count), options)
    for _ in range(_ASCENTS):
        paid = prices[owner]
        total, back = start.ravel() + paid, []
        for _ in range(count - 1):
            sums = total[:, None] + flat
            back.append(sums.argmin(0))
            total = sums.min(0) + paid
        at = int((total + end.ravel()).argmin())
        bound = float((total + end.ravel())[at] - prices.sum())
        visited = np.zeros(count)
        visited[owner[at]] += 1
        for came in reversed(back):
            at = int(came[at])
            visited[owner[at]] += 1
        step = step if bound > best else 0.95 * step
        best = max(best, bound)
        off = visited - 1
        if not off.any():
            break
        prices = prices + step * max(cost - bound, 1e-9 * abs(cost)) / float((off**2).sum()) * off
    return min(best, cost)
