"""Times of any usual kind are numbers in the unit of their column; what could be two times is none."""

from __future__ import annotations

import pandas as pd
import pytest

from sim.io.quantities import convert_columns, numbers_of

NAN = float("nan")


@pytest.mark.parametrize(
    ("name", "given", "expected"),
    [
        ("time_s", pd.to_timedelta([0, 1.5], unit="s"), [0, 1.5]),
        ("time_ms", pd.to_timedelta([0, 1.5], unit="s"), [0, 1500]),
        ("elapsed_min", pd.to_datetime(["2026-01-01 00:03", "2026-01-01 00:00", None]), [3, 0, NAN]),
        ("elapsed_min", ["0:03:00", "0 days 00:00:30.0", "1 day, 0:00:00"], [3, 0.5, 1440]),
        ("t_s", ["2026-05-01T12:00:00Z", "2026-05-01 14:00:01,5+02:00", "2026-05-01"], [43200, 43201.5, 0]),
        ("time_s", ["0:00:01", "1:30", "2026"], [1, NAN, NAN]),
        ("time_s", [1.7e9, 1.7e9 + 0.5], [0, 0.5]),
        ("time_ms", [1.7e12, NAN, 1.7e12 + 500], [0, NAN, 500]),
        ("time_s", [1.7e12, 1.7e12 + 500], [NAN, NAN]),
        ("time_s", [5.0, 7.0], [5, 7]),
        ("time_s", ["5", "lost"], [5, NAN]),
        ("heading_deg", pd.to_timedelta([0, 1.5], unit="s"), [NAN, NAN]),
        ("heading_deg", pd.to_datetime(["2026-01-01", "2026-01-02"]), [NAN, NAN]),
    ],
    ids=str,
)
def test_times(name: str, given: object, expected: list[float]) -> None:
    """Durations were nanoseconds, dates nanoseconds since 1970."""
    assert numbers_of(pd.Series(given, name=name)).tolist() == pytest.approx(expected, nan_ok=True, abs=1e-9)


def test_a_duration_has_a_unit_of_its_own() -> None:
    table = convert_columns(
        pd.DataFrame({"t_ms": ["0:00:01", "0:00:02"]}), ["time_s"], "tracks", {"t": "time"}
    ).table
    assert table["time_s"].tolist() == [1, 2]
