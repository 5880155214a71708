"""A look-up table as one array of numbers and one of places in it, for the compiled loops of a query.

`places` says where the numbers of each part begin, or −1 for a part that the table lacks:

    WRENCH    three networks of the tails' wrench, each as in `surrogate.networks.compiled.Packed`
    GAP       the network of the gap
    LAG, MEMORY   the networks of the response; that of the memory without its other outputs
    SUPPORT   three supports, see `surrogate.table.support.Support.numbers`; the first is of a single tail's inputs
    RANGES    least and greatest of ω̄, l/R, l/r0 and a/R
    CURVES    logarithms of DWELLS; mean and components of the lag at equal dwells
    FEATURES  shift, scale and halves of the features of the intervals
    WIDTHS    for each of the outputs the weights, the bounds and the factors of its interval
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from sim.arrays import Floats, Integers
from sim.model.response import DWELLS
from surrogate.networks.blocks import in_single_precision
from surrogate.networks.ensemble import SHARED, Ensemble
from surrogate.table.errors import OUTPUTS
from surrogate.table.intervals import GROUPS, PARTS, Intervals
from surrogate.table.response_table import ResponseTable
from surrogate.table.support import Support, monomial_count, products_of, support_room
from surrogate.table.wrench_table import WrenchTable
from surrogate.wrench.balance import solution_room
from surrogate.wrench.motions import lane_rows
from surrogate.wrench.tails import INPUTS, SINGLE_INPUTS

NETWORK = 6  # places of a network
WRENCH, GAP, LAG, MEMORY, SUPPORT, RANGES, CURVES, FEATURES, WIDTHS = 0, 18, 24, 30, 36, 39, 40, 41, 42
# where the monomials of the supports begin among the places: those of INPUTS, and of SINGLE_INPUTS
PRODUCTS = WIDTHS + len(OUTPUTS)
SINGLE_PRODUCTS = PRODUCTS + 2 * monomial_count(len(INPUTS))
DESIGN = 78  # numbers that the logarithm of a width is linear in


class FlatTable(NamedTuple):
    """A table for the compiled loops."""

    numbers: Floats
    places: Integers
    room: int  # numbers that a query of one robot works in
    singles: Floats  # the numbers in single precision, see `surrogate.networks.blocks.in_single_precision`
    block_rows: int  # rows of a block that a query of many robots works in, beside its own


def flat_table(
    tails: WrenchTable,
    curves: ResponseTable,
    supports: Sequence[Support | None],
    ranges: Sequence[tuple[float, float]],
    intervals: Intervals | None,
) -> FlatTable:
    """Return the parts of a table in one array.

    Args:
        tails, curves: the networks.
        supports: of the classes of tails.
        ranges: of ω̄, l/R, l/r0 and a/R.
        intervals: of OUTPUTS; left out if None.
    """
    parts: list[Floats] = []
    places = np.full(PRODUCTS, -1)

    def put(place: int, *arrays: Floats) -> None:
        places[place] = sum(len(part) for part in parts)
        parts.extend(np.asarray(array, dtype=float).ravel() for array in arrays)

    of_memory = first_outputs(curves.networks[1], len(curves.bases["memory"].vectors))
    networks = (*tails.wrench, tails.gap, curves.networks[0], of_memory)
    for i, network in enumerate(networks):
        if network is not None:
            put(NETWORK * i, network.packed.numbers)
            places[NETWORK * i + 1 : NETWORK * (i + 1)] = network.packed.sizes[1:]
    for k, support in enumerate(supports):
        if support is not None:
            put(SUPPORT + k, support.numbers)
    put(RANGES, np.array(ranges).ravel())
    put(CURVES, np.log(DWELLS), curves.equal_dwells.mean, curves.equal_dwells.vectors)
    if intervals is not None:
        put(FEATURES, intervals.shift, intervals.scale, intervals.middle)
        for i, name in enumerate(OUTPUTS):
            if name in intervals.factor:
                bounds = np.array(intervals.bounds[name])
                factor = np.resize(intervals.factor[name], GROUPS * PARTS)
                put(WIDTHS + i, intervals.weights[name], bounds, factor)
    known = [network.packed.sizes for network in networks if network is not None]
    components = int(places[LAG + 2] + places[MEMORY + 2])
    of_support = max(support_room(len(names)) for names in (INPUTS, SINGLE_INPUTS))
    room = of_support + max(solution_room(sizes) for sizes in known) + components + DESIGN
    numbers = np.concatenate(parts)
    block_rows = components + max(of_support, DESIGN, *(lane_rows(sizes) for sizes in known))
    products = [products_of(len(names)).ravel() for names in (INPUTS, SINGLE_INPUTS)]
    return FlatTable(numbers, np.concatenate([places, *products]), room, in_single_precision(numbers), block_rows)


def first_outputs(network: Ensemble, count: int) -> Ensemble:
    """Return a network without its outputs after the first `count`."""

    def cut(name: str, part: Floats) -> Floats:
        whole = name in SHARED[:2] or (name.partition(".")[0] in ("weights", "biases") and name not in last)
        return part if whole else np.ascontiguousarray(part[..., :count])

    state: Mapping[str, Floats] = network.state
    last = {f"{kind}.{len(network.weights) - 1}" for kind in ("weights", "biases")}
    return Ensemble.from_state({name: cut(name, part) for name, part in state.items()})
