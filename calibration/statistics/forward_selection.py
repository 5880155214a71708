"""Forward selection: terms of a model are added one at a time, as long as they predict left-out runs better."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TypeVar

import numpy as np

Terms = TypeVar("Terms", bound=tuple[object, ...])


def select_forward(
    start: Terms,
    larger: Callable[[Terms], Sequence[Terms]],
    left_out_error: Callable[[Terms], float],
    *,
    most: int,
    gain: float,
) -> Terms:
    """Choose terms, in the order in which they were added.

    Args:
        start: terms to begin with.
        larger: all choices that have one term more.
        left_out_error: of a choice, on runs that it has not seen.
        most: terms.
        gain: share of the error that a term must save.
    """
    chosen, least = start, left_out_error(start)
    while len(chosen) < most and (choices := larger(chosen)):
        tried = [left_out_error(choice) for choice in choices]
        best = int(np.argmin(tried))
        if tried[best] > (1 - gain) * least:
            break
        chosen, least = choices[best], tried[best]
    return chosen
