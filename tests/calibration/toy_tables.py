"""Tables by the toy robot, and their verdicts."""

from __future__ import annotations

from dataclasses import replace

import pandas as pd
import pytest

import calibration.swimmer.swimmer
import calibration.swimmer.synthetic_table
import sim.motion.batches
from calibration.swimmer.candidate_effects import influences
from calibration.swimmer.head_correction import learn_head_correction
from calibration.swimmer.measured_table import read_measurements
from calibration.swimmer.possible_runs import Owned
from calibration.swimmer.swimmer import DIRECT, SwimmerModel
from calibration.swimmer.synthetic_table import make_table
from calibration.verdict.calibrate import calibrate
from calibration.verdict.verdict import Verdict
from sim.model.presets import PRESETS
from sim.model.robot import Robot
from tests.calibration import toy
from tests.shared import shared

START = PRESETS["paper-measured"]
TRUTH = replace(START, C_t=3.1, C_r=2.4, C_yr=4.4)

LENGTHS_CM = (5.0, 8.0, 11.0)
FEW_DRAWS = 200  # of the bootstrap, where no rate is asserted
FEW_CANDIDATES = ("end_over_end_drag", "left_right_bias", "natural_curvature", "tail_spin_drag")


def install_toy(patch: pytest.MonkeyPatch) -> None:
    """The toy in place of the simulator: for tables, and for every SwimmerModel that is not told otherwise."""
    defaults = SwimmerModel.__init__.__defaults__ or ()
    patch.setattr(SwimmerModel.__init__, "__defaults__", tuple(toy.SOLVER if d is DIRECT else d for d in defaults))
    patch.setattr(calibration.swimmer.synthetic_table, "stepped_columns", toy.steady_columns)
    patch.setattr(SwimmerModel, "guess", lambda model, start, used: start)
    for name in ("steady", "sensitivities", "settle"):  # what all of the simulator's batches call
        patch.setattr(sim.motion.batches, name, refuse_to_simulate)


def install_few_candidates(patch: pytest.MonkeyPatch) -> None:
    """Let every SwimmerModel search a few effects only, where the number of candidates is not the subject."""
    few = {name: influence for name, influence in influences().items() if name in FEW_CANDIDATES}
    patch.setattr(calibration.swimmer.swimmer, "influences", lambda: few)


def refuse_to_simulate(*_: object, **__: object) -> None:
    raise AssertionError("a test on the toy simulated")


def toy_table(seed: int, *, lengths_cm: tuple[float, ...] = LENGTHS_CM, **effects: float) -> pd.DataFrame:
    return make_table(replace(TRUTH, effects=effects), seed=seed, lengths_cm=lengths_cm, title="")


def toy_swimmer(table: pd.DataFrame, robot: Robot = START, own: Owned | None = None) -> SwimmerModel:
    return SwimmerModel(robot, read_measurements(table), solver=toy.SOLVER, own=own or {})


def calibrated(table: pd.DataFrame, *, seed: int = 0, draws: int = FEW_DRAWS) -> Verdict:
    correction = learn_head_correction
    return calibrate(toy_swimmer(table), correction=correction, seed=seed, draws=draws, progress=False)


@shared
def calibrated_toy(seed: int, *, lengths_cm: tuple[float, ...] = LENGTHS_CM, **effects: float) -> Verdict:
    """The verdict of a toy table."""
    with pytest.MonkeyPatch.context() as patch:
        install_toy(patch)
        return calibrated(toy_table(seed, lengths_cm=lengths_cm, **effects))
