"""Paths as people give them: tables of several kinds, noisy ones, absurd sizes, ones that turn back."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from planner.paths.path import Path2D, smoothed
from planner.paths.path_files import read_path
from planner.planning.plan import plan
from sim.io.errors import InputError
from sim.model.presets import PRESETS

CONTROL = PRESETS["paper-control"]


@pytest.mark.parametrize(
    "text",
    ["x,y\n0,0\n3,0\n3,4.5\n", "X;Y\n0;0\n3;0\n3;4,5\n", "0,0\n3,0\n3,4.5\n", "0 0\n3 0\n3 4.5\n",
     "t;x;y\n1;0;0\n2;3;0\n3;3;4.5\n", "y\tx\n0\t0\n0\t3\n4.5\t3\n", "\ufeffx,y\n0,0\n3,0\n3,4.5\n"],
)  # fmt: skip
def test_tables_of_several_kinds_are_the_same_path(text: str, tmp_path: Path) -> None:
    (tmp_path / "path.csv").write_text(text, encoding="utf-8")
    assert read_path(tmp_path / "path.csv").path.points.tolist() == [[0, 0], [3, 0], [3, 4.5]]


def test_a_noisy_path_is_told_how_to_be_smoothed_and_that_works() -> None:
    rng = np.random.default_rng(0)
    line = np.stack([np.arange(600) * 0.01, np.zeros(600)], 1)
    noisy = Path2D.of(line + 0.02 * rng.normal(size=line.shape))
    with pytest.raises(InputError, match=r"it looks noisy: .* give --smooth") as caught:
        plan(noisy, CONTROL)
    smooth, _ = smoothed(noisy, float(str(caught.value).rsplit(" ", 1)[1]))
    assert np.abs(plan(smooth, CONTROL).reference[:, 1]).max() < 0.06


def test_millimetres_taken_for_tail_lengths_are_refused() -> None:
    with pytest.raises(InputError, match=r"if you gave l and mean mm, it is 27.3 l: --unit mm"):
        plan([[0, 0], [900, 0], [900, 700], [0, 700], [0, 200]], CONTROL)


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
    assert other.drawn_rms == pytest.approx(one.drawn_rms, rel=0.05)
