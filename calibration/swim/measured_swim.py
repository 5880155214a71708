from __future__ import annotations

from dataclasses import dataclass

from common.arrays import Floats


@dataclass(frozen=True)
class MeasuredSwim:
    name: str
    time: Floats
    poses: Floats
    first_direction: int
    flips: Floats
    flip_error: float = 0.0
    clock_known: bool = True
    said: tuple[str, ...] = ()
