"""Powers of the robot's own motion with which the exponents of a law agree: of its speed, spins or yaw rate.

A robot's speed |v| follows its motor speed, tail length and number of tails nearly as a power law, over the runs
of a table:

    ln |v| ≈ c + g₁ ln ω + g₂ ln l + g₃ ln N,

by least squares over the runs, with the motion of the fitted model. So a factor |v|^s and the factor
(ω^g₁ l^g₂ N^g₃)^s are nearly the same one, and exponents that agree with s g agree with a power of the speed
(`calibration.laws.readings`). A quantity is left out if it is no power law to within LARGEST_SCATTER.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from sim.arrays import Floats

LARGEST_SCATTER = 0.07  # rms of what the power law leaves of the logarithm
_SYMBOLS = {"omega_h": "ω_h", "omega_t": "ω_t", "omega_yr": "ω_yr"}


def motion_patterns(
    inputs: Floats, outputs: Sequence[str], prediction: Floats
) -> Mapping[str, tuple[float, float, float]]:
    """Find the exponents g with which the motion follows ω, l and N.

    Args:
        inputs: ln ω, ln l, ln N of every run, (n, 3).
        outputs: names of the columns of `prediction`, of `calibration.swimmer.measured_table.OUTPUTS`.
        prediction: the fitted model's outputs, (n, k); logarithms of all but θ.

    Returns:
        Symbol -> exponents of ω, l and N; zero for an input that does not differ between the runs.
    """
    columns = dict(zip(outputs, prediction.T, strict=True))
    motion = {symbol: columns[name] for name, symbol in _SYMBOLS.items() if name in columns}
    if "v" in columns:
        motion["|v|"] = columns["v"]
    elif {"omega_yr", "R_yr"} <= set(columns):
        motion["|v|"] = columns["omega_yr"] + columns["R_yr"]
    centred = inputs - inputs.mean(0)
    patterns = {}
    for symbol, logarithm in motion.items():
        about_mean = logarithm - logarithm.mean()
        exponents = np.linalg.lstsq(centred, about_mean, rcond=None)[0]
        if np.std(about_mean - centred @ exponents) < LARGEST_SCATTER:
            patterns[symbol] = (float(exponents[0]), float(exponents[1]), float(exponents[2]))
    return patterns
