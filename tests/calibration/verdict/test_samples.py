"""Samples of what a verdict leaves open."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
import pytest

import softflagella as sf
from calibration.findings.samples import FORM
from calibration.report.figures import draw_corner
from tests.shared import shared

_LEVELS = [0.025, 0.975]


def pull(columns: Any, p: Any) -> Any:
    x = columns["x"]
    return {"y": p["stiffness"] * x * (1 + p["square"] * x**2 + p["steeper"] * x**2.2)}


MODEL = sf.Model(
    pull,
    outputs={"y": sf.Output("force", unit="N")},
    numbers=[sf.Number("stiffness", 1.0, unit="N/m", low=0.1, high=10)],
    effects=[sf.Effect("square", "square", low=0, high=2), sf.Effect("steeper", "steeper", low=0, high=2)],
)


def verdict_on(**truth: float) -> Any:
    random = np.random.default_rng(3)
    table = pd.DataFrame({"x": np.tile(np.linspace(0.2, 1.0, 6), 8), "session": np.repeat(np.arange(4), 12)})
    y = pull(table, {"stiffness": 1.3, "square": 0.0, "steeper": 0.0} | truth)["y"]
    return sf.calibrate(table.assign(y=y * np.exp(0.02 * random.normal(size=48))), MODEL, progress=False)


@shared
def alone() -> Any:
    return verdict_on()


@shared
def ambiguous() -> Any:
    return verdict_on(square=0.4)


def test_samples_have_the_interval_of_corrected_json() -> None:
    samples = alone().samples(20_000)
    low, high = samples["stiffness"].quantile(_LEVELS)
    (error,) = np.sqrt(np.diag(alone().final_refit.covariance))
    stated = alone().corrected["stiffness"] * np.exp(1.96 * error * np.array([-1, 1]))
    np.testing.assert_allclose([low, high], stated, rtol=0.002)
    assert list(samples) == ["stiffness", FORM]


def test_each_form_that_cannot_be_told_apart_has_its_share() -> None:
    verdict = ambiguous()
    samples = verdict.samples(3001)
    shares = samples[FORM].value_counts()
    assert len(shares) == len(verdict.forms) > 1
    assert np.ptp(shares) <= 1
    of_square = samples[samples[FORM] == "square"]
    assert (of_square["steeper"] == 0).all()
    assert of_square["square"].std() > 0
    assert len(set(samples.loc[:20, FORM])) > 1


def test_a_seed_repeats_the_draws() -> None:
    pd.testing.assert_frame_equal(alone().samples(10, seed=1), alone().samples(10, seed=1))
    assert not alone().samples(10, seed=1).equals(alone().samples(10, seed=2))


def test_at_least_one_sample() -> None:
    with pytest.raises(sf.InputError, match="samples: 0; give a number of rows from 1"):
        alone().samples(0)


def test_the_corner_plot_has_a_panel_for_each_pair() -> None:
    figure = draw_corner(ambiguous())
    assert figure is not None
    assert sum(axes.get_visible() for axes in figure.axes) == 6
    assert [text.get_text() for text in figure.legends[0].get_texts()] == [
        *ambiguous().samples(1500)[FORM].unique()
    ]
    assert draw_corner(alone()) is None


def test_the_report_has_the_corner_plot(tmp_path: Any) -> None:
    ambiguous().save(tmp_path / "out")
    report = (tmp_path / "out/report.html").read_text()
    assert "What the runs leave open" in report
