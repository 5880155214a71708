"""The page that plans: its size, and how long users wait for it in Chromium.

Prints the size, the time from opening to the first plan and until the page's own planner has made it, from lifting
the pen to the plan of a drawn circle, from a changed viscosity to the robot's motion, and from a moved corner to
the plan of a closed path with 30 corners. Medians over several openings. Writes pictures of the page on a laptop,
on a telephone and in the dark into reports/; docs/page*.png are these.

Usage: python -m benchmarks page [TIMES]     (default 5)

Takes two minutes. Needs chromium and playwright.
"""

from __future__ import annotations

import tempfile
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np

import softflagella as sf
from benchmarks.common import heading, row
from tests.planner.page.view.browser import chromium, planned

_ANGLES, _RADII = 2 * np.pi * np.arange(30) / 30, np.random.default_rng(1).uniform(24, 36, 30)  # cm
_CORNERS = np.stack([_RADII * np.cos(_ANGLES), _RADII * np.sin(_ANGLES)], 1)
LAPTOP = {"viewport": {"width": 1280, "height": 860}}
PICTURES: dict[str, dict[str, Any]] = {
    "laptop": LAPTOP,
    "phone": {"viewport": {"width": 390, "height": 844}, "has_touch": True, "is_mobile": True},
    "dark": {**LAPTOP, "color_scheme": "dark"},
}
PICTURED = "v=1&path=square%3A40&objective=flips"


def main(times: str = "5") -> None:
    from playwright.sync_api import sync_playwright

    with tempfile.TemporaryDirectory() as folder, sync_playwright() as control:
        path = sf.write_page(Path(folder, "page.html"))
        print(heading("quantity", "value"))
        print(row("size", f"{path.stat().st_size / 1e6:.2f} MB"))
        browser = control.chromium.launch(executable_path=chromium(), args=["--no-sandbox"])
        for name, settings in PICTURES.items():
            _picture(browser, path.as_uri(), Path("reports", f"page-{name}.png"), settings)
        address = path.as_uri()
        opened = [(*_times(browser, address), corner_time(browser, address)) for _ in range(int(times))]
        browser.close()
    names = (
        "from opening to the first plan",
        "until the page's own planner has made it",
        "from lifting the pen to the plan of a drawn circle",
        "from another viscosity to the robot's motion",
        "from a moved corner to the plan with 30 corners",
    )
    for name, values in zip(names, zip(*opened, strict=True), strict=True):
        print(row(name, f"{median(values):.2f} s"))


def _picture(browser: Any, address: str, out: Path, settings: dict[str, Any]) -> None:
    """Write a picture of the page with a plan."""
    page = browser.new_context(offline=True, reduced_motion="reduce", **settings).new_page()
    page.goto(f"{address}#{PICTURED}")
    planned(page)
    page.screenshot(path=out)
    page.context.close()


def _times(browser: Any, address: str) -> tuple[float, float, float, float]:
    """Open the page, draw a circle and change the robot; measure the waits [s] in the page's own clock."""
    page = browser.new_context(offline=True, reduced_motion="reduce").new_page()
    page.goto(address)
    page.locator("#scene .declared").wait_for(state="attached")
    opening = page.evaluate("performance.now()") / 1000
    planned(page)
    ready = page.evaluate("performance.now()") / 1000
    page.check("input[value=draw]")
    box = page.locator("#view").bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.move(x + 110, y)
    page.mouse.down()
    for angle in np.linspace(0, 2 * np.pi, 60):
        page.mouse.move(x + 110 * np.cos(angle), y + 110 * np.sin(angle))
    page.mouse.up()
    lifted = page.evaluate("performance.now()")
    page.locator("#shape").evaluate("() => 0")
    page.wait_for_timeout(30)
    planned(page)
    drawing = (page.evaluate("performance.now()") - lifted) / 1000
    before = page.locator("#motion").inner_text()
    began = page.evaluate("performance.now()")
    page.fill("input[aria-label='Viscosity in Pa s']", "1.3")
    while page.locator("#motion").inner_text() == before:
        page.wait_for_timeout(5)
    changing = (page.evaluate("performance.now()") - began) / 1000
    page.context.close()
    return opening, ready, drawing, changing


def corner_time(browser: Any, address: str) -> float:
    """Move a corner of a path with 30, and measure the wait [s] for its plan."""
    page = browser.new_context(offline=True, reduced_motion="reduce").new_page()
    places = "~".join(f"{x:.2f},{y:.2f}" for x, y in _CORNERS)
    page.goto(f"{address}#v=1&places={places}&closed=1")
    waits = []
    for moved in ("30", "31", "32"):  # the first one plans with a program that is not compiled yet
        planned(page)
        script = """async (moved) => {
            const corner = document.querySelector("[aria-label='corner 1, x in cm']"), began = performance.now();
            corner.value = moved;
            corner.dispatchEvent(new Event("change", { bubbles: true }));
            while (document.body.dataset.busy !== "0") await new Promise((wake) => setTimeout(wake, 5));
            return (performance.now() - began) / 1000;
        }"""
        waits.append(page.evaluate(script, moved))
    page.context.close()
    return median(waits)
