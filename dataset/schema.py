"""The columns of a data set: type, unit and meaning, and how reports show them; the version of what fills them.

A column is declared here and nowhere else: storage, units in the files, report, trends and the NaN of failed rows
follow from it. Its values are computed in `dataset.simulate`.

Rows that failed or whose tails touch are kept and flagged: `failed` rows have NaN outputs; the numbers of
`touching` rows come from a model without contact. `usable` rows are the ones to learn from.

A column may hold a list of numbers in each row, of one length for all rows: values on a grid, which is stored with
the field. The response to a flip consists of such lists (`sim.model.response`). In `memory_…` the values of each
preceding dwell follow each other.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa

from common.provenance import code_version
from sim.effects import effect_named
from sim.model.groups import MOTOR_SPEED, SLOPE_INPUTS, SLOPE_OUTPUTS
from sim.model.response import BEFORE, DWELLS


class Column(NamedTuple):
    """A column of a data set."""

    name: str
    type: pa.DataType
    unit: str
    meaning: str
    grid: tuple[float, ...] = ()  # of a list: the dwells at which its values are given
    before: tuple[float, ...] = ()  # of a list of lists: the preceding dwells
    inputs: tuple[str, ...] = ()  # of derivatives: the inputs to which its values belong
    label: str = ""  # on axes and in texts; default: the name
    logarithmic: bool = False  # its scale on axes and in Sobol indices
    shown: bool = False  # of an output of single numbers: the report shows what it depends on
    kept: bool = False  # of an output: failed rows keep its value

    @property
    def title(self) -> str:
        """The label, for axes."""
        return self.label or self.name

    @property
    def words(self) -> str:
        """The label without formulas, for texts."""
        return self.title.split(" $")[0]


_real, _whole, _flag = pa.float64(), pa.int32(), pa.bool_()
_slopes = pa.list_(_real, len(SLOPE_INPUTS))
_LAG = (("z", "l", "forward"), ("x", "l", "to the new turn's side"), ("psi_rad", "radian", "of the heading"))
_ROW_CODE = ("design.py", "robot_inputs.py", "schema.py", "simulate.py")  # what a row depends on, beside sim/
COST = "cost_s"  # the one column that differs when a row is simulated again


def _curve(name: str, unit: str, meaning: str, before: Sequence[float] = ()) -> Column:
    """Declare a column of values over the dwell."""
    size = len(DWELLS) * max(len(before), 1)
    return Column(name, pa.list_(pa.float32(), size), unit, meaning, tuple(DWELLS), tuple(before))


def _curves(name: str, meaning: str, before: Sequence[float] = ()) -> tuple[Column, ...]:
    """Declare the three columns of a lag."""
    return tuple(_curve(f"{name}_{axis}", unit, f"{meaning}, {what}", before) for axis, unit, what in _LAG)


INPUTS = (
    Column("C_t", _real, "1", "head's translational drag coefficient", label="$C_t$"),
    Column("C_r", _real, "1", "head's spin drag coefficient", label="$C_r$"),
    Column("C_yr", _real, "1", "head's side-force coefficient", label="$C_{yr}$"),
    Column("l_over_R", _real, "1", "tail length over head radius", label="$l/R$"),
    Column("L_over_R", _real, "1", "head length over head radius", label="$L/R$"),
    Column("l_over_r0", _real, "1", "tail length over tail section radius", label="$l/r_0$"),
    Column("omega_bar", _real, "EI/(mu0 l^4)", MOTOR_SPEED, label="$\\bar\\omega$",
           logarithmic=True),
    Column("N", _whole, "1", "number of tails", label="$N$"),
    Column("a_over_R", _real, "1", "radius of the circle of clamps over head radius", label="$a/R$"),
)  # fmt: skip
OUTPUTS = (
    Column("omega_t_bar", _real, "EI/(mu0 l^4)", "mean spin of the tails about the axis"),
    Column("omega_h_bar", _real, "EI/(mu0 l^4)", "mean spin of the head about the axis"),
    Column("omega_yr_bar", _real, "EI/(mu0 l^4)", "mean yaw rate", label="yaw rate $\\bar\\omega_{yr}$",
           logarithmic=True, shown=True),
    Column("v_x", _real, "EI/(mu0 l^3)", "mean sway of the head's centre"),
    Column("v_z", _real, "EI/(mu0 l^3)", "mean surge of the head's centre", label="surge $v_z$",
           logarithmic=True, shown=True),
    Column("R_yr_over_l", _real, "l", "radius of the circle of the head's centre", label="turn radius $R_{yr}/l$",
           logarithmic=True, shown=True),
    Column("theta_deg", _real, "degree", "angle between axis and path of the head's centre",
           label="slip angle $\\theta$ [deg]", shown=True),
    Column("tail_gap", _real, "2 r0", "smallest distance between tails; below 1 they touch", kept=True),
    Column("error", _real, "1", "estimated relative error of the steady outputs (velocities: of the speed)",
           kept=True),
    _curve("net_speed_bar", "EI/(mu0 l^3)", "net speed when the motor flips after every dwell"),
    *_curves("lag", "lag after a flip"),
    *_curves("spread", "standard deviation of the lag over the disc's phase at the flip, without the wobble"),
    *_curves("rest", "lag of a first dwell from rest; NaN without history"),
    *_curves("memory", "what a short dwell before adds to the lag; NaN without history", tuple(BEFORE)),
)  # fmt: skip
SLOPES = tuple(
    Column(f"d_{name}", _slopes, "1", f"derivatives of {name} in the inputs", inputs=SLOPE_INPUTS)
    for name in SLOPE_OUTPUTS
)
FLAGS = (
    Column("row", _whole, "1", "row of the design"),
    Column("converged", _flag, "1", "the motion is steady and solved to tolerance"),
    Column("failed", _flag, "1", "the simulation broke down; outputs are NaN"),
    Column("touching", _flag, "1", "tails touch, and no contact holds them apart: outside the model's validity"),
    Column("stepped", _flag, "1", "the response was simulated by time steps"),
    Column("history", _flag, "1", "memory and rest were simulated"),
    Column("reason", pa.string(), "1", "why the row failed, did not converge or was stepped in time; else empty"),
    Column(COST, pa.float32(), "s", "processor time: the mean of the robots that were simulated together"),
)


@cache
def rows_version() -> str:
    """Return the version of all code that a row depends on, e.g. "0.1.0+1a2b3c4d.5e6f7a8b"."""
    digest = hashlib.sha256(b"".join(Path(__file__).with_name(name).read_bytes() for name in _ROW_CODE))
    return f"{code_version()}.{digest.hexdigest()[:8]}"


def schema(effects: Iterable[str] = (), sensitivities: bool = False) -> pa.Schema:
    """Return the schema of a data set that sweeps the named effects as well, with derivatives or without."""
    found = map(effect_named, sorted(effects))
    swept = tuple(Column(effect.name, _real, effect.unit, effect.title) for effect in found)
    slopes = SLOPES if sensitivities else ()
    return pa.schema([parquet_field(column) for column in (*INPUTS, *swept, *OUTPUTS, *slopes, *FLAGS)])


def shown_outputs() -> list[Column]:
    """List the outputs of which reports show what they depend on."""
    return [column for column in OUTPUTS if column.shown]


def column_named(name: str) -> Column:
    """Return the input or output of some name; one without label and unit for an effect."""
    return next((column for column in (*INPUTS, *OUTPUTS) if column.name == name), Column(name, _real, "", ""))


def parquet_field(column: Column) -> pa.Field:
    """Return the Parquet field of a column, with unit, meaning and grid."""
    metadata = {"unit": column.unit, "meaning": column.meaning}
    if column.grid:
        metadata["grid"] = json.dumps(column.grid)
    if column.before:
        metadata["before"] = json.dumps(column.before)
    if column.inputs:
        metadata["inputs"] = json.dumps(column.inputs)
    return pa.field(column.name, column.type, nullable=False, metadata=metadata)


def arrow_table(columns: Mapping[str, Any], form: pa.Schema) -> pa.Table:
    """Make a table of columns; lists are given as arrays (rows, values)."""
    return pa.table([_array(columns[field.name], field.type) for field in form], schema=form)


def _array(values: Any, kind: pa.DataType) -> pa.Array:
    if pa.types.is_fixed_size_list(kind):
        rows = np.stack(list(values)) if len(values) else np.empty((0, kind.list_size))
        if rows.shape[1:] != (kind.list_size,):
            raise ValueError(f"lists of {kind.list_size} values expected, given {rows.shape}")
        inner = pa.array(rows.ravel(), type=kind.value_type, from_pandas=False)
        return pa.FixedSizeListArray.from_arrays(inner, type=kind)
    if pa.types.is_floating(kind):
        values = np.asarray(values, dtype=kind.to_pandas_dtype())
    return pa.array(values, type=kind, from_pandas=False)
