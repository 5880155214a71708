"""Laws that describe what a measured table has beyond the model, and the robot that has the best of them.

laws.json has every place that was ranked and every law that was fitted. law.toml is the corrected robot with the
best law as an effect (`sim.model.force_law`), for the look-up table, the planner and the simulator. It is written
if this law leaves no more than noise. A law of the tails is no effect, so there is no law.toml for it.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from calibration.laws.law_fits import Law, Laws, find_laws
from calibration.laws.law_model import EXPONENTS, SIZE
from calibration.report.corrected_robot import check_given, corrected_robot
from calibration.statistics.exclusions import count_of_rows, summary_of_excluded
from calibration.statistics.fit import Fit, fit
from calibration.statistics.held_out import errors
from calibration.statistics.residual_tests import Directions, examine_residual
from calibration.statistics.statistical_model import start_values
from calibration.statistics.study import Study, find_outliers, split_runs
from calibration.swimmer.measured_table import Measurements, read_measurements
from calibration.swimmer.protocols import PROTOCOLS
from calibration.swimmer.swimmer import SwimmerModel
from sim.inputs import group_columns
from sim.io.files import files_together, write_text
from sim.io.provenance import provenance
from sim.model.force_law import COEFFICIENTS
from sim.model.groups import Groups
from sim.model.robot import Robot
from sim.model.robot_toml import robot_toml


@dataclass(frozen=True, repr=False)
class RobotLaws:
    """What describes the residual of a table of runs; made by `find_robot_laws`."""

    robot: Robot  # as it was given
    runs: Measurements
    study: Study
    base: Fit  # coefficients and nuisance parameters, without a law
    p_value: float  # of its residual
    laws: Laws | None  # None: the residual is within the noise
    table: str  # name of the table

    def __repr__(self) -> str:
        return f"RobotLaws: {self.sentence}"

    @property
    def sentence(self) -> str:
        """What the runs say, without a claim about the cause."""
        if self.laws is None:
            return f"The residual is within the noise (p = {self.p_value:.2g}): no law is looked for."
        return self.laws.sentence

    @property
    def error_without(self) -> float:
        """Relative rms of the calibrated model on the held-out runs."""
        return errors(self.runs, self.base.prediction, self.study.split.test)[0]

    @property
    def noise(self) -> float:
        """Relative error that the noise of a run makes."""
        run = self.base.noise.run
        return float(np.sqrt(np.trace(run) / len(run)))

    def to_frame(self) -> pd.DataFrame:
        """Tabulate the laws that were fitted, the largest gain first."""
        rows = [
            {
                "place": law.place.name,
                **{_short(name): law.fit.parameters.get(name, math.nan) for name in (SIZE, *EXPONENTS)},
                "gain": law.gain,
                "error": law.error,
                "p_value": law.p_value,
                "kept": not law.reason,
            }
            for law in (self.laws.fitted if self.laws else ())
        ]
        columns = ["place", "size", "speed", "length", "tails", "gain", "error", "p_value", "kept"]
        return pd.DataFrame(rows, columns=columns)

    def to_dict(self) -> dict[str, Any]:
        """Return the content of laws.json."""
        laws = self.laws or Laws((), ())
        return {
            "sentence": self.sentence,
            "p_value": self.p_value,
            "error_without": self.error_without,
            "noise": self.noise,
            "held_out": self.study.split.names,
            "places": [{"place": one.place.name, "gain": one.gain} for one in laws.ranked],
            "laws": [_record(law) for law in laws.fitted],
            "kept": [law.place.name for law in laws.kept],
            "table": self.table,
            "provenance": provenance({"table": self.table}),
        }

    def save(self, folder: str | Path) -> list[Path]:
        """Write laws.json, and law.toml if the best law is an effect that leaves only noise; all or none.

        Returns:
            The paths of the files.

        Raises:
            InputError: the files cannot be written.
        """
        best = self.laws.kept[0] if self.laws and self.laws.complete else None
        robot = None if best is None else robot_with_law(self.robot, best)
        names = ("laws.json",) if robot is None else ("laws.json", "law.toml")
        with files_together(folder, names) as temporary:
            write_text(temporary / "laws.json", json.dumps(self.to_dict(), indent=1) + "\n")
            if robot is not None:
                write_text(temporary / "law.toml", robot_toml(robot))
        return [Path(folder, name) for name in names]


def find_robot_laws(
    table: str | Path | pd.DataFrame,
    robot: Robot,
    *,
    seed: int = 0,
    jobs: int | None = None,
    progress: bool = True,
    tell: Callable[[str], object] = lambda line: None,
) -> RobotLaws:
    """Find laws that describe what a table of runs has beyond the calibrated model without effects.

    One whole session is held out, as in a calibration.

    Args:
        table: measured runs, or their file.
        robot: as given.
        seed: of the bootstrap.
        jobs: threads; default all processors.
        progress: show progress bars.
        tell: is told what was converted and what was excluded, a line at a time.

    Raises:
        InputError: the table cannot be used.
    """
    check_given(robot)
    data = read_measurements(table)
    excluded = summary_of_excluded(data.excluded, len(data) + count_of_rows(data.excluded))
    for line in (*data.converted, *(f"excluded: {line}" for line in excluded)):
        tell(line)
    data, held_out = PROTOCOLS["session"](data)
    model = SwimmerModel(robot, data, jobs)
    start = start_values(model)
    given = model.predict([start], title="as given" if progress else "")[0]
    model.check(given)
    study = Study(model, split_runs(data, held_out, find_outliers(data, given)), seed=seed, progress=progress)
    names = tuple(p.name for p in (*model.coefficients, *model.nuisances))
    used = study.split.fitted
    base = fit(model, model.guess(start, used), names, used, title="fit" if progress else "")
    none = Directions.plain(np.empty((*data.y.shape, 0)))
    p_value = examine_residual(study, base, none).general_p
    laws = find_laws(study, base) if p_value < study.level else None
    name = "table" if isinstance(table, pd.DataFrame) else Path(table).name
    return RobotLaws(robot, data, study, base, p_value, laws, name)


def robot_with_law(given: Robot, law: Law) -> Robot | None:
    """Return the corrected robot with a law as an effect; None where there is no such effect (tails)."""
    powers, parameters = law.powers, dict(law.fit.parameters)
    name = law.place.effect_name(powers)
    if name is None:
        return None
    robots, place = law.model.robots({**parameters, **dict.fromkeys(EXPONENTS, 0.0)})
    logarithms = [float(powers.logarithm(Groups.from_columns(group_columns([robot])))[0]) for robot in robots]
    to_control = math.exp(-float(np.array(logarithms)[place].mean()))  # the law has m = 1 at the control example
    size = 1.0
    if law.place.is_term:
        size = parameters[SIZE] * to_control
    else:
        parameters[COEFFICIENTS[law.place.name]] *= to_control
    corrected = corrected_robot(given, parameters)
    return replace(corrected, effects={**corrected.effects, name: size})


def _record(law: Law) -> dict[str, Any]:
    """Write a law as laws.json has it; the size is at the geometric mean of the runs."""
    numbers = {
        _short(p.name): {
            "value": law.fit.parameters[p.name],
            "interval": list(law.fit.interval(p.name)),
        }
        for p in law.model.effects
    }
    return {
        "place": law.place.name,
        "words": law.words,
        **numbers,
        "gain": law.gain,
        "session_gain": list(law.session_gain),
        "p_value": law.p_value,
        "error": law.error,
        "error_interval": list(law.error_interval),
        "reason": law.reason,
    }


def _short(name: str) -> str:
    return name.removeprefix("law_")
