"""Thrust, torque and drag of rigid helices, by resistive force theory and with the flow of every segment.

A table has one row for each helix (`tests.oracles.helices`); Rodenborn et al. (2013) measured such helices.

Usage: python -m benchmarks helices TABLE.csv

Takes 5 seconds.
"""

from __future__ import annotations

import numpy as np

from tests.oracles.helices import read_helices, resistive, with_flow


def main(table: str) -> None:
    """Print how far each model is from the measured table."""
    pitch, measured = read_helices(table)
    print("  model minus measurement [%]    thrust: each λ/R, rms      torque: rms      drag: rms")
    for label, model in (
        ("resistive, Gray and Hancock", resistive(pitch)),
        ("resistive, Lighthill", resistive(pitch, lighthill=True)),
        ("with the flow of every segment", with_flow(pitch)),
    ):
        off = 100 * (model / measured - 1)
        rms = np.sqrt((off**2).mean(0))
        each = " ".join(f"{o:+6.1f}" for o in off[:, 0])
        print(f"  {label:30s} {each}  {rms[0]:6.1f}  {rms[1]:12.1f}  {rms[2]:12.1f}")
    print("  λ/R: " + " ".join(f"{p:.2f}" for p in pitch))
