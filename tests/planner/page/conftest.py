"""The page's core runs in one process for all tests of a worker."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.planner.page.page_core import stop_core


@pytest.fixture(scope="session", autouse=True)
def _core() -> Iterator[None]:
    """End the core after the last test."""
    yield
    stop_core()


@pytest.fixture
def empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Work in an empty folder, so that a file has the same name in Python and in the page."""
    monkeypatch.chdir(tmp_path)
