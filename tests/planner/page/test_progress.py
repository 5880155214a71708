"""The stages of a plan have the same names."""

from __future__ import annotations

from planner.planning import progress
from tests.planner.page.page_core import FOLDER, answer


def test_stages() -> None:
    text = (FOLDER / "progress.js").read_text()
    assert all(f'"{stage}"' in text for stage in (progress.DECLARING, progress.REMEDY, progress.FOLLOWING))
    assert answer("progress.js", "tell", None, progress.REMEDY, 0.5) is None
