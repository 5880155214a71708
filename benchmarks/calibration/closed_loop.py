"""Tracking error of ten robots with a hidden effect, before and after their calibration.

Each robot has its own coefficients and one hidden effect. Its table of 192 runs is simulated on a finer mesh by
time stepping, with 2.5 % of noise and session scatter; the fitter starts from the paper's coefficients. A square
is planned with the calibrated model, with the corrected one and with the truth known, and every schedule is run on
the truth. Both models are those fitted to all runs in the end.

Usage: python -m benchmarks closed_loop [ROBOTS]

Takes 10 minutes.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from calibration.report.corrected_robot import corrected_robot
from calibration.statistics.held_out import refit_to_all
from calibration.swimmer.measured_table import read_measurements
from calibration.swimmer.swimmer import SwimmerModel
from calibration.swimmer.synthetic_table import make_table
from calibration.verdict.calibrate import calibrate
from planner.paths.path import polygon
from sim.model.presets import PRESETS
from softflagella.replanning import gap_closed, steer

HIDDEN = (
    ("end_over_end_drag", 5.0), ("tail_spin_drag", 1.0), ("surface_couple", 0.4), ("anisotropic_head_drag", 0.5),
    ("tail_interaction", 1.0), ("disc_drag", 1.0), ("end_over_end_drag", 3.0), ("natural_splay", 0.2),
    ("motor_droop", 0.15), ("head_flow", 1.0),
)  # fmt: skip
LENGTHS = (5.0, 6.0, 7.0, 8.5, 10.0, 11.0)  # cm; longer tails in each other's flow take long to settle


def main(robots: str = "10") -> None:
    print(
        "  hidden effect                verdict      named                   held-out   error on the path [l rms]"
    )
    print(" " * 69 + "/ noise   before   after   truth  closed")
    shares, ratios = [], []
    start = PRESETS["paper-measured"]
    for seed, (name, size) in enumerate(HIDDEN[: int(robots)]):
        rng = np.random.default_rng(seed)
        C_t, C_r, C_yr = np.array([2.5, 2.2, 3.5]) * np.exp(rng.uniform(-0.3, 0.3, 3))
        truth = replace(start, C_t=C_t, C_r=C_r, C_yr=C_yr, effects={name: size})
        table = make_table(truth, seed=seed, lengths_cm=LENGTHS, title="")
        model = SwimmerModel(start, read_measurements(table))
        verdict = calibrate(model, progress=False)
        swimmer = replace(truth, tails=2).with_motor(10.0)
        before = refit_to_all(model, verdict.base, np.ones(len(table), bool))
        models = {
            "before": corrected_robot(replace(swimmer, effects={}), before.parameters),
            "after": corrected_robot(replace(swimmer, effects={}), verdict.fits.final_refit.parameters),
            "truth": swimmer,
        }
        rms = [comparison.error.rms for comparison in steer(models, swimmer, polygon(4, 3.0)).values()]
        shares.append(gap_closed(*rms))
        named = " + ".join(verdict.effects) or "-"
        figures = "".join(f"{value:8.3f}" for value in rms)
        ratios.append(verdict.error_after / verdict.noise_ceiling)
        line = f"  {name:22s}{size:5.2f}  {verdict.verdict:12s} {named:24s}{ratios[-1]:8.2f} {figures}"
        print(f"{line} {100 * shares[-1]:7.0f} %", flush=True)
    most = sum(share >= 0.8 for share in shares)
    print(f"  held-out error over the noise of a run: {min(ratios):.2f} to {max(ratios):.2f}")
    print(f"  gap closed: median {100 * np.median(shares):.0f} %; at least 80 % in {most} of {len(shares)}")
