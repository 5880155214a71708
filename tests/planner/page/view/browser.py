"""The page in Chromium, opened as a file, offline; every error of the page and every request fails the test."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

FIRST_SCREEN = ("#message", "#next", "#view", "#play", ".legend")  # what the first plan needs


def chromium() -> str:
    """Return the browser's program; without one the test is skipped, but it fails where CI = true."""
    program = shutil.which("chromium") or shutil.which("chromium-browser")
    missing = "" if program else "no chromium on this machine (apt-get install chromium)"
    if not missing:
        try:
            import playwright.sync_api  # noqa: F401
        except ImportError:
            missing = "no playwright (pip install softflagella[page])"
    if not missing:
        assert program is not None
        return program
    if os.environ.get("CI") == "true":
        pytest.fail(f"{missing}: the page is not tested")
    pytest.skip(missing)


@contextmanager
def started_chromium() -> Iterator[Any]:
    """Start Chromium; see `chromium` for a machine without it."""
    program = chromium()
    from playwright.sync_api import sync_playwright

    with sync_playwright() as control:
        started = control.chromium.launch(executable_path=program, args=["--no-sandbox"])
        yield started
        started.close()


@contextmanager
def opened_page(browser: Any, address: str, script: str = "", **context: Any) -> Iterator[Any]:
    """Open a page in a context of its own, offline, and yield it when it has loaded; `script` runs before."""
    settings = {"viewport": {"width": 1280, "height": 860}, "reduced_motion": "reduce", **context}
    troubles: list[str] = []
    place = browser.new_context(offline=True, accept_downloads=True, **settings)
    try:
        page = place.new_page()
        page.set_default_timeout(120_000)
        page.on("console", lambda message: troubles.append(f"console: {message.text}"))
        page.on("pageerror", lambda error: troubles.append(f"error: {error}"))
        page.on("request", lambda request: _check_request(request.url, troubles))
        page.add_init_script(script)
        page.goto(address)
        yield page
    finally:
        place.close()
    assert troubles == []


def _check_request(url: str, troubles: list[str]) -> None:
    if not url.startswith(("file:", "blob:", "data:")):
        troubles.append(f"request: {url}")


def planned(page: Any) -> str:
    """Wait until the newest wish is planned or refused, and return the message."""
    page.locator("body[data-busy='0']").wait_for(state="attached")
    return str(page.locator("#message").inner_text())


def text_of(page: Any, part: str) -> str:
    return str(page.locator(part).inner_text())


def drop(page: Any, *files: Path | dict[str, Any]) -> None:
    """Open files as with the button."""
    page.locator("#pick").set_input_files([file if isinstance(file, dict) else str(file) for file in files])


def middle_of(page: Any) -> tuple[float, float]:
    """Scroll to the picture, and return the middle of what is seen of it."""
    page.locator("#view").scroll_into_view_if_needed()
    box = page.locator("#view").bounding_box()
    return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2


def is_seen(page: Any, part: str) -> bool:
    """Say whether the top of a part is within the window."""
    return bool(0 <= page.locator(part).bounding_box()["y"] < page.viewport_size["height"])


def unfold(page: Any) -> None:
    """Open all parts but the error over time, for which each change plans with ten dwells."""
    page.evaluate("document.querySelectorAll('details:not(#trade)').forEach((part) => { part.open = true; })")


def address_of(page: Any) -> str:
    return str(page.evaluate("location.hash"))


def drag(page: Any, *paths: Path) -> None:
    """Drag files or folders onto the picture, and let them go there."""
    session, (x, y) = page.context.new_cdp_session(page), middle_of(page)
    place = {"x": x, "y": y}
    data = {"items": [], "files": [str(path) for path in paths], "dragOperationsMask": 1}
    for kind in ("dragEnter", "dragOver", "drop"):
        session.send("Input.dispatchDragEvent", {"type": kind, **place, "data": data})


def saved(page: Any, name: str, folder: Path) -> Path:
    """Save a file with its button."""
    with page.expect_download() as download:
        page.get_by_role("button", name=name, exact=True).click()
    download.value.save_as(folder / name)
    return folder / name
