"""Compiled loops on disk: old versions go, the newest stay."""

from __future__ import annotations

import os
from pathlib import Path

from sim.compiling import CACHE, prune


def test_only_the_newest_versions_are_kept(tmp_path: Path) -> None:
    for age, name in enumerate(("compiled-c", "compiled-a", "compiled-b", "other")):
        (tmp_path / name).mkdir()
        (tmp_path / name / "loop.nbc").write_text("")
        os.utime(tmp_path / name, (1e9 - age, 1e9 - age))
    prune(tmp_path, 2)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["compiled-a", "compiled-c", "other"]
    prune(tmp_path / "nowhere", 2)


def test_the_folder_is_named_by_the_code() -> None:
    assert CACHE.name.startswith("compiled-")
    assert len(CACHE.name) == len("compiled-") + 12
