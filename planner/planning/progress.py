"""What a plan tells while it is made: the stage in words, and the share of the stage that is done."""

from __future__ import annotations

from collections.abc import Callable

Progress = Callable[[str, float], object]

DECLARING = "finding the nearest path that can be followed"
REMEDY = "too tight: looking for a change that helps"
FOLLOWING = "following the path"


def silent(stage: str, share: float) -> None:
    """Tell nothing."""


def of_path(tell: Callable[[float], object] | None) -> Progress:
    """Tell only the share of the path that has been followed; 0 before that."""
    return silent if tell is None else lambda stage, share: tell(share if stage == FOLLOWING else 0.0)
