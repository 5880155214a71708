"""Columns of a table of measured runs: the contract between those who measure and those who calibrate.

A run has the settings RUN, two or more outputs of MEASURED, and notes. An output that differs from what the robot
as given does by the factor between two usual units is refused with the unit that it seems to be in.
"""

from __future__ import annotations

import difflib
from typing import TYPE_CHECKING, NamedTuple

from common.errors import InputError
from common.units import guess_slip, other_units, to_si

if TYPE_CHECKING:
    import pandas as pd

    from common.quantities import Converted

RUN = ("N", "l_cm", "omega_rpm")  # what differs between the runs of a robot
RUN_SYNONYMS = {
    "rpm": "omega", "motor": "omega", "motor_speed": "omega", "length": "l", "tail_length": "l", "tails": "N",
    "heading": "course",
}  # fmt: skip


class Measured(NamedTuple):
    """An output of a measured run: its column, its sign relative to the motor's (0: a magnitude), and why."""

    column: str
    sign: int = 0
    sense: str = ""


MEASURED = {
    "omega_h": Measured("omega_h_rpm", -1, "the head turns against the motor"),
    "omega_t": Measured("omega_t_rpm", 1, "the tails turn with the motor"),
    "omega_yr": Measured(
        "omega_yr_rad_s", 1, "a positive motor turns the robot to the left (counter-clockwise) seen from above"
    ),
    "R_yr": Measured("R_yr_cm"),
    "theta": Measured("theta_deg"),
    "v": Measured("v_cm_s"),
}
RUN_NOTES = ("elapsed_min", "temperature_C", "tank_diameter_cm", "course_deg")
RUN_SIGMAS = ("camera_scale_sigma_percent", "heading_zero_sigma_deg", "tachometer_sigma_percent")
RUN_ERRORS = (  # of `camera.measured_runs`; not used, since repeats give the noise
    "omega_yr_error", "R_yr_error", "theta_error", "v_error", "drift_x_cm_s", "drift_y_cm_s", "drift_error",
    "omega_h_error", "omega_t_error",
)  # fmt: skip
RUN_COLUMNS = (
    *RUN, *(column for column, _, _ in MEASURED.values()), "run", "trial", "session", "robot", *RUN_NOTES,
    *RUN_ERRORS, *RUN_SIGMAS,
)  # fmt: skip
_UNITS = {output: column.removeprefix(f"{output}_") for output, (column, _, _) in MEASURED.items()}
TO_SI = {output: to_si(1.0, unit) for output, unit in _UNITS.items()}  # factor
OTHER_UNITS = {output: other_units(unit) for output, unit in _UNITS.items()}
_NEAR = 1.6  # factor between an output in another unit and what the robot does
OFF = 10 / _NEAR  # factor of an output: of what is ten times too large or too small


def convert_measured(table: pd.DataFrame, where: str) -> Converted:
    """Rename and convert the columns of a measured table, which may lack its outputs.

    Raises:
        InputError: a column is missing, misspelt or there twice.
    """
    from common.quantities import Converted, convert_columns  # loads pandas

    table, converted = convert_columns(table, RUN, where, RUN_SYNONYMS)
    for name in RUN:  # before the others: a table without them is no measured table
        if name not in table:
            raise InputError(f"the table has no column {name!r}; it needs {', '.join(RUN)}")
    outputs = (column for column, _, _ in MEASURED.values())
    table, others = convert_columns(table, (*outputs, *RUN_NOTES, *RUN_SIGMAS), where, RUN_SYNONYMS)
    for name in (str(c) for c in table if c not in RUN_COLUMNS):
        near = difflib.get_close_matches(name, [column for column in RUN_COLUMNS if column not in table], n=1)
        if near:
            raise InputError(f"unknown column {name!r}: is it {near[0]!r}? rename or drop it")
    return Converted(table, (*converted, *others))


def check_factor(output: str, factor: float, otherwise: str = "") -> None:
    """Check the ratio of an output, a name of MEASURED, to the prediction of the model as given.

    Args:
        otherwise: what else may be wrong, for the end of the message.

    Raises:
        InputError: the output seems to be in another unit.
    """
    column = MEASURED[output].column
    if unit := guess_slip(factor, OTHER_UNITS[output], _NEAR):
        raise InputError(
            f"{column} is {factor:.3g} times what the robot as given does: it seems to be in {unit}; "
            f"convert it, or correct the coefficients in robot.toml if its unit is right{otherwise}"
        )
    if not 1 / OFF < factor < OFF:
        raise InputError(
            f"{column} is {factor:.3g} times what the robot as given does; "
            f"check its unit, those of l_cm and omega_rpm, and robot.toml{otherwise}"
        )
