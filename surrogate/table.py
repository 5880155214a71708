"""The look-up table: the tails' wrench is learned, and the head's balance is solved at each query.

A query finds the motion in which the tails' mean wrench (`surrogate.motions`) is in balance with head, disc and
motor (`surrogate.tails`). So it answers for every head, every number of tails and every effect on head, disc and
motor. Its response to a flip comes from learned curves (`surrogate.response`). Every output can have an interval
(`surrogate.intervals`).

Rejected, or flagged on request: robots outside the joint support of the training data (`surrogate.domain`), and
robots that yaw more than MAX_YAW_SHARE times as fast as their tails turn, which may have several motions. Effects
on the tails themselves are always rejected. The table does not extrapolate.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from common.arrays import Floats
from common.errors import InputError
from common.notebook import Shown, given_axes
from sim.effects import catalogue, effect_named
from sim.inputs import check_columns
from sim.model.groups import DWELL, checked_values
from sim.model.response import DWELLS, Responses
from sim.motion.steady_motion import STEADY_OUTPUTS, net_speeds, twists
from surrogate.domain import INSIDE, NO_RESPONSE, NOT_LEARNED, ROBOT, Support, reason_of
from surrogate.error_modes import CURVE_ERRORS, NORMAL_90, STEADY, CurveErrors, error_modes, joined
from surrogate.held_out import OUTPUTS, RELATIVE, certified_error, error_scale
from surrogate.interface import NOTE, ErrorModes, OutsideError
from surrogate.intervals import Intervals
from surrogate.motions import (
    SPREAD,
    TINY_SPREAD,
    Motions,
    WrenchTable,
    motions_of,
    network_index,
    rows_by_network,
)
from surrogate.network import Ensemble
from surrogate.response import ResponseTable, flip_inputs
from surrogate.tails import (
    PLACES,
    motion_sensitivity,
    needs_no_learning,
    network_inputs,
    packed_robots,
    unpack_robots,
    wrench_slopes,
)
from surrogate.tensor_file import digest, write

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

FORMAT = 9  # of model files
OUTSIDE, CERTIFIED = "outside", "certified_error"  # columns of an answer
_MIN_DWELL = DWELLS[0] * (1 - 1e-9)
_DIFFERENCE = 1e-4  # of an input, relative, for derivatives
_OF_TAILS = ("omega_bar", "l_over_R", "l_over_r0", "a_over_R")


@dataclass(frozen=True, repr=False)
class NeuralTable(Shown):
    """A trained table with its domain, its intervals and its held-out errors."""

    tails: WrenchTable
    curves: ResponseTable
    support: tuple[Support | None, ...]  # for each of the classes of `surrogate.motions`
    intervals: Intervals | None
    ranges: dict[str, tuple[float, float]]  # of the robots that were learned, by input
    errors: dict[str, dict[str, float]]  # output -> held-out error, see `surrogate.held_out`
    provenance: dict[str, Any]
    curve_errors: CurveErrors | None = None  # of the response; None: only the sizes in `errors` are known

    @property
    def domain(self) -> dict[str, tuple[float, float]]:
        """Range of every input among the learned robots, and of the effects that need no learning.

        What is refused is decided by the joint support, not by these ranges.
        """
        effects = {name: effect.bounds for name, effect in catalogue().items() if needs_no_learning(name)}
        return {**self.ranges, **effects}

    @property
    def identity(self) -> str:
        """Hash of all numbers."""
        return digest(table_content(self))[:16]

    def query(
        self,
        columns: Mapping[str, Floats],
        *,
        intervals: bool = False,
        flag: bool = False,
        certify: bool = False,
        mark: bool = False,
    ) -> dict[str, Any]:
        """Predict outputs, each (M,); with a column `dwell_bar` also RESPONSE_OUTPUTS for equal dwells.

        Args:
            columns: robots by column name, each (M,).
            intervals: add `<name>_low` and `<name>_high`, which hold the simulator's value in 90 of 100 cases.
            flag: answer for robots outside the domain as well; the column OUTSIDE says which.
            certify: simulate each robot as well; the column CERTIFIED is the largest relative error of the spins,
                the yaw rate and the velocities (these relative to the speed), with the simulator's own error.
            mark: refuse only if no robot is inside; the column NOTE says why a robot is outside, and its numbers
                are NaN unless such robots are flagged.

        Raises:
            InputError: a robot that cannot be, or one outside the domain.
        """
        values = check_columns({name: array for name, array in columns.items() if name != DWELL})
        motions = self.solve(values)
        result = dict(motions.steady)
        if DWELL in columns:
            _check_flips(values)
            dwells, wrong = _checked_dwells(columns[DWELL])
            if wrong:  # a robot outside is refused before a dwell is
                self._check_known(values, motions, flag=flag, mark=mark)
                raise InputError(wrong)
            self.curves.put_flips(motions, np.broadcast_to(dwells, values["N"].shape))
            result = dict(zip(OUTPUTS, motions.outputs, strict=True))
        self._check_known(values, motions, flag=flag, mark=mark)
        if intervals:
            result |= self._ends(motions, result)
        if flag:
            result[OUTSIDE] = motions.outside != INSIDE
        if certify:
            result[CERTIFIED] = certified_error(values, result)
        if mark:
            rows = np.flatnonzero(motions.outside)
            for column in result.values() if not flag else ():
                column[rows] = np.nan
            result[NOTE] = np.full(len(motions.outside), "", dtype=object)
            result[NOTE][rows] = [self._why(values, motions, row) for row in rows.tolist()]
        return result

    @np.errstate(all="ignore")
    def response(self, columns: Mapping[str, Floats], *, flag: bool = False) -> Responses:
        """Return the response to a flip of the motor, see `surrogate.interface.LookupTable.response`.

        Raises:
            InputError: a robot that cannot be, one outside the domain, or one whose left and right turns differ.
        """
        values = check_columns(columns)
        _check_flips(values)
        motions = self.solve(values)
        curves = self.curves.curves(motions.robots, motions.motion, motions.inputs)
        unknown = ~np.isfinite(curves["lag"]).all((1, 2)) & (motions.outside == INSIDE)
        motions.outside[unknown] = NO_RESPONSE
        self._check_known(values, motions, flag=flag)
        steady, sense = motions.steady, motions.robots[:, PLACES.sense]
        twist = twists(steady["v_z"], steady["v_x"], steady["omega_yr_bar"], sense)
        speed = net_speeds(twist, curves["lag"], curves["memory"])
        none = np.zeros(len(speed), dtype=bool)
        return Responses(**curves, net_speed=speed, failed=none, stepped=none)

    def error_modes(self, columns: Mapping[str, Floats]) -> ErrorModes:
        """Return the errors of motion and response at one robot; see `LookupTable.error_modes`."""
        values = check_columns({name: np.asarray(values)[:1] for name, values in columns.items()})
        motions = self.solve(values)
        self._check_known(values, motions)
        motion = {name: float(values[0]) for name, values in motions.steady.items()}
        if self.intervals is None or self.curve_errors is None:
            return error_modes(self.errors, motion)
        ends = self._ends(motions, motions.steady)
        sizes = [float(ends[f"{name}_high"][0] - ends[f"{name}_low"][0]) / (2 * NORMAL_90) for name in STEADY]
        _, speeds = flip_inputs(motions.robots, motions.motion, motions.inputs)
        curves = self.curve_errors.modes(self.width_features(motions), speeds)
        own = [self.curve_errors.simulator * float(error_scale(name, motion)) for name in STEADY]
        return joined(np.diag(np.hypot(sizes, own)), curves)

    @np.errstate(all="ignore")  # the gap of one tail is infinite
    def derivatives(
        self, columns: Mapping[str, Floats], parameters: Sequence[str] = (), *, flag: bool = False
    ) -> dict[str, dict[str, Floats]]:
        """Return ∂(output)/∂(parameter) of the outputs of `query`, by output and parameter, each (M,).

        By central differences of the table, with an error of about 1e-7 of the derivative.

        Args:
            columns: robots by column name, each (M,), with `dwell_bar` or without.
            parameters: names of groups, without N, of effects on the head, or `dwell_bar`; by default all groups.
            flag: answer outside the domain as well.

        Raises:
            InputError: a robot that cannot be, one outside the domain, or a parameter without derivatives.
        """
        parameters = list(parameters) or [name for name in ROBOT if name != "N"]
        for name in parameters:
            if (
                name == "N"
                or name not in (*ROBOT, DWELL, *catalogue())
                or (name == DWELL and DWELL not in columns)
            ):
                raise InputError(f"{name} is no input with derivatives; give groups without N, or effects")
        given = {name: np.asarray(values, dtype=float) for name, values in columns.items()}
        if not flag:
            self.query(given)  # refuses what is outside
        count = len(given["N"])
        nulls = {name: np.full(count, 1.0 if name == "a_over_R" else 0.0) for name in parameters}
        repeated = {name: np.tile(values, 2 * len(parameters)) for name, values in {**nulls, **given}.items()}
        widths = {}
        for k, name in enumerate(parameters):
            value = repeated[name][:count]
            widths[name] = _DIFFERENCE * np.where(value == 0, 1.0, np.abs(value))
            repeated[name][2 * k * count : (2 * k + 1) * count] += widths[name]
            repeated[name][(2 * k + 1) * count : (2 * k + 2) * count] -= widths[name]
        values = checked_values({name: array for name, array in repeated.items() if name != DWELL})
        motions = self.solve(values)
        if DWELL in repeated:
            self.curves.put_flips(motions, repeated[DWELL])
        answers = dict(zip(OUTPUTS if DWELL in repeated else STEADY_OUTPUTS, motions.outputs, strict=False))
        slopes: dict[str, dict[str, Floats]] = {}
        for output, values in answers.items():
            pairs = values.reshape(len(parameters), 2, count)
            changes = zip(parameters, pairs[:, 0] - pairs[:, 1], strict=True)
            slopes[output] = {name: change / (2 * widths[name]) for name, change in changes}
        return slopes

    def save(self, path: str | Path) -> None:
        """Write the model file completely or not at all."""
        write(path, table_content(self), FORMAT)

    def __repr__(self) -> str:
        rows, (fewest, most) = self.provenance.get("rows", {}), self.ranges["N"]
        lines = [f"Look-up table {self.identity} for {fewest:g} to {most:g} tails"]
        if rows:
            lines[0] += f", learned from {rows['train']} robots"
            lines.append(f"  median error on {rows['held_out']} held-out robots: {_medians(self.errors)}")
        ends = [(name, *self.ranges[name]) for name in (*_OF_TAILS, "C_yr") if name in self.ranges]
        within = ", ".join(f"{name} {low:.4g} to {high:.4g}" for name, low, high in ends)
        return "\n".join([*lines, f"  within {within}"])

    def quantities(self) -> list[tuple[str, str]]:
        """List the held-out errors, and the robots that it knows."""
        frame = 100 * self.to_frame()
        rows = [
            (f"error of {name}", f"median {row['median']:.2g} %, 95 % of robots below {row['p95']:.2g} %")
            for name, row in frame.loc[frame.index.isin(RELATIVE)].iterrows()
        ]
        return [*rows, ("robots", repr(self).splitlines()[-1].strip())]

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw median and 95th percentile of the held-out errors of each steady output [%].

        Args:
            ax: default: axes of a new figure.
        """
        ax = given_axes(ax)
        frame = self.to_frame().loc[[name for name in (*RELATIVE, "v_z") if name in self.errors]]
        for column, mark in (("median", "o"), ("p95", "|")):
            if column in frame:
                ax.plot(100 * frame[column], range(len(frame)), mark, label=column)
        ax.set_yticks(range(len(frame)), list(frame.index))
        ax.set_xscale("log")
        ax.set_xlabel("held-out error [%]")
        ax.legend(frameon=False)
        return ax

    def to_frame(self) -> pd.DataFrame:
        """Tabulate the held-out errors: a row for each output, see `surrogate.held_out`."""
        import pandas as pd  # a query does not need it

        return pd.DataFrame.from_dict(self.errors, orient="index")

    def solve(self, values: Mapping[str, Floats]) -> Motions:
        """Return the motion of checked robots (`sim.inputs.check_columns`), known to the table or not."""
        (groups, robots), parts = packed_robots(values), []
        for k, rows in rows_by_network(network_index(values["N"])):
            network, support, own = self.tails.wrench[k], self.support[k], robots[rows]
            if network is None or support is None:
                unknown, none = np.full(len(own), NOT_LEARNED), np.full((len(own), 12), np.nan)
                parts.append((rows, none[:, :5], none[:, :7], 0 * own[:, :11], unknown, none.T))
            else:
                layers = network.layers, self.tails.gap.layers
                parts.append((rows, *motions_of(*layers, support.numbers, self._limits, groups[rows], own)))
        return Motions(robots, *(parts[0][1:] if len(parts) == 1 else _joined(parts)))

    @cached_property
    def _limits(self) -> Floats:
        """Least and greatest size of each of ROBOT, (2, 9); only those of the tails and the motor have a limit."""
        ends = [self.ranges[name] if name in _OF_TAILS else (0.0, np.inf) for name in ROBOT]
        return np.ascontiguousarray(np.array(ends).T * [[1 - 1e-9], [1 + 1e-9]])

    def _check_known(
        self, values: Mapping[str, Floats], motions: Motions, *, flag: bool = False, mark: bool = False
    ) -> None:
        """Refuse the first robot that is outside, unless such robots are flagged, or are marked among others."""
        if not flag and (motions.outside.all() if mark else motions.outside.any()):
            row = int(np.flatnonzero(motions.outside)[0])
            raise OutsideError(
                f"the robot in row {row + 1} is outside the look-up table: {self._why(values, motions, row)}; "
                "change the robot, or simulate it (softflagella steady, softflagella surrogate robot)",
                row,
                _reason(values, motions, row),
            )

    def width_features(self, motions: Motions) -> Floats:
        """Return what the width of an interval may depend on, (M, 11), with the spread of the members."""
        several = [network is not None and len(network.bypass) > 1 for network in self.tails.wrench]
        for k, rows in rows_by_network(network_index(motions.robots[:, PLACES.number])) if any(several) else ():
            network, motion = self.tails.wrench[k], motions.motion[rows]
            if network is not None and several[k]:
                robots = unpack_robots(motions.robots[rows])
                weight = motion_sensitivity(robots, motion) @ wrench_slopes(robots, motion)
                members = network.members_at(network_inputs(robots, motion, network.shape["inputs"]))
                apart = (weight @ (members - members.mean(0))[..., None])[..., 0]
                spread = np.linalg.norm(apart, axis=-1).mean(0)
                motions.features[rows, SPREAD] = np.nan_to_num(np.log(spread + TINY_SPREAD))
        return motions.features

    def _ends(self, motions: Motions, result: Mapping[str, Floats]) -> dict[str, Floats]:
        """Return the ends of the intervals of a result, in its order."""
        if self.intervals is None:
            raise InputError("this look-up table has no intervals; train it again")
        ends = self.intervals.ends(self.width_features(motions), motions.robots, motions.outputs)
        return {f"{name}_{end}": ends[f"{name}_{end}"] for end in ("low", "high") for name in result
                if f"{name}_{end}" in ends}  # fmt: skip

    def _why(self, values: Mapping[str, Floats], motions: Motions, row: int) -> str:
        """Say why a robot is outside, with a number that no learned robot had if there is one."""
        reason = _reason(values, motions, row)
        for name in dict.fromkeys((*_OF_TAILS, *self.ranges)):
            low, high = self.ranges[name]
            value = abs(float(values[name][row]))
            if not low * (1 - 1e-9) <= value <= high * (1 + 1e-9):
                return f"{reason}; {name} = {value:g}, learned were {low:g} to {high:g}"
        return reason


