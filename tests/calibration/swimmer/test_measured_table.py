"""What is no measured table is told what such a table needs."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from calibration.swimmer.measured_table import read_measurements
from sim.io.errors import InputError
from tests.calibration.toy_tables import toy_table


def test_a_track_is_no_measured_table() -> None:
    """Its answer used to be that heading_deg and heading_rad are the same quantity."""
    track = pd.DataFrame({"time_s": [0.0, 1.0], "x_cm": [0.0, 1.0], "heading_deg": [0.0, 5.0], "heading_rad": 0.0})
    with pytest.raises(InputError, match=r"the table has no column 'N'; it needs N, l_cm, omega_rpm"):
        read_measurements(track)


@pytest.mark.usefixtures("toy_model")
@pytest.mark.parametrize("blank", [np.nan, "", " "], ids=["missing", "empty", "blank"])
@pytest.mark.parametrize("column", ["v_cm_s", "R_yr_mm", "elapsed_min", "session", "camera_scale_sigma_percent"])
def test_an_optional_column_without_any_value_is_left_out(column: str, blank: object) -> None:
    """An empty v_cm_s left 0 usable runs; an empty session was one session with the name nan."""
    table = toy_table(3).drop(columns=["R_yr_cm", "session"])
    runs, plain = read_measurements(table.assign(**{column: blank})), read_measurements(table)
    name = "R_yr_cm" if column == "R_yr_mm" else column
    assert runs.excluded == (f"column {name}: without any value, left out",)
    assert runs.outputs == plain.outputs
    assert runs.session_names == plain.session_names
    assert np.array_equal(runs.y, plain.y)


@pytest.mark.usefixtures("toy_model")
def test_inputs_and_the_last_outputs_must_have_values() -> None:
    with pytest.raises(InputError, match="0 usable runs"):
        read_measurements(toy_table(3).assign(l_cm=np.nan))
    outputs = {name: np.nan for name in ("omega_yr_rad_s", "R_yr_cm", "theta_deg")}
    with pytest.raises(InputError, match="without any value: omega_yr_rad_s, R_yr_cm, theta_deg"):
        read_measurements(toy_table(3).assign(**outputs))
