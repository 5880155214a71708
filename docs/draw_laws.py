"""Draw the picture of docs/tutorial/calibration.md: where the law acts, and on what it depends.

Usage: python docs/draw_laws.py [PNG]

Takes a minute.
"""

from __future__ import annotations

import io
import sys
from dataclasses import replace
from pathlib import Path

import matplotlib.image as image
import numpy as np
from matplotlib.figure import Figure

from calibration.laws.group_factors import group_factors
from calibration.laws.law_model import law_model
from calibration.laws.laws import Laws
from calibration.report.figures import draw_factors, draw_place
from calibration.swimmer.synthetic_table import make_table
from sim.model.presets import PRESETS
from softflagella.closed_loop import calibrate

HIDDEN = {"law_tail_drag_speed-150_length-500_tails0": 1.0}
_DPI = 130


def main(path: str = "docs/tutorial/laws.png") -> None:
    robot = PRESETS["paper-measured"]
    table = make_table(replace(robot, effects=HIDDEN), seed=8, title="").round(6)
    verdict = calibrate(table, robot, progress=False)
    laws = verdict.law
    assert isinstance(laws, Laws)
    best = laws.kept[0]
    model = law_model(best)
    inputs = group_factors(model, best.fitted, verdict.split.fitted)
    parts = [_pixels(draw_place(model.robot, model.place)), _pixels(draw_factors(inputs))]
    width = max(part.shape[1] for part in parts)
    image.imsave(Path(path), np.concatenate([_wide(part, width) for part in parts]))


def _pixels(figure: Figure) -> np.ndarray:
    store = io.BytesIO()
    figure.savefig(store, format="png", dpi=_DPI, facecolor="white")
    store.seek(0)
    return np.asarray(image.imread(store))


def _wide(pixels: np.ndarray, width: int) -> np.ndarray:
    """Put a picture on white of the given width."""
    wide = np.ones((pixels.shape[0], width, pixels.shape[2]), dtype=pixels.dtype)
    wide[:, : pixels.shape[1]] = pixels
    return wide


if __name__ == "__main__":
    main(*sys.argv[1:])
