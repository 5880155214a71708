"""The page and the browser that the journeys share."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

from planner.page.write_page import write_page
from planner.planning.request import PlanRequest
from sim.model.presets import PRESETS
from surrogate.table.model_file import load
from tests.planner.page.view.browser import chromium

LARGEST_PAGE = 1.6e6  # bytes


@pytest.fixture(scope="module")
def address(tmp_path_factory: pytest.TempPathFactory) -> str:
    """Write the page."""
    path = tmp_path_factory.mktemp("page") / "page.html"
    write_page(path, PRESETS["paper-control"], load(), PlanRequest())
    assert path.stat().st_size <= LARGEST_PAGE
    return path.as_uri()


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    """Start Chromium."""
    program = chromium()
    from playwright.sync_api import sync_playwright

    with sync_playwright() as control:
        started = control.chromium.launch(executable_path=program, args=["--no-sandbox"])
        yield started
        started.close()
