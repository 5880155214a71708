"""Tables by the toy robot, and their verdicts."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import fields, replace
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
import pytest

import calibration.swimmer.swimmer
import calibration.swimmer.synthetic_table
from calibration.attribution import moves
from calibration.laws import laws
from calibration.laws.laws import Laws, find_laws
from calibration.laws.places import place_named
from calibration.robot.robot_verdict import RobotVerdict
from calibration.statistics.fit import Fit, fit
from calibration.statistics.lab_settings import LabSettings
from calibration.statistics.statistical_model import start_values
from calibration.statistics.study import Study
from calibration.swimmer.influences import influences
from calibration.swimmer.measured_table import read_measurements
from calibration.swimmer.swimmer import DIRECT, SwimmerModel
from calibration.swimmer.synthetic_table import make_table
from calibration.verdict.calibrate import calibrate, first_fit
from calibration.verdict.verdict import Verdict
from common.arrays import Flags
from sim.model.presets import PRESETS
from sim.model.robot import Robot
from tests.calibration import toy
from tests.shared import shared

START = PRESETS["paper-measured"]
TRUTH = replace(START, C_t=3.1, C_r=2.4, C_yr=4.4)
DRAG = "end_over_end_drag"

LENGTHS_CM = (5.0, 8.0, 11.0)
FEW_DRAWS = 200  # of the bootstrap, where no rate is asserted
FEW_CANDIDATES = (DRAG, "left_right_bias", "natural_curvature", "tail_spin_drag")
FEW_PLACES = ("Cyr", "Ct", "Fx_wt", "Fx_wt_at_l", "Mz_wh")


def install_toy(patch: pytest.MonkeyPatch) -> None:
    """The toy in place of the simulator: for tables, and for every SwimmerModel that is not told otherwise."""
    defaults = SwimmerModel.__init__.__defaults__ or ()
    patch.setattr(SwimmerModel.__init__, "__defaults__", tuple(toy.SOLVER if d is DIRECT else d for d in defaults))
    patch.setattr(calibration.swimmer.synthetic_table, "stepped_columns", toy.steady_columns)
    patch.setattr(SwimmerModel, "guess", lambda model, start, used: start)
    patch.setitem(calibrate.__kwdefaults__, "draws", FEW_DRAWS)
    patch.setattr(moves, "_DRAWS", FEW_DRAWS)


def install_few_candidates(patch: pytest.MonkeyPatch, names: Sequence[str] = FEW_CANDIDATES) -> None:
    """Let every SwimmerModel search a few effects only, where the number of candidates is not the subject."""
    few = {name: influence for name, influence in influences().items() if name in names}
    patch.setattr(calibration.swimmer.swimmer, "influences", lambda: few)


@contextmanager
def on_the_toy(*, few: bool | Sequence[str] = False) -> Iterator[None]:
    """The toy in place of the simulator, with all candidates or few, which may be named."""
    with pytest.MonkeyPatch.context() as patch:
        install_toy(patch)
        if few:
            install_few_candidates(patch, FEW_CANDIDATES if few is True else few)
        yield


def toy_table(
    seed: int, *, lengths_cm: Sequence[float] = LENGTHS_CM, truth: Robot = TRUTH,
    design: dict[str, Any] | None = None, **effects: float,
) -> pd.DataFrame:  # fmt: skip
    """Make a table of the true robot with these effects; a design may have what `make_table` takes."""
    with on_the_toy():
        robot = replace(truth, effects=effects)
        return make_table(robot, seed=seed, lengths_cm=lengths_cm, title="", **design or {})


def toy_swimmer(table: pd.DataFrame, robot: Robot = START, own: LabSettings | None = None) -> SwimmerModel:
    return SwimmerModel(robot, read_measurements(table), solver=toy.SOLVER, own=own or {})


def fit_all(model: Any, used: Flags | None = None, *effects: str) -> Fit:
    """Fit the coefficients, nuisance parameters and these effects to all runs, or to those used."""
    names = (*(p.name for p in (*model.coefficients, *model.nuisances)), *effects)
    return fit(model, start_values(model), names, np.ones(len(model.runs), bool) if used is None else used)


def calibrated(
    table: pd.DataFrame, *, few: bool | Sequence[str] = False, robot: Robot = START, draws: int = FEW_DRAWS,
    **options: Any,
) -> Verdict:  # fmt: skip
    """Calibrate the toy with a table."""
    with on_the_toy(few=few):
        model = toy_swimmer(table, robot)
        return calibrate(model, draws=draws, progress=False, **options)


@shared
def calibrated_toy(
    seed: int, *, few: tuple[str, ...] = (), lengths_cm: tuple[float, ...] = LENGTHS_CM, **effects: float
) -> Verdict:
    """The verdict of a toy table."""
    return calibrated(toy_table(seed, lengths_cm=lengths_cm, **effects), few=few)


def none() -> Verdict:
    """A verdict on a table in which nothing is missing."""
    return calibrated_toy(3, few=FEW_CANDIDATES)


def effect() -> Verdict:
    """A verdict that names the hidden drag."""
    return calibrated_toy(5, few=FEW_CANDIDATES, **{DRAG: 5.0})


def ambiguous() -> Verdict:
    """A verdict on tails of one length, which do not tell the drag from another effect."""
    few = (DRAG, "surface_couple", "tail_contact", "left_right_bias")
    return calibrated_toy(1, few=few, lengths_cm=(8.0,), **{DRAG: 4.0})


def wrong_scale() -> pd.DataFrame:
    """A table by a camera whose scale is off by six of its standard deviations."""
    table = toy_table(4)
    return table.assign(R_yr_cm=1.06 * table["R_yr_cm"])


@shared
def number() -> Verdict:
    """The verdict that the scale of the camera is wrong."""
    return calibrated(wrong_scale(), few=True)


def verdict_of(verdict: Verdict) -> RobotVerdict:
    """The verdict with its robot."""
    given = {f.name: getattr(verdict, f.name) for f in fields(verdict)}
    return RobotVerdict(**(given | {"table": "runs.csv"}), robot=START)


@contextmanager
def few_places(names: Sequence[str]) -> Iterator[None]:
    """Let laws be looked for at some places only."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(laws, "places", lambda **_: tuple(map(place_named, names)))
        yield


class FoundLaws(NamedTuple):
    """The laws of a table, and the fit without them."""

    study: Study
    base: Fit
    laws: Laws


def laws_of(table: pd.DataFrame, places: tuple[str, ...] = ()) -> FoundLaws:
    """The laws that describe a table, at these places or all."""
    with on_the_toy(), few_places(places) if places else nullcontext():
        study, base, _ = first_fit(toy_swimmer(table))
        return FoundLaws(study, base, find_laws(study, base))


@shared
def laws_of_toy(seed: int, *, places: tuple[str, ...] = FEW_PLACES, **effects: float) -> FoundLaws:
    """The laws that describe a toy table of four lengths."""
    return laws_of(toy_table(seed, lengths_cm=(5.0, 7.0, 9.0, 11.0), **effects), places)
