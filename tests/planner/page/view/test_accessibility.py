"""Everybody can use the page: names, keyboard, one word for a finished plan, contrast, sizes of text, a phone."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from tests.planner.page.view.browser import FIRST_SCREEN, address_of, middle_of, opened_page, planned, unfold
from tests.planner.page.view.conftest import FIRST

TEXT, LINES = 4.5, 3.0  # contrast at least
TARGET = 44  # pixels
PHONE = {"viewport": {"width": 390, "height": 844}, "has_touch": True, "is_mobile": True}
CONTROLS = "a[href], button, input:not([type=hidden]), select, summary, [tabindex='0']"
ROLES = {"button", "link", "textbox", "spinbutton", "slider", "combobox", "checkbox", "radio", "image"}
RGB = """([name, part]) => {
  const element = document.querySelector(part);
  const words = getComputedStyle(element)[name];
  return words.match(/[\\d.]+/g).map(Number);
}"""
TEXTS = """() => {
  const numbers = (words) => words.match(/[\\d.]+/g).map(Number);
  const behind = (part) => {
    for (; part; part = part.parentElement) {
      const colour = numbers(getComputedStyle(part).backgroundColor);
      if (colour.length < 4 || colour[3] > 0) return colour;
    }
  };
  const own = (part) => [...part.childNodes].some((node) => node.nodeType === 3 && node.textContent.trim());
  return [...document.body.querySelectorAll("*")].filter((part) => part.checkVisibility() && own(part)
    && !part.closest("script, noscript")).map((part) => {
      const style = getComputedStyle(part);
      const colour = part.namespaceURI.endsWith("svg") ? style.fill : style.color;
      return [part.outerHTML.slice(0, 80), numbers(colour), behind(part)];
    });
}"""
LISTEN = """() => {
  window.told = [];
  for (const region of document.querySelectorAll("[role=status], [aria-live=polite], output")) {
    if (region.getAttribute("aria-live") === "off") continue;
    new MutationObserver(() => window.told.push(region.textContent)).observe(
      region, { childList: true, characterData: true, subtree: true });
  }
}"""


@pytest.fixture(scope="module")
def page(browser: Any, address: str) -> Iterator[Any]:
    """Open the page, all its parts unfolded, with a plan."""
    with opened_page(browser, f"{address}#{FIRST}") as opened:
        planned(opened)
        unfold(opened)
        opened.locator("#trade summary").click()
        opened.locator("#trade-off circle").first.wait_for()
        planned(opened)
        yield opened


def luminance(colour: list[float]) -> float:
    """Return the relative luminance of a colour of sRGB (WCAG 2.2)."""
    linear = [part / 12.92 if part <= 0.04045 else ((part + 0.055) / 1.055) ** 2.4
              for part in (value / 255 for value in colour[:3])]  # fmt: skip
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def contrast(first: list[float], second: list[float]) -> float:
    light, dark = sorted((luminance(first), luminance(second)), reverse=True)
    return (light + 0.05) / (dark + 0.05)


def test_each_control_has_a_name(page: Any) -> None:
    nodes = page.context.new_cdp_session(page).send("Accessibility.getFullAXTree")["nodes"]
    controls = [node for node in nodes if not node["ignored"] and node["role"]["value"] in ROLES]
    assert len(controls) > 60
    assert [node for node in controls if not node.get("name", {}).get("value", "").strip()] == []


def test_tab_reaches_each_control_in_the_order_of_the_page(page: Any) -> None:
    """Of radio buttons that belong together, Tab reaches the one that is chosen."""
    wanted = page.evaluate(
        f"""() => [...document.querySelectorAll("{CONTROLS}")].filter((control) => !control.disabled
             && control.tabIndex >= 0 && control.checkVisibility()
             && !(control.type === "radio" && !control.checked)).map((control, i) => {{
               control.dataset.order = i; return i; }})"""
    )
    page.evaluate("document.activeElement.blur(); window.scrollTo(0, 0)")
    page.locator(".skip").focus()
    reached = []
    for _ in wanted:
        reached.append(int(page.evaluate("document.activeElement.dataset.order ?? -1")))
        page.keyboard.press("Tab")
    assert reached == wanted


def test_a_finished_plan_is_told_once(page: Any) -> None:
    page.evaluate(LISTEN)
    page.fill("#size", "27.5")
    words = planned(page)
    page.click("#play")
    page.wait_for_timeout(200)
    page.click("#play")
    assert page.evaluate("window.told") == [words]


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_text_and_lines_have_enough_contrast_and_differ_by_more_than_colour(page: Any, scheme: str) -> None:
    page.emulate_media(color_scheme=scheme)
    texts = page.evaluate(TEXTS)
    assert len(texts) > 100
    assert [(part, colour) for part, colour, behind in texts if contrast(colour, behind) < TEXT] == []
    card = page.evaluate(RGB, ["backgroundColor", "#view"])
    assert (luminance(card) > 0.5) == (scheme == "light")
    for kind in ("drawn", "declared", "forward", "backward", "start"):
        line = page.evaluate(RGB, ["stroke", f"#scene path.{kind}"])
        assert contrast(line, card) >= LINES, kind
    for part in ("#size", "#shape", "#undo", "#play"):
        edge = page.evaluate(RGB, ["borderTopColor", part])
        assert contrast(edge, page.evaluate(RGB, ["backgroundColor", "section"])) >= LINES, part
    looks = page.evaluate(
        """() => ["drawn", "declared", "forward", "backward"].map((kind) => {
          const style = getComputedStyle(document.querySelector(`#scene path.${kind}`));
          return `${style.strokeDasharray} ${style.strokeWidth}`;
        })"""
    )
    assert len(set(looks)) == len(looks)
    assert "motor +" in page.inner_text("#clock") or "motor −" in page.inner_text("#clock")


@pytest.mark.parametrize(("width", "zoom"), [(320, 1), (640, 2)])
def test_nothing_scrolls_sideways(page: Any, width: int, zoom: int) -> None:
    """Nothing does at 320 pixels, nor with text of 200 % on 640 pixels; the strip has all dwells."""
    page.set_viewport_size({"width": width, "height": 700})
    ends = "[...document.querySelectorAll('#strip text')].map((part) => part.getBoundingClientRect().right)"
    right = page.evaluate(f"new Promise((use) => requestAnimationFrame(() => use(Math.max(...{ends}))))")
    assert width - 60 < right < width
    page.evaluate(f"document.documentElement.style.fontSize = '{100 * zoom}%'")
    planned(page)
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    size = page.evaluate("parseFloat(getComputedStyle(document.body).fontSize)")
    assert size == pytest.approx(16 * zoom)
    cut = page.evaluate(
        """() => [...document.querySelectorAll("button, label, p, dd, dt, h1, h2, summary")].filter((part) =>
           part.checkVisibility() && !part.closest(".away, .wide, svg") && !part.classList.contains("away") &&
           !part.classList.contains("skip") && part.scrollWidth > part.clientWidth + 1 &&
           getComputedStyle(part).display !== "inline").map((part) => part.outerHTML.slice(0, 90))"""
    )
    assert cut == []


def test_on_a_phone_targets_are_large_and_a_finger_draws(browser: Any, address: str) -> None:
    with opened_page(browser, f"{address}#{FIRST}", **PHONE) as page:
        planned(page)
        assert page.evaluate("document.documentElement.scrollWidth") <= 390
        for part in FIRST_SCREEN:
            box = page.locator(part).bounding_box()
            assert box["y"] + box["height"] <= 844, part
        page.check("input[value=draw]")
        session, (x, y) = page.context.new_cdp_session(page), middle_of(page)
        for k, angle in enumerate(np.linspace(0.0, 2 * np.pi, 40)):
            point = {"x": x + 90 * float(np.cos(angle)), "y": y + 90 * float(np.sin(angle))}
            kind = "touchStart" if k == 0 else "touchMove"
            session.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": [point]})
        session.send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})
        assert "dwells" in planned(page)
        assert "points=" in address_of(page)
        unfold(page)
        planned(page)
        small = page.evaluate(
            f"""() => [...document.querySelectorAll("{CONTROLS}")].filter((control) => control.checkVisibility()
                 && !control.closest("svg") && control.id !== "pick" && !control.classList.contains("skip"))
               .map((control) => [control.outerHTML.slice(0, 70),
                 (control.closest("label.choice") ?? control).getBoundingClientRect()])
               .filter(([, box]) => box.height < {TARGET} || box.width < {TARGET})
               .map(([words, box]) => [words, box.width, box.height])"""
        )
        assert small == []
