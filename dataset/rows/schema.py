"""Columns of a data set: type, unit, meaning. Units are stored with every Parquet field.

Rows that failed or whose tails touch are kept and flagged: `failed` rows have NaN outputs; `touching` rows
have numbers of a model without contact. `usable` rows are the ones to learn from.

A column may hold a list of numbers a row, all rows equally many: values on a grid, which is stored with the field.
The response to a flip is such lists (`sim.model.response`). In `memory_…` the values of each dwell before follow
each other.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa

from sim.effects import catalogue
from sim.model.response import BEFORE, DWELLS
from sim.model.slopes import SLOPE_INPUTS, SLOPE_OUTPUTS


class Column(NamedTuple):
    name: str
    type: pa.DataType
    unit: str
    meaning: str
    grid: tuple[float, ...] = ()  # of a list: the dwells that its values are given at
    before: tuple[float, ...] = ()  # of a list of lists: the dwells before
    inputs: tuple[str, ...] = ()  # of derivatives: the inputs that its values are for


_real, _whole, _flag = pa.float64(), pa.int32(), pa.bool_()
_LAG = (("z", "l", "forward"), ("x", "l", "to the new turn's side"), ("psi_rad", "radian", "of the heading"))
COST = "cost_s"  # how long a row took: the one column that differs when the row is simulated again


def _curve(name: str, unit: str, meaning: str, before: Sequence[float] = ()) -> Column:
    """A column of values over the dwell."""
    size = len(DWELLS) * max(len(before), 1)
    return Column(name, pa.list_(pa.float32(), size), unit, meaning, tuple(DWELLS), tuple(before))


def _curves(name: str, meaning: str, before: Sequence[float] = ()) -> tuple[Column, ...]:
    """The three columns of a lag."""
    return tuple(_curve(f"{name}_{axis}", unit, f"{meaning}, {what}", before) for axis, unit, what in _LAG)


INPUTS = (
    Column("C_t", _real, "1", "head's translational drag coefficient"),
    Column("C_r", _real, "1", "head's spin drag coefficient"),
    Column("C_yr", _real, "1", "head's side-force coefficient"),
    Column("l_over_R", _real, "1", "tail length over head radius"),
    Column("L_over_R", _real, "1", "head length over head radius"),
    Column("l_over_r0", _real, "1", "tail length over tail section radius"),
    Column("omega_bar", _real, "EI/(mu0 l^4)", "motor speed, head relative to tails"),
    Column("N", _whole, "1", "number of tails"),
    Column("a_over_R", _real, "1", "radius of the circle of clamps over head radius"),
)
OUTPUTS = (
    Column("omega_t_bar", _real, "EI/(mu0 l^4)", "mean spin of the tails about the axis"),
    Column("omega_h_bar", _real, "EI/(mu0 l^4)", "mean spin of the head about the axis"),
    Column("omega_yr_bar", _real, "EI/(mu0 l^4)", "mean yaw rate"),
    Column("v_x", _real, "EI/(mu0 l^3)", "mean sway of the head's centre"),
    Column("v_z", _real, "EI/(mu0 l^3)", "mean surge of the head's centre"),
    Column("R_yr_over_l", _real, "l", "radius of the circle of the head's centre"),
    Column("theta_deg", _real, "degree", "angle between axis and path of the head's centre"),
    Column("tail_gap", _real, "2 r0", "smallest distance between tails; below 1 they touch"),
    Column("error", _real, "1", "estimated relative error of the steady outputs (velocities: of the speed)"),
    _curve("net_speed_bar", "EI/(mu0 l^3)", "net speed when the motor flips after every dwell"),
    *_curves("lag", "lag after a flip"),
    *_curves("spread", "standard deviation of the lag over the disc's phase at the flip"),
    *_curves("rest", "lag of a first dwell from rest; NaN without history"),
    *_curves("memory", "what a short dwell before adds to the lag; NaN without history", tuple(BEFORE)),
)
SLOPES = tuple(
    Column(
        f"d_{name}",
        pa.list_(_real, len(SLOPE_INPUTS)),
        "1",
        f"derivatives of {name} in the inputs",
        (),
        (),
        SLOPE_INPUTS,
    )
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
    Column(COST, pa.float32(), "s", "processor time that the row took"),
)


def schema(effects: Iterable[str] = (), sensitivities: bool = False) -> pa.Schema:
    """Schema of a data set that sweeps the named effects as well, with derivatives or without."""
    extra = tuple(Column(name, _real, catalogue()[name].unit, catalogue()[name].title) for name in sorted(effects))
    slopes = SLOPES if sensitivities else ()
    return pa.schema([field_of(column) for column in (*INPUTS, *extra, *OUTPUTS, *slopes, *FLAGS)])


def field_of(column: Column) -> pa.Field:
    """The Parquet field of a column, with unit, meaning and grid."""
    words = {"unit": column.unit, "meaning": column.meaning}
    if column.grid:
        words["grid"] = json.dumps(column.grid)
    if column.before:
        words["before"] = json.dumps(column.before)
    if column.inputs:
        words["inputs"] = json.dumps(column.inputs)
    return pa.field(column.name, column.type, nullable=False, metadata=words)


def table_of(columns: Mapping[str, Any], form: pa.Schema) -> pa.Table:
    """The columns as a table; lists are given as arrays (rows, values)."""
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