def _reason(values: Mapping[str, Floats], motions: Motions, row: int) -> str:
    return reason_of(motions.outside[row], values["N"][row], motions.motion[row, 2])


def _joined(parts: Sequence[tuple[Any, ...]]) -> list[Any]:
    """Join parts of M robots, each with its rows first and its outputs last, in the order of the rows."""
    rows, *columns, outputs = zip(*parts, strict=True)
    order = np.argsort(np.concatenate(rows))
    return [*(np.concatenate(own)[order] for own in columns), np.concatenate(outputs, 1)[:, order]]


def _medians(errors: Mapping[str, Mapping[str, float]]) -> str:
    """Write the median errors that matter most."""
    shown = {"omega_yr_bar": "yaw rate", "R_yr_over_l": "turn radius", "v_z": "surge"}
    return ", ".join(
        f"{what} {100 * errors[name]['median']:.2g} %" for name, what in shown.items() if name in errors
    )


def _check_flips(values: Mapping[str, Floats]) -> None:
    """Refuse robots whose response to a flip was not learned."""
    for name in values.keys() - ROBOT:
        if effect_named(name).symmetry == "odd" and values[name].any():
            raise InputError(
                f"{name} makes left and right turns differ, which the look-up table has not learned; make the "
                "robot a table of its own: softflagella surrogate robot ROBOT.toml --out TABLE.json"
            )
    if (values["N"] < 2).any():
        raise InputError(
            "N = 1: the response of one tail depends too much on the phase of the disc, so the look-up table "
            "has not learned it; simulate it (softflagella replay)"
        )


