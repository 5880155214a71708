"""Excluded rows are grouped by reason; many of them are a caveat."""

from __future__ import annotations

from calibration.statistics.exclusions import caveat_of_excluded, count_of_rows, summary_of_excluded

SIGN = "has the wrong sign for its omega_rpm: the head turns against the motor"
EXCLUDED = (
    "row 9: theta_deg = nan is not a finite number",
    *(f"row {i}: omega_h_rpm = {i / 7:g} {SIGN}" for i in (2, 3, 5, 8)),
    *(f"row {i}: a copy of an earlier row, equal in all inputs and outputs (row {i - 10})" for i in (11, 12)),
    *(f"row {i}: R_yr is {i} standard deviations from its repeat" for i in (14, 17)),
    "column colour: not known, left out",
)


def test_rows_of_one_reason_are_one_line() -> None:
    """Only the first used to be said: half of a table went missing in a line that named row 1."""
    assert summary_of_excluded(EXCLUDED, 40) == [
        f"4 of 40 rows (rows 2, 3, 5 and 1 more): omega_h_rpm {SIGN}",
        "2 of 40 rows (rows 11, 12): a copy of an earlier row, equal in all inputs and outputs",
        "2 of 40 rows (rows 14, 17): R_yr is standard deviations from its repeat",
        "row 9: theta_deg = nan is not a finite number",
        "column colour: not known, left out",
    ]
    assert summary_of_excluded((), 40) == []
    assert count_of_rows(EXCLUDED) == 9


def test_reasons_that_differ_in_more_than_a_value_stay_apart() -> None:
    lines = (
        "row 1: N = 2.5 is not a whole number",
        "row 2: N = three is not a finite number",
        "row 3: N = 7 is not above 0",
    )
    assert summary_of_excluded(lines, 9) == list(lines)


def test_more_than_a_fifth_of_the_rows_is_a_caveat() -> None:
    assert caveat_of_excluded(EXCLUDED, 45) == ()
    assert caveat_of_excluded(EXCLUDED, 44)[0].startswith("9 of 44 rows (20 %) were excluded")
