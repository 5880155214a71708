"""The declared path: tight, noisy and degenerate paths are refused with a remedy that works, or followed."""

from __future__ import annotations

import numpy as np
import pytest

import softflagella as sf
from planner.paths.path import Path2D, circle, polygon, smoothed
from planner.planning.plan import plan
from sim.io.errors import InputError
from sim.model.presets import PRESETS

CONTROL = PRESETS["paper-control"]


@pytest.mark.parametrize("radius", [0.4, 0.5, 0.57])
def test_a_tight_circle_is_refused_with_a_scale_that_works(radius: float) -> None:
    with pytest.raises(InputError) as caught:
        plan(circle(radius), CONTROL)
    factor = float(str(caught.value).rsplit(" ", 1)[1].removesuffix("l"))
    assert plan(circle(radius * factor), CONTROL).predicted_rms < 0.1


def test_a_noisy_path_is_told_how_to_be_smoothed_and_that_works() -> None:
    rng = np.random.default_rng(0)
    line = np.stack([np.arange(600) * 0.01, np.zeros(600)], 1)
    noisy = Path2D.of(line + 0.02 * rng.normal(size=line.shape))
    with pytest.raises(InputError, match=r"it looks noisy: .* give --smooth") as caught:
        plan(noisy, CONTROL)
    smooth, _ = smoothed(noisy, float(str(caught.value).rsplit(" ", 1)[1].removesuffix("l")))
    assert np.abs(plan(smooth, CONTROL).reference[:, 1]).max() < 0.06


@pytest.mark.parametrize("noise", [0.1, 0.2])
def test_the_smoothing_that_a_very_noisy_path_is_told_works(noise: float) -> None:
    """A path smoothed as the message said used to be refused with the same words."""
    rng = np.random.default_rng(0)
    angle = np.arange(0, 2 * np.pi, 0.005)
    ring = 2 * np.stack([np.cos(angle), np.sin(angle)], 1)
    noisy = Path2D.of(ring + noise * rng.normal(size=ring.shape))
    with pytest.raises(InputError, match=r"it looks noisy: .* give --smooth") as caught:
        plan(noisy, CONTROL)
    smooth, _ = smoothed(noisy, float(str(caught.value).rsplit(" ", 1)[1].removesuffix("l")))
    assert plan(smooth, CONTROL).predicted_rms < 0.1


def test_a_declared_path_far_from_the_drawn_one_says_so_first(monkeypatch: pytest.MonkeyPatch) -> None:
    """It used to be said only where a tenth of the path's extent is lost: 0.9 l of a race track were not."""
    monkeypatch.setattr("planner.planning.declared_path.FAR", 0.02)
    triangle = plan(polygon(3, 4.0), CONTROL, objective="flips")
    assert triangle.warnings[0].startswith("the declared path leaves the drawn one by up to")


def test_a_small_path_is_not_noisy() -> None:
    with pytest.raises(InputError, match=r"scale the path by 3.5$") as caught:
        sf.plan(circle(0.2), CONTROL)
    assert "noisy" not in str(caught.value)


def test_a_line_and_back_ends_with_a_line() -> None:
    with pytest.raises(InputError) as caught:
        plan([[0, 0], [5, 0], [0, 0]], CONTROL)
    assert "\n" not in str(caught.value)


def test_many_points_with_little_noise_are_the_same_path() -> None:
    """10⁵ points with noise of 1e-4 l: as many flips as the circle without it, within 2 %."""
    rng = np.random.default_rng(0)
    angle = np.linspace(0, 2 * np.pi, 100_000, endpoint=False)
    clean = 2 * np.stack([np.cos(angle), np.sin(angle)], 1)
    one, other = (
        plan(Path2D.of(clean + s * rng.normal(size=clean.shape), closed=True), CONTROL) for s in (0, 1e-4)
    )
    assert len(other.dwells) == pytest.approx(len(one.dwells), rel=0.02)
    assert other.errors.drawn_rms == pytest.approx(one.errors.drawn_rms, rel=0.05)
