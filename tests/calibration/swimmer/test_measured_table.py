"""What is no measured table is told what such a table needs."""

from __future__ import annotations

import pandas as pd
import pytest

from calibration.swimmer.measured_table import read_measurements
from sim.io.errors import InputError


def test_a_track_is_no_measured_table() -> None:
    """Its answer used to be that heading_deg and heading_rad are the same quantity."""
    track = pd.DataFrame({"time_s": [0.0, 1.0], "x_cm": [0.0, 1.0], "heading_deg": [0.0, 5.0], "heading_rad": 0.0})
    with pytest.raises(InputError, match=r"the table has no column 'N'; it needs N, l_cm, omega_rpm"):
        read_measurements(track)
