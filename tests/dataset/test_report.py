"""What the sweep report says of rows: indices and exponents that are known, linear theory, and the page."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

from common.pages import Page
from dataset.build import build
from dataset.data_set import read_manifest
from dataset.report import write_report
from dataset.statistics import exponents, linear_rows, sobol_indices
from sim.motion.batches import steady_columns
from tests.dataset.sweeps import design, invented
from tests.sim.robots import sweep_points


def test_indices_of_a_known_function() -> None:
    """y = x₁ + 2 x₂² + 3 x₁ x₃ on [0, 1]³: variances from the moments of the uniform law."""
    x = np.random.default_rng(0).random((6000, 4))
    inputs = {f"x{k}": x[:, k] for k in range(4)}
    found = sobol_indices(inputs, x[:, 0] + 2 * x[:, 1] ** 2 + 3 * x[:, 0] * x[:, 2])
    parts = {"x0": 2.5**2 / 12, "x1": 4 * 4 / 45, "x2": 1.5**2 / 12}
    interaction = 9 / 144
    whole = sum(parts.values()) + interaction
    assert found.first[:3] == pytest.approx([value / whole for value in parts.values()], abs=0.02)
    assert found.total[0] - found.first[0] == pytest.approx(interaction / whole, abs=0.01)
    assert found.total[3] < 0.01
    assert 0.99 < found.explained <= 1
    assert (found.total_bounds[:, 1] - found.total_bounds[:, 0] < 0.02).all()
    assert np.abs(found.total_bounds.mean(1) - found.total).max() < 0.01
    # Of an input with few values, and of one with one.
    rng = np.random.default_rng(1)
    tails, speed = rng.integers(2, 6, 3000).astype(float), rng.random(3000)
    found = sobol_indices({"N": tails, "omega_bar": speed, "same": np.ones(3000)}, np.where(tails > 3, 1.0, 0.0))
    assert found.inputs == ("N", "omega_bar")
    assert found.first[0] > 0.97


def test_exponents_of_power_laws_and_where_they_change() -> None:
    rng = np.random.default_rng(2)
    a, b = np.exp(rng.uniform(0, 3, 3000)), np.exp(rng.uniform(0, 1, 3000))
    noise = np.exp(0.01 * rng.normal(size=3000))
    power, bent = exponents({"a": a, "b": b}, "y", noise * a**1.5 / b)
    assert power.value == pytest.approx((1.5, 1.5, 1.5), abs=0.01)
    assert power.holds
    assert bent.value == pytest.approx((-1, -1, -1), abs=0.02)
    assert all(0 < width < 0.02 for width in power.half_width)
    (changing,) = exponents({"a": a}, "y", a / (1 + a / 5))
    assert not changing.holds
    assert changing.value[0] > changing.value[2]


def test_linear_theory_is_near_for_slow_motors() -> None:
    points = sweep_points(16)
    points["omega_bar"] = np.full(16, 0.5)
    rows, linear = linear_rows(points)
    simulated = steady_columns(points, jobs=1, title="")
    assert rows.tolist() == list(range(16))
    assert linear["omega_yr_bar"] == pytest.approx(simulated["omega_yr_bar"], rel=0.08)
    assert linear["v_z"] == pytest.approx(simulated["v_z"], rel=0.15)


def test_a_small_report_says_what_is_missing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """No panel and no table is empty, and NumPy does not warn."""
    build(design(64), tmp_path / "data", jobs=1, title="", simulate=invented)
    drawn: list[Figure] = []
    monkeypatch.setattr(Page, "figure", lambda _, figure, __: drawn.append(figure))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        write_report(str(tmp_path / "data"), tmp_path / "page.html")
    for figure in drawn:
        for axes in figure.axes:
            artists = [*axes.get_lines(), *axes.collections, *axes.patches]
            assert any(len(getattr(artist, "get_xdata", lambda: [0])()) for artist in artists), axes.get_title()
    text = (tmp_path / "page.html").read_text()
    assert "are too few for exponents of 8 inputs: they need 72 or more" in text
    assert "<tr></tr>" not in text
    assert "http" not in text.split("</style>")[1]  # the page contains itself
    assert read_manifest(tmp_path / "data")["config_hash"] in text
