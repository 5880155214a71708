"""Close the loop with measured data: `softflagella.calibrate`, with the error on paths before and after."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from numbers import Integral, Real
from pathlib import Path
from typing import TYPE_CHECKING, Literal, Unpack

import pandas as pd

from calibration.own_model.declared import Model
from calibration.own_model.model_verdict import ModelVerdict
from calibration.own_model.table_of_runs import Noise, Roles, read_runs_of
from calibration.statistics.budget import Work, limited
from calibration.statistics.lab_settings import LabSettings, read_lab_settings
from calibration.table.runs import lines_of_excluded
from calibration.verdict.calibrate import calibrate as find_what_is_missing
from common.errors import InputError
from common.keywords import checks_keywords
from common.track_options import TrackOptions
from common.units import LengthUnit

if TYPE_CHECKING:
    from calibration.robot.robot_verdict import RobotVerdict
    from calibration.swim.measured_swim import PlanSource
    from sim.robot_rows import OneRobot

MAX_PREDICTIONS = 300_000  # of one run of a robot, for the search
MAX_PREDICTIONS_OF_OWN_MODEL = 100_000_000  # a function of one's own predicts many rows at once


@checks_keywords
def calibrate(
    table: str | Path | pd.DataFrame,
    robot: OneRobot | Model,
    *,
    protocol: Literal["session", "paper"] = "session",
    seed: int = 0,
    own: LabSettings | Sequence[str] | None = None,
    laws: bool = True,
    paths: Sequence[str] = (),
    unit: LengthUnit | None = None,
    plan: PlanSource | None = None,
    beside: str | Path | pd.DataFrame | None = None,
    session: str | None = None,
    specimen: str | None = None,
    trace: str | None = None,
    held_out: str | Sequence[str] | None = None,
    noise: Noise | None = None,
    notes: Sequence[str] | None = None,
    max_predictions: float | None = None,
    max_seconds: float | None = None,
    jobs: int | None = None,
    progress: bool = True,
    tell: Callable[[str], object] = lambda line: None,
    **options: Unpack[TrackOptions],
) -> RobotVerdict | ModelVerdict:
    """Fit measured runs, or a swim, find what the model lacks, and correct the robot, or a model of your own.

    `protocol`, `laws`, `paths`, `unit`, `plan`, `beside` and `options` are for a robot; `session`, `specimen`,
    `trace`, `held_out`, `noise` and `notes` are for a model of your own.

    Args:
        table: measured runs, one row for each run, or their file: `N`, `l_cm`, `omega_rpm` and two or more
            of `omega_h_rpm`, `omega_t_rpm`, `omega_yr_rad_s`, `R_yr_cm`, `theta_deg`, `v_cm_s`; repeats. Or the
            track of a swim, one row for each pose: `time_s`, `x_cm`, `y_cm`, `heading_deg`, the motor's
            `direction`, and `run` where there are several swims.
        robot: the robot as given, its robot.toml, or the name of a preset. In Python also a `Model` of your own;
            the columns of its table are those for which its function asks, and its outputs.
        protocol: what is fitted: all sessions but one ("session"), or N = 3 and 4 as in the paper ("paper").
        seed: of the bootstrap; the same seed gives the same result.
        own: KEY=VALUES, what the lab can set in the next runs that the verdict proposes, such as l_cm=5,7,9; for
            `N`, `l_cm` and `omega_rpm` (both directions), or the settings of a model of your own. Default: the
            table's range. In Python a list of such words, or `{"l_cm": (5, 7, 9)}`.
        laws: look for laws where no effect explains the runs.
        paths: files or shapes, such as `("square:24cm",)`, on which the error with the robot as given and with the
            corrected one is stated; `verdict.paths` has it.
        unit: of lengths that are given without one; l for tail lengths. 24cm and 3l, columns x_cm and y_cm, and
            drawings with a size have their own.
        plan: plan.json of the path that was swum, for a track: its flips are exact, and a track without
            `direction` has no others.
        beside: TABLE, measured runs of the robot that swam, for a track: both are fitted at once.
        session: COL, the column that says which runs were made together (default: session, if there is one).
        specimen: COL, the column that says what was run, where there are several.
        trace: COL, the column that says to which trace a reading belongs, where the model has a time. Without a
            session each trace is one.
        held_out: NAME, a session that is held out for the test, or a column that says so of each run (default: the
            middle session).
        noise: say that neither repeats nor stated errors tell the noise of a run; nothing is claimed then. In
            Python also the standard deviation of one run for each output, {"v": "2 %"}; in the unit of the
            output where differences are compared.
        notes: COL, a column in which runs may differ without the model's knowledge; columns that are not named
            then are not looked at (default: all others).
        max_predictions: of a run, for the search (default 300,000; for a model of your own 100,000,000, over the
            whole calibration). A verdict that this cuts short is provisional, and says what was not tried.
        max_seconds: of processor time, for the same (default: no limit), where a model is slow. Time in which a
            function of your own waits for another program counts. What is cut short depends on the machine then.
        jobs: threads; default all processors.
        progress: show progress bars.
        tell: is told, before the fit, what was converted and what was excluded, a line at a time.
        options: of a track that another program has written, see `TrackOptions`.

    Returns:
        The verdict, with `verdict` ("none", "number", "effect", "ambiguous", "partial", "unexplained"),
        `sentence`, `effects`, `nearest`, `moves`, fits with intervals, errors on the held-out runs, the
        `corrected` robot, or the numbers of the model, and `save(folder)`.

    Raises:
        InputError: the table cannot be used; the message says why.

    Example:
        >>> import softflagella as sf
        >>> verdict = sf.calibrate("runs.csv", "robot.toml")  # doctest: +SKIP
        >>> print(verdict.sentence)  # doctest: +SKIP
        >>> result = sf.plan(sf.circle(2.0), verdict)  # doctest: +SKIP
        >>> verdict.samples(1000)["C_t"].quantile([0.025, 0.975])  # doctest: +SKIP
    """
    for name, most in (("max_predictions", max_predictions), ("max_seconds", max_seconds)):
        if most is not None and not (isinstance(most, Real) and most > 0):
            raise InputError(f"{name}: {most}; give a positive number")
    usual = MAX_PREDICTIONS_OF_OWN_MODEL if isinstance(robot, Model) else MAX_PREDICTIONS
    limit = Work(max_predictions or usual, max_seconds or math.inf)
    if not (isinstance(seed, Integral) and seed >= 0):
        raise InputError(f"seed: {seed}; give a whole number from 0")
    settings = own if isinstance(own, Mapping) else read_lab_settings(own or ())
    roles = Roles(session, specimen, held_out, noise, notes, trace)
    if isinstance(robot, Model):
        _refuse("a model of your own", laws=not laws, paths=paths, unit=unit, plan=plan,
                beside=beside is not None, protocol=protocol != "session", **options)  # fmt: skip
        with limited(limit):
            experiment, rows = read_runs_of(table, robot, roles, own=settings, title="checks" if progress else "")
            for line in (*experiment.runs.converted, *lines_of_excluded(experiment.runs)):
                tell(line)
            of_model = partial(ModelVerdict, model=robot, table=_name(table))
            verdict = find_what_is_missing(
                experiment, held_out=rows, limit=limit, seed=seed, progress=progress, verdict=of_model
            )
        return replace(verdict, caveats=(*verdict.caveats, *experiment.caveats))
    _refuse("a robot", **roles._asdict())
    from softflagella.robot_loop import calibrate_robot  # loads the simulator, matplotlib and what plans

    return calibrate_robot(
        table,
        robot,
        name=_name(table),
        protocol=protocol,
        seed=seed,
        own=settings,
        laws=laws,
        paths=paths,
        unit=unit,
        plan=plan,
        beside=beside,
        limit=limit,
        jobs=jobs,
        progress=progress,
        tell=tell,
        options=options,
    )


def _refuse(what: str, **keywords: object) -> None:
    """Refuse keywords that are given and mean nothing for what is calibrated."""
    if given := [name for name, value in keywords.items() if value]:
        raise InputError(f"calibrate: {', '.join(given)} is not for {what}; leave it out")


def _name(table: str | Path | pd.DataFrame) -> str:
    """Name a table by its file."""
    return str(table.attrs.get("name", "table")) if isinstance(table, pd.DataFrame) else Path(table).name
