"""What every reader of a table does: one declared by a robot, or by a model of one's own."""

from __future__ import annotations

import numpy as np
import pandas as pd

from calibration.own_model.table_of_runs import Roles, read_runs_of
from calibration.swimmer.measured_table import read_measurements
from tests.calibration.own_model.test_faults import MODEL, TABLE
from tests.calibration.toy_tables import toy_table


def test_a_header_within_the_table_of_a_model_is_named_as_such() -> None:
    header = pd.DataFrame([list(TABLE)], columns=list(TABLE))
    table = pd.concat([TABLE.astype(object)[:20], header, TABLE.astype(object)[20:]], ignore_index=True)
    runs = read_runs_of(table, MODEL, Roles(session="round"))[0].runs
    assert list(map(str, runs.excluded)) == ["row 21: the header again"]
    assert np.array_equal(runs.y, read_runs_of(TABLE, MODEL, Roles(session="round"))[0].runs.y)


def test_equal_rows_of_two_robots_are_no_copies() -> None:
    """They are under two conditions, as they are in every other comparison."""
    table = toy_table(3)
    both = pd.concat([table.assign(robot="a"), table[:4].assign(robot="b")], ignore_index=True)
    assert read_measurements(both).excluded == ()
    assert len(read_measurements(both.assign(robot="a")).excluded) == 4
