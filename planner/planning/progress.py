"""What a plan tells while it is made."""

from __future__ import annotations

from collections.abc import Callable

DECLARING = "finding the nearest path that can be followed"
REMEDY = "too tight: looking for a change that helps"
FOLLOWING = "following the path"

Progress = Callable[[float], object]  # called with a Share


class Share(float):
    """The share of the path that has been followed, with the stage of the plan and the share of the stage."""

    stage: str
    done: float


def tell(progress: Progress | None, stage: str, done: float) -> None:
    """Tell how far a stage is."""
    if progress is not None:
        share = Share(done if stage == FOLLOWING else 0.0)
        share.stage, share.done = stage, done
        progress(share)
