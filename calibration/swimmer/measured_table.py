"""Measured tables: one run a row, units in the column names.

Needed: N, l_cm, omega_rpm (tails relative to head; docs/reference/signs.md has the signs) and some of the outputs

    omega_h_rpm, omega_t_rpm, omega_yr_rad_s (signed), R_yr_cm, theta_deg, v_cm_s (of the head's centre).

Columns in other units (R_yr_mm, "theta [rad]") are converted, and `Measurements.converted` says which.

The noise is estimated from repeated conditions. Without repeats mirror runs serve (ω and −ω), and a caveat says
so; without these the noise is unknown. `session` names the group of runs that were made together. Without it, all
runs of one N are one session. `robot` names the specimen, where the table has several. Some effects need
elapsed_min, temperature_C, tank_diameter_cm or course_deg (direction of the path in the lab, where a run is part
of a circle). Rows that lack a note which nearly all others have are excluded, too. Columns without any value are
left out, and notes that many rows lack. Columns of other names are tested as groupings
(`calibration.table.between_repeats`) or left out; a name that looks like a misspelt one is refused.

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

import numpy as np
import pandas as pd

from calibration.linear.gls import repeat_count, repeat_covariance
from calibration.statistics.study import divided, middle_session
from calibration.swimmer.influences import CAMERA, HEADING, TACHOMETER
from calibration.table.between_repeats import refuse_equal_repeats, usable
from calibration.table.declared import Output
from calibration.table.excluded import COPY, Excluded
from calibration.table.reader import Declaration, TableReader, open_table
from calibration.table.runs import FEWEST_REPEATS, Runs
from common.arrays import Flags, Floats, Integers
from common.errors import InputError, naming
from common.run_columns import MEASURED, RUN, RUN_COLUMNS, RUN_NOTES, RUN_SIGMAS, TO_SI, convert_measured
from common.units import to_si

_SIGMAS = dict(  # column -> nuisance parameter, factor
    zip(RUN_SIGMAS, ((CAMERA, 0.01), (HEADING, math.pi / 180), (TACHOMETER, 0.01)), strict=True)
)
_OUTPUTS = {
    "omega_h": Output("head spin"), "omega_t": Output("tail spin"), "omega_yr": Output("yaw rate"),
    "R_yr": Output("turn radius"), "theta": Output("slip angle", unit="rad", kind="difference"),
    "v": Output("speed"),
}  # fmt: skip
_NOTED = {  # column -> note, factor
    "elapsed_min": ("elapsed_h", 1 / 60), "temperature_C": ("temperature_K", 1.0),
    "tank_diameter_cm": ("tank_diameter", 0.01),
}  # fmt: skip
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


def read_measurements(source: str | Path | pd.DataFrame, *, file: str | Path | None = None) -> Measurements:
    """Read measurements from a file (`common.tables`) or a table.

    Args:
        file: from which a `source` that is a table was read, for messages.

    Raises:
        InputError: columns are missing or misspelt, or too few runs remain.
    """
    known = source if file is None else file
    with naming(known):
        return _read(open_table(source), "the table" if isinstance(known, pd.DataFrame) else str(known))


def _read(original: pd.DataFrame, where: str) -> Measurements:
    table, converted = convert_measured(original, where)
    unknown = [str(name) for name in table if name not in RUN_COLUMNS]
    blank = table.isna() | table.apply(lambda column: column.astype(str).str.strip() == "")
    empty = [str(name) for name in table if name not in (*RUN, *unknown) and blank[name].all()]
    table = table.drop(columns=empty)
    specimen = "robot" if "robot" in table else None
    declared = Declaration(
        _measured_outputs(table, empty),
        {name: (column, TO_SI[name]) for name, (column, _, _) in MEASURED.items()},
        needed=RUN,
        session="session",
        specimen=specimen,
        kinds=dict.fromkeys((*RUN, *RUN_NOTES, *RUN_SIGMAS), float) | {"session": str, "robot": str},
        largest=_LARGEST,
        fewest=_FEWEST_RUNS,
    )
    reader = TableReader(table, declared, original)
    if "session" not in table:  # runs of one N are one
        reader.columns["session"] = np.array([f"N = {tails:.0f}" for tails in reader.columns["N"]])
    _set_aside_impossible(reader)
    sparse = _set_aside_gaps(reader)
    # Runs of different robots are no repeats, even where all settings are equal.
    known = reader.runs([*RUN, *([specimen] if specimen else [])])
    rows = known["rows"] - 1
    good = {name: values[rows] for name, values in reader.columns.items() if name not in sparse}
    factors = (1, to_si(1.0, "cm"), to_si(1.0, "rpm"))
    tails, length, omega = (good[c] * f for c, f in zip(RUN, factors, strict=True))
    noted = _noted(good)
    notes = {name: good[name] for name in unknown if usable(good[name])}
    tested = tuple(f"column {name}: not known, tested as a grouping" for name in notes)
    known["excluded"] += _unused_columns(empty, sparse, [name for name in unknown if name not in notes])
    known["output_scales"]["theta"] = (math.degrees(1.0), "°")
    inputs = [tails, np.log(length), np.log(np.abs(omega)), np.sign(omega), *noted.values()]
    data = Measurements(
        **known,
        inputs=np.stack(inputs, 1),
        input_names=("N", "ln l", "ln |omega|", "direction", *noted),
        caveats=_caveats(tails, length, omega),
        tails=tails,
        length=length,
        omega=omega,
        noted=np.stack(list(noted.values()), 1) if noted else np.empty((len(rows), 0)),
        sigmas=_sigmas(good),
        noted_names=tuple(noted),
        converted=(*converted, *tested),
        notes=notes,
    )
    return _independent(data)


def _unused_columns(empty: Sequence[str], sparse: Sequence[str], unknown: Sequence[str]) -> tuple[Excluded, ...]:
    """Say which columns are left out, without values, with few values, or not known."""
    few = f"without a value in more than {100 * _GAPS:.0f} % of the rows"
    faults = {"without any value": empty, few: sparse, "not known": unknown}.items()
    return tuple(Excluded(f"column {name}: {fault}, left out") for fault, names in faults for name in names)


def _measured_outputs(table: pd.DataFrame, empty: Sequence[str]) -> dict[str, Output]:
    """Choose the outputs of a table, if they tell the coefficients apart; `empty`: columns without any value."""
    outputs = {name: output for name, output in _OUTPUTS.items() if MEASURED[name].column in table}
    if len(outputs) < 2 or not {"omega_yr", "R_yr", "theta", "v"} & set(outputs):
        raise InputError(
            "the table needs at least two outputs, one of them omega_yr_rad_s, R_yr_cm, theta_deg or v_cm_s: "
            "the spins alone do not tell the coefficients apart"
            + (f" (without any value: {', '.join(empty)})" if empty else "")
        )
    return outputs


def _set_aside_gaps(reader: TableReader) -> list[str]:
    """Set aside every usable row that lacks a note, and return the notes that many rows lack."""
    sparse, usable = [], reader.faultless
    for column in (name for name in RUN_NOTES if name in reader.columns):
        gaps = usable & ~np.isfinite(reader.columns[column])
        if gaps.sum() > _GAPS * usable.sum():
            sparse.append(column)
        else:
            reader.set_aside_not_finite(column, gaps)
    return sparse


def _independent(data: Measurements) -> Measurements:
    """Choose outputs that were measured: there are repeats that differ, and not just as other outputs do."""
    columns, repeats = [MEASURED[name].column for name in data.outputs], repeat_count(data.repeat_ids)
    repeated = data.repeat_ids if repeats >= FEWEST_REPEATS else data.repeats()
    if (count := repeat_count(repeated)) < FEWEST_REPEATS:
        copies = sum(fault.reason == COPY for fault in data.excluded)
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
    return replace(data, excluded=excluded, caveats=caveats).with_outputs(kept)


def _sigmas(good: Mapping[str, Floats]) -> dict[str, float]:
    """Read standard deviations of the way of measuring, the same in all rows."""
    sigmas = {}
    for column, (name, factor) in _SIGMAS.items():
        if column in good:
            values = np.unique(good[column])
            if len(values) != 1 or not 0 <= values[0] * factor <= 0.5:
                raise InputError(f"{column} must be one number, the same in all rows, at least 0 and not large")
            sigmas[name] = float(values[0] * factor)
    return sigmas


def _caveats(tails: Floats, length: Floats, omega: Floats) -> tuple[str, ...]:
    """Say which inputs are the same in all runs."""
    same = {
        f"all runs have N = {tails[0]:.0f}: what depends on the number of tails cannot be found": np.ptp(tails)
        == 0,
        "all runs have one tail length: what depends on it cannot be found": np.ptp(length) == 0,
        "all runs have one motor speed: what depends on it cannot be found": (
            np.ptp(np.abs(omega)) < 0.01 * np.abs(omega).max()
        ),
    }
    return tuple(words for words, holds in same.items() if holds)


def _noted(good: Mapping[str, Floats]) -> dict[str, Floats]:
    """Read notes that differ between runs."""
    notes = {name: good[column] * scale for column, (name, scale) in _NOTED.items() if column in good}
    if "temperature_K" in notes:
        notes["temperature_K"] -= notes["temperature_K"].mean()
    notes = {name: values for name, values in notes.items() if np.ptp(values) > 0}
    if "course_deg" in good and np.ptp(course := np.radians(good["course_deg"])) > 0:
        notes |= {"course_x": np.cos(course), "course_y": np.sin(course)}
    return notes


def _set_aside_impossible(reader: TableReader) -> None:
    """Set aside rows that no robot can have."""
    table, values = reader.table, {**reader.columns, **reader.measured}
    sign = np.sign(values["omega_rpm"])
    reader.set_aside(values["N"] % 1 != 0, "N{} is not a whole number", table["N"].tolist())
    for column in (name for name in ("N", "l_cm", "R_yr_cm", "theta_deg", "v_cm_s") if name in table):
        reader.set_aside(values[column] <= 0, f"{column}{{}} is not above 0", table[column].tolist())
    reader.set_aside(sign == 0, "omega_rpm = 0")
    for column, expected, sense in (each for each in MEASURED.values() if each.sign and each.column in table):
        wrong = f"{column}{{}} has the wrong sign for its omega_rpm: {sense}"
        given = [f"{value:g}" for value in values[column]]
        reader.set_aside(values[column] * sign * expected <= 0, wrong, given)


def _paper(data: Measurements) -> tuple[Measurements, Flags]:
    outputs = ("omega_h", "omega_yr")
    missing = [n for n in outputs if n not in data.outputs]
    if missing or not {2.0, 3.0, 4.0, 5.0} <= set(data.tails.tolist()):
        raise InputError("the paper's protocol needs omega_h_rpm, omega_yr_rad_s and runs with N = 2, 3, 4 and 5")
    data = data.with_outputs([data.outputs.index(n) for n in outputs])
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
