"""Measured tables: one run a row, units in the column names.

Needed: N, l_cm, omega_rpm (tails relative to head; docs/reference/signs.md has the signs) and some of the outputs

    omega_h_rpm, omega_t_rpm, omega_yr_rad_s (signed), R_yr_cm, theta_deg, v_cm_s (of the head's centre).

Columns in other units (R_yr_mm, "theta [rad]") are converted, and `Measurements.converted` says which.

The noise is estimated from repeated conditions. Without repeats mirror runs serve (ω and −ω), and a caveat says
so; without these the noise is unknown. `session` names the group of runs that were made together. Without it, all
runs of one N are one session. `robot` names the specimen, where the table has several. Some effects need
elapsed_min, temperature_C, tank_diameter_cm or course_deg (direction of the path in the lab, where a run is part
of a circle). Rows that cannot be used are excluded with number and reason, and so are copies of rows
(`calibration.table.excluded`), and rows that lack a note which nearly all others have. A row that lacks some
outputs counts with the others (`calibration.table.gaps`). Columns without any value are left out, and notes
that many rows lack. Columns of other names are tested as groupings (`calibration.table.between_repeats`) or
left out; a name that looks like a misspelt one is refused.

Observations are compared on a relative scale: y = ln |output| for spins, yaw rate and radius, and θ in radians. A
row with a wrong sign is a bad row, because the direction of the motor determines all signs
(docs/reference/signs.md).

Which runs are fitted and which are held out for the test is fixed before the data is looked at:

session   one whole session is held out, the middle one by name, so that no extrapolation is needed;
paper     as in the paper: C_t, C_r, C_yr from ω_h and ω_yr of the robots with 3 and 4 tails, prediction for 2 and
          5 tails. The errors of the paper's predictions are 14.8 % and 10 %.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from calibration.linear.gls import repeat_count, repeat_covariance
from calibration.statistics.study import divided, middle_session
from calibration.swimmer.influences import CAMERA, HEADING, TACHOMETER
from calibration.table.between_repeats import usable
from calibration.table.checks import refuse_equal_repeats
from calibration.table.excluded import COPY, Excluded, Faults
from calibration.table.gaps import filled, gaps_in_words, with_outputs, without_gaps
from calibration.table.runs import FEWEST_REPEATS, Runs
from common.arrays import Flags, Floats, Integers
from common.errors import InputError, naming
from common.quantities import numbers_of
from common.run_columns import (
    MEASURED,
    OUTPUTS,
    RUN,
    RUN_COLUMNS,
    RUN_NOTES,
    RUN_SIGMAS,
    convert_measured,
)
from common.tables import LINE, read_table
from common.units import to_si

_SIGMAS = dict(  # column -> nuisance parameter, factor
    zip(RUN_SIGMAS, ((CAMERA, 0.01), (HEADING, math.pi / 180), (TACHOMETER, 0.01)), strict=True)
)
_TITLES = {
    "omega_h": "head spin",
    "omega_t": "tail spin",
    "omega_yr": "yaw rate",
    "R_yr": "turn radius",
    "theta": "slip angle",
    "v": "speed",
}
_LARGEST = 1e9  # of a value
_FEWEST_RUNS = 24
_GAPS = 0.1  # share of the usable rows that may lack a note
_OWN = 1e-3  # share of an output's scatter that must be independent of the other outputs


@dataclass(frozen=True)
class Measurements(Runs):
    """Usable runs of a table of swimming robots."""

    tails: Floats  # (n,) N
    length: Floats  # (n,) tail length [m]
    omega: Floats  # (n,) motor speed, signed [rad/s]
    noted: Floats  # (n, c) what was noted and differs between the runs, by `noted_names`
    sigmas: Mapping[str, float]  # σ of camera scale, zero of the heading [rad] and tachometer, where stated
    noted_names: tuple[str, ...]  # elapsed_h, temperature_K (above the mean), tank_diameter, course_x, course_y
    converted: tuple[str, ...]  # columns that were renamed, converted, or are tested as groupings, in words

    @property
    def subject(self) -> str:
        return "robot"

    def nearer(self, used: Flags) -> list[Flags]:
        """Choose the runs (n,) with short tails, up to the median, and few of them, the three smallest numbers."""
        kinds, lengths = np.unique(self.tails[used]), self.length.round(9)
        few = self.tails <= kinds[min(3, len(kinds)) - 1]
        return [used & few & (lengths <= np.median(np.unique(lengths[used])))]

    @property
    def noted_of_repeats(self) -> Floats:
        """Temperature and course, by which a current acts on the speed, as its share, and on the slip angle."""
        noted = dict(zip(self.noted_names, self.noted.T, strict=True))
        columns = [noted["temperature_K"]] if "temperature_K" in noted else []
        if "course_x" in noted:
            slow, side = np.abs(self.omega).mean() / np.abs(self.omega), np.sign(self.omega)
            x, y = noted["course_x"] * slow, noted["course_y"] * slow
            columns += [x, y, x * side, y * side]
        return np.stack(columns, 1) if columns else np.empty((len(self), 0))

    @property
    def identities(self) -> dict[str, Floats]:
        """The tails turn relative to the head as the motor does; speed is radius times yaw rate."""
        known = np.where(self.gaps, np.nan, self.y)
        of = dict(zip(self.outputs, known.T, strict=True))
        found = {}
        if {"omega_h", "omega_t"} <= set(of):
            relative = np.exp(of["omega_t"]) + np.exp(of["omega_h"])
            found["(ω_t − ω_h)/ω"] = np.log(relative / np.abs(self.omega))
        if {"v", "R_yr", "omega_yr"} <= set(of):
            found["v/(R ω_yr)"] = of["v"] - of["R_yr"] - of["omega_yr"]
        return found

    @property
    def mirrored(self) -> tuple[Integers, Floats]:
        """Number the runs by N, length and speed, (n,), and return the direction of the motor, (n,)."""
        settings = np.column_stack([self.tails, self.length, np.abs(self.omega)]).round(9)
        return np.unique(settings, axis=0, return_inverse=True)[1].reshape(-1), np.sign(self.omega)

    @property
    def partners(self) -> Floats:
        """Numbers of tails and lengths; speeds are interpolated."""
        return np.stack([self.tails, self.length], 1)

    @property
    def settings(self) -> dict[str, tuple[Floats, str]]:
        """Numbers of tails, lengths and speeds of the runs."""
        speed = np.abs(self.omega) * 30 / math.pi
        return {"N": (self.tails, ""), "tail length": (100 * self.length, " cm"), "motor speed": (speed, " rpm")}

    @property
    def drawn(self) -> tuple[str, tuple[str, Integers, tuple[str, ...]]]:
        """The tail length, and the number of tails in colour."""
        tails, kind = np.unique(self.tails, return_inverse=True)
        return "tail length", ("N", kind.reshape(-1), tuple(f"N = {n:.0f}" for n in tails))


def read_measurements(source: str | Path | pd.DataFrame) -> Measurements:
    """Read measurements from a file (`common.tables`) or a table.

    Raises:
        InputError: columns are missing or misspelt, or too few runs remain.
    """
    with naming(source):
        return _read(source)


def _read(source: str | Path | pd.DataFrame) -> Measurements:
    table, where = (source, "the table") if isinstance(source, pd.DataFrame) else (read_table(source), str(source))
    header = (table.astype(str) == [str(name) for name in table]).all(axis=1).to_numpy()
    table, converted = convert_measured(table, where)
    unknown = [str(c) for c in table if c not in RUN_COLUMNS]
    empty = [str(c) for c in table if c not in (*RUN, *unknown) and _is_empty(table[c])]
    table = table.drop(columns=empty)
    outputs = _measured_outputs(table, empty)
    numbers = table.drop(columns=["session", "robot"], errors="ignore").apply(numbers_of)
    missing = table[[OUTPUTS[name][0] for name in outputs]].isna()
    faults = _faults(table, numbers, outputs, header, missing)
    sparse = _add_gaps(faults, numbers)
    faults.add_copies(numbers[list(RUN)].to_numpy(), numbers[[*missing]].to_numpy())
    keep, aside = faults.usable, faults.in_order
    good = numbers[keep].drop(columns=sparse)
    if len(good) < _FEWEST_RUNS:
        first = f" ({aside[0]})" if aside else ""
        raise InputError(f"{len(good)} usable runs{first}; a calibration needs at least {_FEWEST_RUNS}")
    # Runs of different robots are no repeats, even where all settings are equal.
    robots = table.loc[keep, "robot"].astype(str).to_numpy() if "robot" in table else np.full(len(good), "")
    robot_names, robot = np.unique(robots, return_inverse=True)
    condition: Integers = np.asarray(good.groupby([*RUN, robot], sort=True).ngroup(), dtype=np.int64)
    session_names, session = np.unique(_sessions(table[keep], good), return_inverse=True)
    factors = (1, to_si(1.0, "cm"), to_si(1.0, "rpm"))
    tails, length, omega = (good[c].to_numpy(dtype=float) * f for c, f in zip(RUN, factors, strict=True))
    noted = _noted(good)
    notes = _notes(table.loc[keep, unknown])
    tested = tuple(f"column {name}: not known, tested as a grouping" for name in notes)
    unknown = [name for name in unknown if name not in notes]
    inputs = [tails, np.log(length), np.log(np.abs(omega)), np.sign(omega), *noted.values()]
    data = Measurements(
        outputs=outputs,
        y=filled(_outputs_to_fit(good, outputs), condition),
        condition=condition,
        session=session,
        session_names=tuple(str(n) for n in session_names),
        inputs=np.stack(inputs, 1),
        input_names=("N", "ln l", "ln |omega|", "direction", *noted),
        rows=np.flatnonzero(keep) + 1,
        excluded=(
            *aside,
            *gaps_in_words(table, missing & keep[:, None]),
            *_unused_columns(empty, sparse, unknown),
        ),
        caveats=_caveats(tails, length, omega),
        completion=without_gaps(missing.to_numpy()[keep]),
        specimen=robot if "robot" in table else None,
        specimen_names=tuple(map(str, robot_names)) if "robot" in table else (),
        tails=tails,
        length=length,
        omega=omega,
        noted=np.stack(list(noted.values()), 1) if noted else np.empty((len(good), 0)),
        sigmas=_sigmas(good),
        noted_names=tuple(noted),
        output_titles=_TITLES,
        output_scales={"theta": (math.degrees(1.0), "°")},
        converted=(*converted, *tested),
        notes=notes,
        lines=good.index.to_numpy() if good.index.name == LINE else None,
    )
    return _independent(data, sum(fault.reason == COPY for fault in aside))


def _unused_columns(empty: Sequence[str], sparse: Sequence[str], unknown: Sequence[str]) -> list[Excluded]:
    """Say which columns are left out, without values, with few values, or not known."""
    few = f"without a value in more than {100 * _GAPS:.0f} % of the rows"
    faults = {"without any value": empty, few: sparse, "not known": unknown}
    return [Excluded(f"column {name}: {fault}, left out") for fault, names in faults.items() for name in names]


def _measured_outputs(table: pd.DataFrame, empty: Sequence[str]) -> tuple[str, ...]:
    """Name the outputs of a table, if they tell the coefficients apart; `empty` are columns without any value."""
    outputs = tuple(name for name, (column, _, _) in OUTPUTS.items() if column in table)
    if len(outputs) < 2 or not {"omega_yr", "R_yr", "theta", "v"} & set(outputs):
        raise InputError(
            "the table needs at least two outputs, one of them omega_yr_rad_s, R_yr_cm, theta_deg or v_cm_s: "
            "the spins alone do not tell the coefficients apart"
            + (f" (without any value: {', '.join(empty)})" if empty else "")
        )
    return outputs


def _sessions(table: pd.DataFrame, numbers: pd.DataFrame) -> Any:
    """Name the session of each usable run, (n,): where the table has no column, runs of one N are one."""
    if "session" in table:
        return table["session"].astype(str).to_numpy(dtype=str)
    return ("N = " + numbers["N"].astype(int).astype(str)).to_numpy(dtype=str)


def _outputs_to_fit(numbers: pd.DataFrame, outputs: Sequence[str]) -> pd.DataFrame:
    """Return the outputs as they are fitted, (n, k): θ in rad, logarithms of all others in SI units."""
    values = {name: numbers[OUTPUTS[name][0]] * OUTPUTS[name][1] for name in outputs}
    return pd.DataFrame({name: v if name == "theta" else np.log(np.abs(v)) for name, v in values.items()})


def _is_empty(column: pd.Series) -> bool:
    """Tell whether a column has nothing but missing values and blanks."""
    return bool((column.isna() | (column.astype(str).str.strip() == "")).all())


def _add_gaps(faults: Faults, numbers: pd.DataFrame) -> list[str]:
    """Add every usable row that lacks a note, and return the notes that many rows lack."""
    sparse, usable = [], faults.usable
    for column in (name for name in RUN_NOTES if name in numbers):
        gaps = usable & ~np.isfinite(numbers[column].to_numpy())
        if gaps.sum() > _GAPS * usable.sum():
            sparse.append(column)
        else:
            faults.add_not_finite(column, gaps)
    return sparse


def _independent(data: Measurements, copies: int) -> Measurements:
    """Choose outputs that were measured: there are repeats that differ, and not just as other outputs do."""
    columns, repeats = [OUTPUTS[name][0] for name in data.outputs], repeat_count(data.apart)
    repeated = data.apart if repeats >= FEWEST_REPEATS else data.repeats()
    if (count := repeat_count(repeated)) < FEWEST_REPEATS:
        without = f", without {copies} copies of rows" if copies else ""
        raise InputError(
            f"{repeats} repeated runs{without}, too few to estimate the noise; give at least {FEWEST_REPEATS}, or "
            "runs with both directions of the motor"
        )
    caveats = data.caveats
    if repeats < FEWEST_REPEATS and data.repeated(slice(None)):
        caveat = f"{repeats} repeated runs: the noise is estimated from what differs between mirror runs"
        caveats += (f"{caveat} ({count} degrees of freedom)",)
    refuse_equal_repeats(data, repeated, columns)
    run = repeat_covariance(data.y, repeated)
    kept: list[int] = []
    follows = []
    for i in range(len(columns)):
        covariance = run[np.ix_(kept, kept)]
        remainder = run[i, i] - run[i, kept] @ np.linalg.solve(covariance, run[kept, i]) if kept else run[i, i]
        if remainder < _OWN * run[i, i]:
            others = ", ".join(columns[j] for j in kept)
            follows.append(Excluded(f"column {columns[i]}: follows from {others}, so it is not counted twice"))
        else:
            kept.append(i)
    excluded = (*data.excluded, *follows)
    return with_outputs(replace(data, excluded=excluded, caveats=caveats), kept)


def _sigmas(good: pd.DataFrame) -> dict[str, float]:
    """Read standard deviations of the way of measuring, the same in all rows."""
    sigmas = {}
    for column, (name, factor) in _SIGMAS.items():
        if column in good:
            values = np.unique(good[column].to_numpy(dtype=float))
            if len(values) != 1 or not 0 <= values[0] * factor <= 0.5:
                raise InputError(f"{column} must be one number, the same in all rows, at least 0 and not large")
            sigmas[name] = float(values[0] * factor)
    return sigmas


def _caveats(tails: Floats, length: Floats, omega: Floats) -> tuple[str, ...]:
    """Say which inputs are the same in all runs."""
    caveats = []
    if np.ptp(tails) == 0:
        caveats.append(f"all runs have N = {tails[0]:.0f}: what depends on the number of tails cannot be found")
    if np.ptp(length) == 0:
        caveats.append("all runs have one tail length: what depends on it cannot be found")
    if np.ptp(np.abs(omega)) < 0.01 * np.abs(omega).max():
        caveats.append("all runs have one motor speed: what depends on it cannot be found")
    return tuple(caveats)


def _noted(good: pd.DataFrame) -> dict[str, Floats]:
    """Read notes that differ between runs."""
    notes = {}
    for column, (name, scale) in {
        "elapsed_min": ("elapsed_h", 1 / 60),
        "temperature_C": ("temperature_K", 1.0),
        "tank_diameter_cm": ("tank_diameter", 0.01),
    }.items():
        if column in good:
            value = good[column].to_numpy(dtype=float) * scale
            if np.ptp(value) > 0:
                notes[name] = value - value.mean() if name == "temperature_K" else value
    if "course_deg" in good:
        value = np.radians(good["course_deg"].to_numpy(dtype=float))
        if np.ptp(value) > 0:
            notes["course_x"], notes["course_y"] = np.cos(value), np.sin(value)
    return notes


def _notes(unknown: pd.DataFrame) -> dict[str, Any]:
    """Read the columns that no model knows and that can be tested: as numbers where all their values are such."""
    notes: dict[str, Any] = {}
    for name, column in unknown.items():
        words = column.where(column.notna(), "").astype(str).str.strip()
        numbers = numbers_of(column)
        values = numbers if np.isfinite(numbers[words != ""]).all() else words
        if usable(values.to_numpy()):
            notes[str(name)] = values.to_numpy()
    return notes


def _faults(
    table: pd.DataFrame, numbers: pd.DataFrame, outputs: tuple[str, ...], header: Flags, missing: pd.DataFrame
) -> Faults:
    """Say why rows cannot be used; those of `header` (n,) are the header again."""
    faults = Faults(table)
    faults.add(header, "the header again")
    faults.add(missing.all(axis=1), "no output has a value")
    used = (*RUN, *missing)
    values = {column: numbers[column].where(numbers[column].abs() < _LARGEST).to_numpy() for column in used}
    for column, value in values.items():
        faults.add_not_finite(column, ~(np.isfinite(value) | missing.get(column, False)))
    faults.add(values["N"] % 1 != 0, "N{} is not a whole number", table["N"].tolist())
    for column in ("N", "l_cm", "R_yr_cm", "theta_deg", "v_cm_s"):
        if column in values:
            faults.add(values[column] <= 0, f"{column}{{}} is not above 0", table[column].tolist())
    sign = np.sign(values["omega_rpm"])
    faults.add(sign == 0, "omega_rpm = 0")
    for name in outputs:
        column, _, expected = OUTPUTS[name]
        if expected:
            wrong = f"{column}{{}} has the wrong sign for its omega_rpm: {MEASURED[name].sense}"
            faults.add(values[column] * sign * expected <= 0, wrong, [f"{value:g}" for value in values[column]])
    return faults


def _paper(data: Measurements) -> tuple[Measurements, Flags]:
    outputs = ("omega_h", "omega_yr")
    missing = [n for n in outputs if n not in data.outputs]
    if missing or not {2.0, 3.0, 4.0, 5.0} <= set(data.tails.tolist()):
        raise InputError("the paper's protocol needs omega_h_rpm, omega_yr_rad_s and runs with N = 2, 3, 4 and 5")
    data = with_outputs(data, [data.outputs.index(n) for n in outputs])
    held_out = ~np.isin(data.tails, (3, 4))
    if divided(data, held_out):
        raise InputError(
            "a session has runs with N = 3 or 4 and with N = 2 or 5; the paper's protocol would split it"
        )
    return data, np.asarray(held_out)


PROTOCOLS: dict[str, Callable[[Measurements], tuple[Measurements, Flags]]] = {
    "session": lambda data: (data, middle_session(data)),
    "paper": _paper,
}
