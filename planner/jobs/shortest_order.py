"""The shortest order of visits, each of which may be made in several ways.

A visit has C options, such as the headings at a place or the directions of a lane. Going from option c of visit i
to option d of visit j costs costs[i, c, j, d]. With up to EXACT visits the order is exact: dynamic programming
over the sets of visits that are done (Held and Karp, J. SIAM 10, 1962), with the options beside the last visit.
With more, moves of up to three visits and reversals improve the order until none helps. A lower bound says how far
it may be from the shortest: the shortest walk of as many visits, which may visit one twice and another never, with
prices that make such walks expensive (Christofides, Mingozzi and Toth, Networks 11, 1981), found by subgradient
ascent.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from sim.arrays import Floats, Integers
from sim.io.errors import InputError

EXACT = 12  # visits
MOST = 80
_STARTS = 6  # of the search for a short order
_LONGEST_MOVED = 3  # visits that are moved together
_PASSES = 200
_ASCENTS = 150  # of the prices
_BATCH = 4_000_000  # costs that are compared at once


class Order(NamedTuple):
    """Visits in their order, the option of each, what it costs, and what no order can cost less than."""

    visits: list[int]
    options: list[int]
    cost: float
    bound: float

    @property
    def gap(self) -> float:
        """How much more than the shortest order it costs at most, as a share of it."""
        return max(self.cost / self.bound - 1.0, 0.0) if self.bound > 0 else 0.0


def shortest_order(costs: Floats, start: Floats, end: Floats) -> Order:
    """Find a short order of n visits with C options each.

    Args:
        costs: (n, C, n, C), from an option of one visit to an option of another; infinite where there is no way.
        start: (n, C), of beginning with a visit; infinite where that is not allowed.
        end: (n, C), of ending with it.

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
    """Find the shortest order by dynamic programming over sets of visits."""
    count, options = start.shape
    flat = costs.reshape(count * options, count, options)
    best = np.full((1 << count, count, options), np.inf)
    came = np.full((1 << count, count, options), -1, dtype=np.int32)
    for j in range(count):
        best[1 << j, j] = start[j]
    for done in range(1, 1 << count):
        inside = [j for j in range(count) if done >> j & 1]
        outside = [j for j in range(count) if not done >> j & 1]
        if not outside:
            continue
        rows = (np.array(inside)[:, None] * options + np.arange(options)).ravel()
        totals = best[done, inside].reshape(-1, 1, 1) + flat[rows][:, outside]
        chosen = totals.argmin(0)
        least = np.take_along_axis(totals, chosen[None], 0)[0]
        for place, j in enumerate(outside):
            best[done | 1 << j, j], came[done | 1 << j, j] = least[place], rows[chosen[place]]
    done = (1 << count) - 1
    total = best[done] + end
    at = int(total.argmin())
    cost, visits, chosen_options = float(total.ravel()[at]), [], []
    while at >= 0:
        j, option = divmod(at, options)
        visits.append(j)
        chosen_options.append(option)
        at, done = int(came[done, j, option]), done & ~(1 << j)
    return Order(visits[::-1], chosen_options[::-1], cost, cost)


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
    return Order(best.tolist(), _options(costs, start, end, best), lowest, _bound(costs, start, end, lowest))


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
        parts.append((total + end[some[:, -1]]).min(1))
    return np.concatenate(parts)


def _options(costs: Floats, start: Floats, end: Floats, order: Integers) -> list[int]:
    """Choose the best option of each visit of an order."""
    total, back = start[order[0]], []
    for i, j in zip(order[:-1].tolist(), order[1:].tolist(), strict=True):
        sums = total[:, None] + costs[i, :, j]
        back.append(sums.argmin(0))
        total = sums.min(0)
    options = [int((total + end[order[-1]]).argmin())]
    for came in reversed(back):
        options.append(int(came[options[-1]]))
    return options[::-1]


def _bound(costs: Floats, start: Floats, end: Floats, cost: float) -> float:
    """Bound the cost of all orders from below."""
    count, options = start.shape
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
