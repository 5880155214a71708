"""Tables of the simulator itself, whose truth is stepped in time on twice as many edges with half the step.

Runs whose truth does not settle in time take the direct solution; they are counted on stderr.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from benchmarks.calibration.planted import ROBOT, Signals, design, scatter
from calibration.statistics.forward import derivatives
from calibration.statistics.statistical_model import (
    Experiment,
    Parameter,
    apply_step,
    precisions,
    prior_offsets,
    start_values,
)
from calibration.swimmer.swimmer import DIRECT, SwimmerModel
from common.arrays import Floats
from sim.motion.batches import stepped_columns

LENGTHS_CM = (5.0, 6.2, 7.4, 8.6, 9.8, 11.0)
LEVEL = 8.0
THINNING, TIME = "shear_thinning", "shear_thinning_time"
_PASSES = 5


def thinning() -> list[dict[str, float]]:
    """Fluids that thin by the local rate of shear: 1 − n for Carreau's exponents, at three times (logarithms)."""
    return [{THINNING: 1 - n, TIME: time} for n in (0.5, 0.6, 0.7, 0.8, 0.9) for time in (-1.0, 0.5, 2.0)]


def simulated(sizes: Mapping[str, float], seeds: list[int]) -> list[Experiment]:
    """Make models with data of one truth, one for each seed of the noise."""
    model = SwimmerModel(ROBOT, design(LENGTHS_CM), jobs=1)

    def steady(columns: Mapping[str, Floats], **options: Any) -> dict[str, Any]:
        answer = stepped_columns(columns, finer=2, **options)
        bad = ~(answer["converged"] & np.isfinite(answer["omega_t_bar"]))
        if bad.any():
            print(f"{dict(sizes)}: {bad.sum()} conditions did not settle", file=sys.stderr)
            direct = DIRECT.steady({k: v[bad] for k, v in columns.items()}, **options)
            for name in answer.keys() & direct.keys():  # the direct solution has no stability
                answer[name][bad] = direct[name]
        return answer

    finer = replace(model, solver=DIRECT._replace(steady=steady))
    outputs = np.asarray(finer.predict([{**start_values(model), **sizes}])[0])
    noise = [scatter(model.runs, outputs.shape[1], seed) for seed in seeds]
    return [replace(model, runs=replace(model.runs, y=outputs + each)) for each in noise]


def sized(effect: Parameter, model: SwimmerModel, signals: Signals) -> float | None:
    """Find the size at which λ is `LEVEL`; None if it is out of bounds."""
    start, size = start_values(model), 0.5 * effect.typical
    for _ in range(_PASSES):
        at = float(np.clip(effect.start + size, *effect.bounds))
        level = _strength(model.predict([{**start, effect.name: at}])[0], model, signals)
        if abs(level / LEVEL - 1) < 0.03:
            return at
        size = (at - effect.start) * min(max(LEVEL / max(level, 1e-3), 0.1), 10.0)
    return None


def _strength(outputs: Floats, model: SwimmerModel, signals: Signals) -> float:
    """λ: what the best coefficients and nuisance parameters leave of outputs (n, k) without noise, in σ."""
    fitted = (*model.coefficients, *model.nuisances)
    names, used = [p.name for p in fitted], signals.used
    parameters, unabsorbed = start_values(model), np.zeros(0)
    for _ in range(_PASSES):
        prediction, J = derivatives(model, parameters, names)
        root = np.sqrt(precisions(fitted))
        columns = np.concatenate([signals.white(J[used]), np.diag(root)])
        pull = -root * prior_offsets(fitted, parameters)
        values = np.concatenate([signals.white((outputs - prediction)[used]), pull])
        step = np.linalg.lstsq(columns, values, rcond=None)[0]
        unabsorbed = values - columns @ step
        parameters = apply_step(fitted, parameters, step)
    return float(np.linalg.norm(unabsorbed))
