"""The film of the README: a robot with four tails on a square, simulated.

Usage: python -m benchmarks film [FILE]     (default: docs/swim.gif)

Takes half a minute.
"""

from __future__ import annotations

import softflagella as sf
from sim.pictures.film import FilmSettings, write_film

SPEED = 50.0  # times that of the robot


def main(path: str = "docs/swim.gif") -> None:
    plan = sf.plan(sf.polygon(4, side=2.0), "paper-triangle", objective="flips")
    film = FilmSettings(SPEED, width=480)
    count = write_film(plan.to_dict(), plan.schedule(), path, film)
    print(f"{count} pictures at {SPEED:g} times the robot's speed -> {path}")
