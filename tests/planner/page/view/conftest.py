"""The browser and the page that the tests share."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from planner.page.write_page import write_page
from tests.planner.page.cases import CONTROL, shipped
from tests.planner.page.view.browser import opened_page, planned, started_chromium
from tests.shared import FOLDER, shared

LARGEST_PAGE = 1.6e6  # bytes
FIRST = "v=1&objective=flips"  # of the shared page


@shared
def _written() -> Path:
    return write_page(FOLDER / "page.html", CONTROL, lookup=shipped())


@pytest.fixture(scope="package")
def address() -> str:
    assert _written().stat().st_size <= LARGEST_PAGE
    return _written().as_uri()


@pytest.fixture(scope="package")
def browser() -> Iterator[Any]:
    """Start Chromium."""
    with started_chromium() as started:
        yield started


@pytest.fixture(scope="package")
def opened(browser: Any, address: str) -> Iterator[Any]:
    """Open a page with a plan of few flips."""
    with opened_page(browser, f"{address}#{FIRST}") as page:
        planned(page)
        yield page


@pytest.fixture
def page(opened: Any) -> Iterator[Any]:
    """Lend the page, and go back to its first plan afterwards; nothing that was dropped has run."""
    yield opened
    assert opened.title() != "taken"
    assert not opened.is_visible("#problem")
    for name in ("Remove", "Remove the runs"):
        if (button := opened.get_by_role("button", name=name, exact=True)).count():
            button.click()
    opened.check("input[value=move]")
    opened.evaluate("document.activeElement.blur()")
    opened.evaluate(f"location.hash = '{FIRST}'")
    opened.wait_for_function(f"location.hash === '#{FIRST}'")
    assert "dwells" in planned(opened)
