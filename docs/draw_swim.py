"""Draw the loop from one swim: a robot misses a square, its track corrects the model, and it swims once more.

Usage: python docs/draw_swim.py

Takes four minutes.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

import softflagella as sf
from tests.oracles.swims import CameraNoise, make_track

PATH = "square:3l"
TRACKS = ("as given", "after one swim", "with the truth known")
STYLES: tuple[dict[str, Any], ...] = (
    {"color": "C3", "lw": 1.5},
    {"color": "C0", "lw": 1.5},
    {"color": "black", "lw": 0.8, "ls": "--"},
)
EXACT = CameraNoise(white=(0.0, 0.0), slow=(0.0, 0.0))


def main() -> None:
    given = sf.load_robot("paper-control")
    truth = replace(
        given,
        C_t=1.03 * given.C_t,
        C_r=0.97 * given.C_r,
        C_yr=1.03 * given.C_yr,
        effects={"left_right_bias": 0.05},
    )
    first = sf.plan(PATH, given)
    film = make_track(truth, first, seed=5).drop(columns="direction")
    verdict: Any = sf.calibrate(film, given, plan=first)
    figure = Figure(figsize=(10, 5), layout="constrained")
    panels = figure.subplots(1, 2, sharex=True, sharey=True)
    plans = first, sf.plan(PATH, verdict), sf.plan(PATH, truth)
    square = 100 * given.tail_length * first.drawn.points
    for axes in panels:
        axes.plot(*square[[*range(len(square)), 0]].T, color="0.75", lw=5, label="wanted square")
        axes.set_aspect("equal")
        axes.set_xlabel("x [cm]")
    for axes, plan, words, style in zip(panels[[0, 1, 1]], plans, TRACKS, STYLES, strict=True):
        track = make_track(truth, plan, seed=0, camera=EXACT)
        error = 1000 * given.tail_length * sf.check(plan, track).raw_rms
        axes.plot(track.x_cm, track.y_cm, label=f"planned {words}: {error:.2g} mm rms", **style)
        print(f"{words}: {error:.3g} mm rms")
    panels[0].set_ylabel("y [cm]")
    for axes in panels:
        axes.legend(frameon=False, loc="center", fontsize=9)
    panels[0].set_title("a robot with a hidden effect swims its plan, filmed", fontsize=11)
    panels[1].set_title(
        f"the film shows {' and '.join(verdict.effects).replace('_', ' ')}; planned again", fontsize=11
    )
    figure.savefig(Path(__file__).with_name("one-swim.png"), dpi=90, bbox_inches="tight")


if __name__ == "__main__":
    main()
