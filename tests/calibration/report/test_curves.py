"""Curves of traces in a report: which are drawn, in which units, and with labels that can be read."""

from __future__ import annotations

from itertools import combinations
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure

from calibration.report.figures import draw_curves
from calibration.table.runs import Runs

TRACES, READINGS = 6, 40
TITLES = {"T": "temperature of the water in the cup", "flow": "flow through the wall", "level": "level"}
SCALES = {"T": (1.0, "°C"), "flow": (100.0, "%"), "level": (1000.0, "mm")}


def result(*, outputs: int = 1, held_out: int = 3, final: bool = True, known: bool = True) -> Any:
    """Make a result by hand: trace i departs by i % in a sine, which the final model halves."""
    names, trace = tuple(TITLES)[:outputs], np.repeat(np.arange(TRACES), READINGS)
    time = np.tile(30.0 * np.arange(READINGS), TRACES)
    curve = np.repeat(np.log(300 * np.exp(-time / 400) + 20)[:, None], outputs, axis=1)
    error = 0.01 * (1 + trace) * np.sin(time / 100)
    runs = Runs(
        names, curve + error[:, None], np.arange(len(time)), trace, tuple(f"day {i}" for i in range(TRACES)),
        time[:, None], ("t_s",), np.arange(len(time)), (), (), noise_known=known,
        trace=trace, trace_names=tuple(f"cup {i}" for i in range(TRACES)), time=time, time_name="t_s",
        heads=time < 8 * 30, output_titles=TITLES, output_scales=SCALES,
    )  # fmt: skip
    test = (trace < held_out) & (time >= 8 * 30)
    noise = SimpleNamespace(run_covariance=0.01**2 * np.eye(outputs))
    gains = dict(zip(TITLES, (0.9, 0.1, 0.5), strict=True))
    return SimpleNamespace(
        runs=runs, split=SimpleNamespace(test=test, fitted=~test), law=None, described=False, nearest=None,
        models={"before": "refitted"} | ({"after": "refitted with a lag"} if final else {}),
        base=SimpleNamespace(prediction=curve), errors=SimpleNamespace(
            by_output={"before": dict.fromkeys(names, 1.0), "after": gains}),
        final=SimpleNamespace(prediction=curve + error[:, None] / 2, noise=noise),
    )  # fmt: skip


def titles(figure: Figure) -> list[str]:
    return [axes.get_title(loc="left") for axes in figure.axes]


def test_the_best_the_median_and_the_worst_trace_are_drawn_above_the_residuals():
    (figure, output), *others = draw_curves(result())
    assert not others
    assert output == TITLES["T"]
    assert titles(figure) == [
        "cup 0, least error", "cup 1, median", "cup 2, largest error", "measured − refitted",
        "measured − refitted with a lag",
    ]  # fmt: skip
    assert [len(axes.lines) for axes in figure.axes[3:]] == [4, 4]  # three traces were fitted, and zero
    before, after = (np.abs(axes.lines[0].get_ydata()).max() for axes in figure.axes[3:])
    assert before == pytest.approx(2 * after)


@pytest.mark.parametrize(
    ("held_out", "words"), [(2, ["cup 0, least error", "cup 1, largest error"]), (1, ["cup 0"])]
)
def test_fewer_traces_are_drawn_where_there_are_fewer(held_out: int, words: list[str]):
    ((figure, _),) = draw_curves(result(held_out=held_out, final=False))
    assert titles(figure) == [*words, "measured − refitted"]


def test_ratios_are_drawn_as_they_were_measured_and_their_residuals_in_per_cent():
    made = result(outputs=3)
    (flow, _), (level, _) = draw_curves(made)  # those with the largest gains
    expected = np.exp(made.runs.y[:READINGS, 1])
    measured = next(line for line in flow.axes[0].lines if line.get_label() == "measured")
    assert measured.get_ydata() == pytest.approx(expected)
    assert np.abs(flow.axes[3].lines[0].get_ydata()).max() == pytest.approx(4, abs=0.1)
    assert flow.axes[3].get_ylabel() == "%"
    assert level.get_supylabel() == "level [mm]"


def test_what_shows_the_noise_is_left_out_where_it_is_unknown():
    bands = [len(draw_curves(result(known=known))[0][0].axes[0].collections) for known in (True, False)]
    assert bands == [1, 0]


@pytest.mark.parametrize("outputs", [1, 3])
def test_labels_do_not_overlap(outputs: int):
    for figure, _ in draw_curves(result(outputs=outputs)):
        figure.draw_without_rendering()
        boxes = [figure.legends[0].get_window_extent(), figure._supylabel.get_window_extent()]  # type: ignore[attr-defined]
        for axes in figure.axes:
            shown = [axes._left_title, *axes.get_yticklabels(), axes.yaxis.label, axes.xaxis.label]  # type: ignore[attr-defined]
            low, high = axes.get_ylim()
            ticks = {
                label
                for at, label in zip(axes.get_yticks(), axes.get_yticklabels(), strict=True)
                if not low <= at <= high
            }
            boxes += [text.get_window_extent() for text in shown if text.get_text() and text not in ticks]
        assert not [pair for pair in combinations(boxes, 2) if pair[0].overlaps(pair[1])]
        assert all(box.x0 >= 0 and box.x1 <= figure.bbox.x1 for box in boxes)
