"""Columns of a data set: type, unit, meaning. Units are stored with every Parquet field.

Rows that failed or whose tails touch are kept and flagged: `failed` rows have NaN outputs; `touching` rows
have numbers of a model without contact. `usable` rows are the ones to learn from.

A column may hold a list of numbers a row, all rows equally many: values on a grid, which is stored with the field.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa

from sim.effects import catalogue


class Column(NamedTuple):
    name: str
    type: pa.DataType
    unit: str
    meaning: str
    grid: tuple[float, ...] = ()  # of a list: what its values are given at


_real, _whole, _flag = pa.float64(), pa.int32(), pa.bool_()
COST = "cost_s"  # how long a row took: the one column that differs when the row is simulated again

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
    Column("dwell_bar", _real, "mu0 l^4/EI", "switching half-period"),
)
OUTPUTS = (
    Column("omega_t_bar", _real, "EI/(mu0 l^4)", "mean spin of the tails about the axis"),
    Column("omega_h_bar", _real, "EI/(mu0 l^4)", "mean spin of the head about the axis"),
    Column("omega_yr_bar", _real, "EI/(mu0 l^4)", "mean yaw rate"),
    Column("v_x", _real, "EI/(mu0 l^3)", "mean sway of the head's centre"),
    Column("v_z", _real, "EI/(mu0 l^3)", "mean surge of the head's centre"),
    Column("R_yr_over_l", _real, "l", "radius of the circle of the head's centre"),
    Column("theta_deg", _real, "degree", "angle between axis and path of the head's centre"),
    Column("net_speed_bar", _real, "EI/(mu0 l^3)", "net speed when the motor flips every dwell_bar"),
    Column("lag_psi_rad", _real, "radian", "response to a switch: heading offset after dwell_bar"),
    Column("lag_x", _real, "l", "response to a switch: offset to the new turn's side"),
    Column("lag_z", _real, "l", "response to a switch: offset forward"),
    Column("tail_gap", _real, "2 r0", "smallest distance between tails; below 1 they touch"),
    Column("error", _real, "1", "estimated relative error of the steady outputs (velocities: of the speed)"),
)
FLAGS = (
    Column("row", _whole, "1", "row of the design"),
    Column("converged", _flag, "1", "the motion is steady and solved to tolerance"),
    Column("failed", _flag, "1", "the simulation broke down; outputs are NaN"),
    Column("touching", _flag, "1", "tails touch: outside the model's validity"),
    Column("edges", _whole, "1", "edges a tail in the response to a switch"),
    Column("steps", _whole, "1", "time steps a motor revolution in the response to a switch"),
    Column("reason", pa.string(), "1", "why the row failed, did not converge or was stepped in time; else empty"),
    Column(COST, pa.float32(), "s", "processor time that the row took"),
)


def schema(effects: Iterable[str] = ()) -> pa.Schema:
    """Schema of a data set that sweeps the named effects as well."""
    extra = tuple(Column(name, _real, catalogue()[name].unit, catalogue()[name].title) for name in sorted(effects))
    return pa.schema([field_of(column) for column in (*INPUTS, *extra, *OUTPUTS, *FLAGS)])


def field_of(column: Column) -> pa.Field:
    """The Parquet field of a column, with unit, meaning and grid."""
    words = {"unit": column.unit, "meaning": column.meaning}
    if column.grid:
        words["grid"] = json.dumps(column.grid)
    return pa.field(column.name, column.type, nullable=False, metadata=words)


def table_of(columns: Mapping[str, Any], form: pa.Schema) -> pa.Table:
    """The columns as a table; lists are given as arrays (rows, values)."""
    return pa.table([_array(columns[field.name], field.type) for field in form], schema=form)


def _array(values: Any, kind: pa.DataType) -> pa.Array:
    if pa.types.is_fixed_size_list(kind):
        rows = np.ascontiguousarray(values)
        if rows.shape[1:] != (kind.list_size,):
            raise ValueError(f"lists of {kind.list_size} values expected, given {rows.shape}")
        inner = pa.array(rows.ravel(), type=kind.value_type, from_pandas=False)
        return pa.FixedSizeListArray.from_arrays(inner, type=kind)
    if pa.types.is_floating(kind):
        values = np.asarray(values, dtype=kind.to_pandas_dtype())
    return pa.array(values, type=kind, from_pandas=False)
