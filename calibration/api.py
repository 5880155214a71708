"""Say which of several explanations new runs speak for: `softflagella.decide`."""

from __future__ import annotations

from pathlib import Path

import pandas as pd

from calibration.findings.next_runs import Decision, read_explanations, refuse_nothing_to_decide
from calibration.findings.next_runs import decide as decide_between
from calibration.laws.law_model import with_law
from calibration.own_model.declared import Model
from calibration.own_model.table_of_runs import Roles, read_function_model
from calibration.statistics.traces import whitened
from calibration.swim.measured_swim import PlanSource, is_track, read_swims
from calibration.swim.swim_model import swim_model
from calibration.swimmer.measured_table import read_measurements
from calibration.swimmer.swimmer import SwimmerModel
from calibration.table.reader import open_table
from calibration.verdict.verdict import Verdict
from common.errors import InputError, naming
from common.keywords import checks_keywords
from sim.robot_rows import OneRobot, one_robot


@checks_keywords
def decide(
    table: str | Path | pd.DataFrame,
    verdict: Verdict | str | Path,
    robot: OneRobot | Model,
    *,
    plan: PlanSource | None = None,
    session: str | None = None,
    specimen: str | None = None,
    trace: str | None = None,
    jobs: int | None = None,
) -> Decision:
    """Say which of several explanations new runs speak for.

    Args:
        table: the measured table with the new runs, or traces, in sessions of their own; or the track of a new
            swim, whose file or `run` has another name than those before.
        verdict: an "ambiguous" verdict on the table before, or its verdict.json.
        robot: the robot as given, its robot.toml, or the name of a preset; of a swim the robot that swam. In
            Python also a `Model` of your own.
        plan: plan.json of the path that was swum, for a track, see `softflagella.calibrate`.
        session: COL, for a model of your own, as for `softflagella.calibrate`.
        specimen: COL, as there.
        trace: COL, as there.
        jobs: threads; default all processors.

    Returns:
        The explanations, best first, with how far each is behind, and a `sentence`.

    Raises:
        InputError: there is nothing to decide, or there are no new runs.

    Example:
        >>> import softflagella as sf
        >>> sf.decide("runs.csv", "calibrated/verdict.json", "robot.toml").sentence  # doctest: +SKIP
        'Decided: tank wall. The next step is to calibrate with all runs.'
    """
    if isinstance(verdict, Verdict):
        explanations, before = list(verdict.explanations), set(verdict.runs.session_names)
        refuse_nothing_to_decide(explanations)
    else:
        explanations, before = read_explanations(verdict)
    roles = Roles(session=session, specimen=specimen, trace=trace)
    if isinstance(robot, Model):
        if plan is not None:
            raise InputError("decide: plan is not for a model of your own; leave it out")
        model = read_function_model(table, robot, roles)
        memory = explanations[0].memory
        white = whitened(model, *memory) if memory and model.runs.trace is not None else model
        return decide_between(white, explanations, before)
    if any(roles):
        raise InputError("decide: session, specimen and trace are not for a robot; leave them out")
    file = None if isinstance(table, pd.DataFrame) else table
    with naming(table):
        measured = open_table(table)
    if plan is not None or is_track(measured):
        swum, _ = swim_model(one_robot(robot), read_swims(measured, plan, file=file), jobs=jobs)
        return decide_between(swum, explanations, before)
    steady = SwimmerModel(one_robot(robot), read_measurements(measured, file=file), jobs)
    return decide_between(steady, explanations, before, with_law)
