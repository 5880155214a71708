"""What a reader sees of a report before anything is opened: few words, a picture, and a page of little height."""

from __future__ import annotations

import re
import shutil
import subprocess
from collections.abc import Callable
from dataclasses import replace
from html import escape
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure

import softflagella as sf
from calibration.report.figures import draw_held_out
from calibration.verdict.verdict import Verdict
from tests.calibration.own_model.test_faults import MODEL, TABLE, fall
from tests.calibration.report.test_curves import result as traces
from tests.calibration.toy_tables import ambiguous, effect, verdict_of

MOST_WORDS, HEIGHTS = 90, {1280: 2600, 390: 4200}  # of a window's width, both in pixels
BROWSER = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
COMPLETE = replace(MODEL, effects=[], function=lambda columns, p: fall(columns, {**p, "wall": 1.0}))
CASES: dict[str, tuple[str, Callable[[], Verdict]]] = {
    "effect": ("claimed", lambda: of(MODEL)),
    "ambiguous": ("undecided", lambda: verdict_of(ambiguous())),
    "robot": ("claimed", lambda: verdict_of(effect())),
    "none": ("nothing beyond noise", lambda: of(COMPLETE)),
    "unexplained": ("unexplained", lambda: of(replace(MODEL, effects=[]))),
    "unknown": ("noise unknown", lambda: of(COMPLETE, TABLE["round"] == 1)),
}


def of(model: sf.Model, rows: Any = slice(None)) -> Verdict:
    model = replace(model, function=lambda columns, p, of=model.function: of(columns, {"wall": 0.0, **p}))
    return sf.calibrate(TABLE[rows], model, session="round", progress=False)


@pytest.fixture(scope="module", params=CASES)
def report(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[str, Path]:
    """A badge, and the report that must have it."""
    badge, verdict = CASES[request.param]
    return badge, verdict().save(tmp_path_factory.mktemp(request.param))[1]


def test_the_first_screen_has_a_badge_few_words_and_a_picture(report: tuple[str, Path]) -> None:
    badge, path = report
    page = re.search(r"<main>(.*)</main>", path.read_text(), re.DOTALL)
    assert page
    first, *folded = page[1].split("<details>")
    assert len(folded) >= 5
    assert first.count("<svg") == 1
    words = re.sub(r"<[^>]*>", " ", re.sub(r"<svg.*?</svg>", "", first, flags=re.DOTALL)).split()
    assert len(words) <= MOST_WORDS, words
    assert f">{badge}</span>" in first
    assert first.count("<li>") <= 3


@pytest.mark.skipif(BROWSER is None, reason="there is no Chromium to measure the page")
@pytest.mark.parametrize("width", HEIGHTS)
def test_the_page_is_low_and_no_wider_than_its_window(report: tuple[str, Path], width: int) -> None:
    measured = "document.title = `${body.scrollWidth} ${body.scrollHeight}`"
    window = f'<iframe style="width: {width}px; border: 0" srcdoc="{escape(report[1].read_text())}" '
    window += f'onload="const body = this.contentDocument.body; {measured}"></iframe>'
    page = report[1].with_name(f"{width}.html")
    page.write_text(f"<!doctype html><title></title>{window}")
    flags = ("--headless", "--no-sandbox", "--disable-gpu", "--dump-dom")
    shown = subprocess.run([str(BROWSER), *flags, str(page)], capture_output=True, text=True, timeout=120)
    wide, high = map(int, re.findall(r"<title>(\d+) (\d+)</title>", shown.stdout)[0])
    assert wide <= width
    assert 500 < high <= HEIGHTS[width]


@pytest.mark.parametrize("drawn", [lambda: draw_held_out(of(MODEL)), lambda: draw_held_out(traces(outputs=3))])
def test_labels_of_the_picture_do_not_overlap(drawn: Callable[[], Figure]) -> None:
    figure = drawn()
    figure.draw_without_rendering()
    (axes,) = figure.axes
    ticks = [label for axis, limits in ((axes.xaxis, axes.get_xlim()), (axes.yaxis, axes.get_ylim()))
             for at, label in zip(axis.get_ticklocs(), axis.get_ticklabels(), strict=True)
             if limits[0] <= at <= limits[1]]  # fmt: skip
    boxes = [text.get_window_extent() for text in (*ticks, axes.xaxis.label, axes.yaxis.label)]
    boxes += [figure.legends[0].get_window_extent(), axes._left_title.get_window_extent()]  # type: ignore[attr-defined]
    assert not [pair for pair in combinations(boxes, 2) if pair[0].overlaps(pair[1])]
    assert all(box.x0 >= 0 and box.x1 <= figure.bbox.x1 and box.y1 <= figure.bbox.y1 for box in boxes)


def test_the_picture_shows_held_out_runs_before_and_after_and_the_noise() -> None:
    result = of(MODEL)
    (axes,) = draw_held_out(result).axes
    before, after = (np.asarray(line.get_ydata()) for line in axes.lines[1:])
    assert len(before) == result.split.test.sum()
    assert np.sqrt(np.mean(before**2)) == pytest.approx(100 * result.error_before, rel=0.02)
    assert np.sqrt(np.mean(after**2)) == pytest.approx(100 * result.error_after, rel=0.02)
    (band,) = axes.patches
    low, high = band.get_path().get_extents(band.get_patch_transform()).intervaly
    assert [low, high] == pytest.approx([-200 * result.noise_ceiling, 200 * result.noise_ceiling], rel=0.3)
