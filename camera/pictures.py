"""Draw camera tracks with what was fitted to them."""

from __future__ import annotations

import math
from collections.abc import Sequence

from matplotlib.figure import Figure

from camera.measured_runs import Track

_MOST_TRACKS = 48  # panels
_TRACK, _FIT, _START = "#7a8794", "#c8452f", "#1a1a1a"


def draw_tracks(tracks: Sequence[Track]) -> Figure:
    """Draw each track with its fitted circle or line, one panel for a run; of many runs, some from each part."""
    stride = math.ceil(len(tracks) / _MOST_TRACKS)
    shown = tracks[::stride]
    columns = min(len(shown), 6)
    rows = math.ceil(len(shown) / columns)
    figure = Figure(figsize=(2.4 * columns, 2.7 * rows + 0.5), layout="constrained")
    panels = figure.subplots(rows, columns, squeeze=False).ravel()
    for axes, track in zip(panels, shown, strict=False):
        axes.plot(track.x, track.y, ".", color=_TRACK, ms=2, label="track")
        axes.plot(*track.fit.path.T, color=_FIT, lw=1.2, label="fit")
        axes.plot(track.x[0], track.y[0], "o", color=_START, ms=4, label="first sample")
        axes.set_aspect("equal", "datalim")
        axes.tick_params(labelsize=7)
        axes.set_title(f"run {track.run}\n{_result(track)}", fontsize=8, parse_math=False)
    for axes in panels[len(shown) :]:
        axes.set_visible(False)
    figure.supxlabel("x [cm]", fontsize=9)
    figure.supylabel("y [cm]", fontsize=9)
    figure.legend(
        *panels[0].get_legend_handles_labels(), loc="outside upper right", ncols=3, fontsize=8, frameon=False
    )
    return figure


def _result(track: Track) -> str:
    result = track.fit.result
    if math.isnan(result.R_yr_cm):
        return f"line, {_with_error(result.v_cm_s, result.v_error)} cm/s"
    side = "left" if result.omega_yr_rad_s > 0 else "right"
    return f"R = {_with_error(result.R_yr_cm, result.R_yr_error)} cm, turns {side}"


def _with_error(value: float, error: float) -> str:
    """Write a value to the first digit of its error."""
    digits = max(0, -math.floor(math.log10(error))) if error > 0 else 3
    return f"{value:.{digits}f} ± {error:.{digits}f}"