def _checked_dwells(given: Any) -> tuple[Floats, str]:
    """Return dwells (M,), and what is wrong with them in words."""
    try:
        dwells = np.asarray(given, dtype=float)
    except (TypeError, ValueError):
        return np.empty(0), f"{DWELL} has a value that is no number; give numbers"
    wrong = dwells[~(np.isfinite(dwells) & (dwells >= _MIN_DWELL))]
    return dwells, f"{DWELL} = {wrong.flat[0]:g}; give a dwell from {DWELLS[0]:g} on" if wrong.size else ""


def table_content(lookup: NeuralTable) -> dict[str, Any]:
    """Return a table as nested dictionaries and lists of arrays and plain values."""
    content = {
        "wrench": [None if network is None else _stored(network) for network in lookup.tails.wrench],
        "gap": _stored(lookup.tails.gap),
        "curves": [_stored(network) for network in lookup.curves.networks],
        "bases": {name: {"mean": b.mean, "vectors": b.vectors} for name, b in lookup.curves.bases.items()},
        "support": [None if support is None else _fields(support) for support in lookup.support],
        "intervals": None if lookup.intervals is None else _widths(lookup.intervals),
        "ranges": {name: list(ends) for name, ends in lookup.ranges.items()},
        "errors": lookup.errors,
        "provenance": lookup.provenance,
    }
    errors = lookup.curve_errors
    if errors is not None:
        content[CURVE_ERRORS] = {
            "widths": _widths(errors.widths),
            "curves": errors.curves,
            "simulator": errors.simulator,
        }
    return content


def _widths(intervals: Intervals) -> dict[str, Any]:
    return {name: _plain(value) for name, value in _fields(intervals).items()}


def _fields(part: Support | Intervals) -> dict[str, Any]:
    return {field.name: getattr(part, field.name) for field in fields(part)}


def _stored(network: Ensemble) -> dict[str, Any]:
    return {"shape": network.shape, "state": network.state}


def _plain(value: Any) -> Any:
    """Return mappings as dictionaries, and pairs as lists."""
    if isinstance(value, np.ndarray):
        return value
    return {name: list(part) if isinstance(part, tuple) else part for name, part in dict(value).items()}
