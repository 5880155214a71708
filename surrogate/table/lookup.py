"""The look-up table: the tails' wrench is learned, and the head's balance is solved at each query.

A query finds the motion in which the tails' mean wrench (`surrogate.table.wrench_table`) is in balance with head,
disc and motor (`surrogate.wrench.heads`). So it answers for every head, every number of tails and every effect on
head, disc and motor. Its response to a flip comes from learned curves (`surrogate.table.response_table`). Every
output can have an interval (`surrogate.table.intervals`).

Rejected, or flagged on request: robots outside the joint support of the training data (`surrogate.table.support`),
and robots that yaw more than BRANCHES times as fast as their tails turn, which may have several motions. Effects
on the tails themselves are always rejected. The table does not extrapolate.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from sim.arrays import Floats
from sim.effects import catalogue
from sim.inputs import check_columns
from sim.io.errors import InputError
from sim.io.notebook import as_html, given_axes
from sim.model.groups import DWELL
from sim.model.response import Responses
from sim.motion.net_speed import net_speeds, twists
from sim.motion.steady_motion import STEADY_OUTPUTS
from surrogate.error_modes import STEADY, error_modes, joined
from surrogate.input_ranges import ROBOT
from surrogate.interface import ErrorModes, OutsideError
from surrogate.networks.ensemble import Ensemble
from surrogate.table.compiled_query import INPUT, MOTION
from surrogate.table.curve_errors import CURVE_ERRORS, NORMAL_90, CurveErrors
from surrogate.table.errors import RELATIVE, error_scale
from surrogate.table.flat_table import flat_table
from surrogate.table.intervals import Intervals
from surrogate.table.jacobian import slopes
from surrogate.table.outside_reasons import reason_of
from surrogate.table.quick_query import OUTSIDE, SHORTEST, QuickQuery, outside
from surrogate.table.response_table import ResponseTable, curve_speeds
from surrogate.table.support import Support
from surrogate.table.tensor_file import digest, write
from surrogate.table.wrench_table import WrenchTable, motion_sensitivity, network_index, rows_by_network
from surrogate.wrench.heads import Heads, heads_and_tails, needs_no_learning, pack_robots
from surrogate.wrench.tails import Tails, network_inputs, wrench_slopes

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

FORMAT = 7  # of model files
CERTIFIED = "certified_error"
_MOTION, _INPUTS = slice(MOTION, MOTION + 5), slice(INPUT, INPUT + 7)  # rows of the compiled loop's answer
_NOT_OF_HEAD = ("omega_bar", "l_over_R", "l_over_r0", "a_over_R")


class Motions(NamedTuple):
    """What a query works with, for M robots."""

    heads: Heads
    tails: Tails
    motion: Floats  # (M, 5): (v_x of J, v_z, ω_yr, ω_h, ω_t), for a positive motor
    inputs: Floats  # (M, 7) of the networks, see `surrogate.wrench.tails.tail_inputs`
    reason: list[str]  # why a robot is outside; else empty


@dataclass(frozen=True, repr=False)
class NeuralTable:
    """A trained table with its domain, its intervals and its held-out errors."""

    tails: WrenchTable
    curves: ResponseTable
    support: tuple[Support | None, ...]  # for each of the classes of `surrogate.table.wrench_table`
    intervals: Intervals | None
    ranges: dict[str, tuple[float, float]]  # of the robots that were learned, by input
    errors: dict[str, dict[str, float]]  # output -> held-out error, see `surrogate.table.errors`
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
        self, columns: Mapping[str, Floats], *, intervals: bool = False, flag: bool = False, certify: bool = False
    ) -> dict[str, Any]:
        """Predict outputs, each (M,); with a column `dwell_bar` also RESPONSE_OUTPUTS for equal dwells.

        Args:
            columns: robots by column name, each (M,).
            intervals: add `<name>_low` and `<name>_high`, which hold the simulator's value in 90 of 100 cases.
            flag: answer for robots outside the domain as well; the column OUTSIDE says which.
            certify: simulate each robot as well; the column CERTIFIED is the largest relative error of the spins,
                the yaw rate and the velocities (these relative to the speed), with the simulator's own error.

        Raises:
            InputError: a robot that cannot be, or one outside the domain.
        """
        if not certify and (intervals is False or self._quick_widths):
            answer = self._quick.one(columns, intervals=intervals, flag=flag)
            if answer is not None:
                return answer
        values = check_columns({name: array for name, array in columns.items() if name != DWELL})
        if DWELL in columns:
            _check_flips(values)
        robots = None if _without_effects(values) else pack_robots(*heads_and_tails(values))
        dwells = self._dwells(columns, values, flag=flag)
        widths = intervals and self._quick_widths
        answers = self._quick.rows(values, robots, dwells, widths=widths)
        self._check_known(values, answers, flag=flag)
        result = self._quick.named(answers, with_dwell=dwells is not None, widths=widths)
        if intervals and not widths:
            result |= self._intervals(self.motions(values, flag=flag), result)
        if flag:
            result[OUTSIDE] = outside(answers)
        if certify:
            from surrogate.table.certify import certified_error

            result[CERTIFIED] = certified_error(values, result)
        return result

    def response(self, columns: Mapping[str, Floats], *, flag: bool = False) -> Responses:
        """Return the response to a flip of the motor, see `surrogate.interface.LookupTable.response`.

        Raises:
            InputError: a robot that cannot be, one outside the domain, or one whose left and right turns differ.
        """
        values = check_columns(columns)
        _check_flips(values)
        motions = self.motions(values, flag=flag)
        return self._responses(motions, steady_outputs(motions, self.tails))

    def error_modes(self, columns: Mapping[str, Floats]) -> ErrorModes:
        """Return the errors of motion and response at one robot; see `LookupTable.error_modes`."""
        values = check_columns({name: np.asarray(values)[:1] for name, values in columns.items()})
        motions = self.motions(values)
        steady = steady_outputs(motions, self.tails)
        motion = {name: float(values[0]) for name, values in steady.items()}
        if self.intervals is None or self.curve_errors is None:
            return error_modes(self.errors, motion)
        ends = self._intervals(motions, steady)
        sizes = [float(ends[f"{name}_high"][0] - ends[f"{name}_low"][0]) / (2 * NORMAL_90) for name in STEADY]
        speeds = curve_speeds(motions.heads, motions.motion)
        curves = self.curve_errors.modes(self.width_features(motions), speeds)
        own = [self.curve_errors.simulator * float(error_scale(name, motion)) for name in STEADY]
        return joined(np.diag(np.hypot(sizes, own)), curves)

    def jacobian(
        self, columns: Mapping[str, Floats], parameters: Sequence[str], *, flag: bool = False
    ) -> dict[str, dict[str, Floats]]:
        """Return ∂(output)/∂(parameter) of STEADY_OUTPUTS, by output and parameter, each (M,).

        Exact derivatives of the table: those of one more step of Newton's method at the solution.

        Args:
            columns: robots by column name, each (M,).
            parameters: names of groups, without N, or of effects on the head.
            flag: answer outside the domain as well.

        Raises:
            InputError: a robot that cannot be, or one outside the domain.
        """
        values = check_columns({**columns, **{n: columns.get(n, 0.0 * columns["N"]) for n in parameters}})
        return slopes(self.tails, values, self.motions(values, flag=flag).motion, parameters)

    def save(self, path: str | Path) -> None:
        """Write the model file completely or not at all."""
        write(path, table_content(self), FORMAT)

    def __repr__(self) -> str:
        rows, (fewest, most) = self.provenance.get("rows", {}), self.ranges["N"]
        lines = [f"Look-up table {self.identity} for {fewest:g} to {most:g} tails"]
        if rows:
            lines[0] += f", learned from {rows['train']} robots"
            lines.append(f"  median error on {rows['held_out']} held-out robots: {_medians(self.errors)}")
        ends = [(name, *self.ranges[name]) for name in (*_NOT_OF_HEAD, "C_yr") if name in self.ranges]
        within = ", ".join(f"{name} {low:.4g} to {high:.4g}" for name, low, high in ends)
        return "\n".join([*lines, f"  within {within}"])

    def _repr_html_(self) -> str:
        return as_html(repr(self), self.plot)

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
        """Tabulate the held-out errors: a row for each output, see `surrogate.table.errors`."""
        import pandas as pd  # a query does not need it

        return pd.DataFrame.from_dict(self.errors, orient="index")

    def motions(self, values: Mapping[str, Floats], *, flag: bool = False) -> Motions:
        """Return the motion of checked robots (`sim.inputs.check_columns`); see `query` for `flag`."""
        heads, tails = heads_and_tails(values)
        answers = self._quick.rows(values, pack_robots(heads, tails), None)
        self._check_known(values, answers, flag=flag)
        motion, inputs = (np.ascontiguousarray(answers[place].T) for place in (_MOTION, _INPUTS))
        return Motions(heads, tails, motion, inputs, list(map(reason_of, answers.T, tails.number)))

    @cached_property
    def _quick(self) -> QuickQuery:
        ranges = [self.ranges[name] for name in _NOT_OF_HEAD]
        widths = self.intervals if self._quick_widths else None
        flat = flat_table(self.tails, self.curves, self.support, ranges, widths)
        return QuickQuery(flat, () if widths is None else list(widths.factor))

    @cached_property
    def _quick_widths(self) -> bool:
        """Whether the compiled loop knows the intervals: networks of several members have a spread as well."""
        members = [network.shape["members"] for network in self.tails.wrench if network is not None]
        return self.intervals is not None and set(members) == {1}

    def _dwells(self, columns: Mapping[str, Floats], values: Mapping[str, Floats], *, flag: bool) -> Floats | None:
        """Return the checked dwells of a query, (M,); a robot outside is refused before a dwell is."""
        if DWELL not in columns:
            return None
        try:
            return np.broadcast_to(_checked_dwells(columns[DWELL]), values["N"].shape)
        except InputError:
            self.motions(values, flag=flag)
            raise

    def _check_known(self, values: Mapping[str, Floats], answers: Floats, *, flag: bool) -> None:
        """Refuse the first robot that is outside, unless such robots are flagged."""
        if not flag:
            for row in np.flatnonzero(outside(answers))[:1].tolist():
                raise self._refusal(values, row, reason_of(answers[:, row], values["N"][row]))

    def width_features(self, motions: Motions) -> Floats:
        """Return what the width of an interval may depend on, (M, 11)."""
        heads, tails, motion = motions.heads, motions.tails, motions.motion
        novelty, spread = np.zeros(len(motion)), np.zeros(len(motion))
        weight = motion_sensitivity(heads, tails, motion) @ wrench_slopes(tails, motion)
        kind = network_index(tails.number)
        for k, rows in rows_by_network(kind):
            network, support = self.tails.wrench[k], self.support[k]
            if network is not None and support is not None:
                own = network_inputs(tails.at(rows), motion[rows], network.shape["inputs"])
                novelty[rows] = support.novelty(own)
                members = network.members_at(own)
                apart = (weight[rows] @ (members - members.mean(0))[..., None])[..., 0]
                spread[rows] = np.linalg.norm(apart, axis=-1).mean(0)
        extra = [
            np.log(novelty + 1e-12),
            np.log(spread + 1e-9),
            np.log(tails.number),
            kind == 0,
        ]
        return np.nan_to_num(np.column_stack([motions.inputs, *extra]))

    def _intervals(self, motions: Motions, result: Mapping[str, Floats]) -> dict[str, Floats]:
        if self.intervals is None:
            raise InputError("this look-up table has no intervals; train it again")
        features, added = self.width_features(motions), {}
        for name in [name for name in result if name in self.intervals.factor]:
            size = error_scale(name, result)
            half = self.intervals.half_widths(name, features, size, motions.heads.couples)
            half = np.where(np.isfinite(result[name]), half, 0.0)
            added[f"{name}_low"], added[f"{name}_high"] = result[name] - half, result[name] + half
        return added

    def _refusal(self, values: Mapping[str, Floats], row: int, reason: str) -> OutsideError:
        words = ""
        for name in dict.fromkeys((*_NOT_OF_HEAD, *self.ranges)):
            low, high = self.ranges[name]
            value = abs(float(values[name][row]))
            if not low * (1 - 1e-9) <= value <= high * (1 + 1e-9):
                words = f"; {name} = {value:g}, learned were {low:g} to {high:g}"
                break
        message = (
            f"the robot in row {row + 1} is outside the look-up table: {reason}{words}; change the robot, or "
            "simulate it (softflagella steady, softflagella surrogate robot)"
        )
        return OutsideError(message, row, reason)

    def _responses(self, motions: Motions, steady: Mapping[str, Floats]) -> Responses:
        curves = self.curves.curves(motions.heads, motions.tails, motions.motion)
        sense = motions.heads.sense
        twist = twists(steady["v_z"], steady["v_x"], steady["omega_yr_bar"], sense)
        speed = net_speeds(twist, curves["lag"], curves["memory"])
        none = np.zeros(len(sense), dtype=bool)
        return Responses(**curves, net_speed=speed, failed=none, stepped=none)


def _medians(errors: Mapping[str, Mapping[str, float]]) -> str:
    """Write the median errors that matter most."""
    shown = {"omega_yr_bar": "yaw rate", "R_yr_over_l": "turn radius", "v_z": "surge"}
    return ", ".join(
        f"{what} {100 * errors[name]['median']:.2g} %" for name, what in shown.items() if name in errors
    )


def _without_effects(values: Mapping[str, Floats]) -> bool:
    """Return whether no robot has an effect."""
    return not any(size.any() for name, size in values.items() if name not in ROBOT)


def _check_flips(values: Mapping[str, Floats]) -> None:
    """Refuse robots whose response to a flip was not learned."""
    for name, size in values.items():
        if name in catalogue() and catalogue()[name].symmetry == "odd" and size.any():
            raise InputError(
                f"{name} makes left and right turns differ, which the look-up table has not learned; make the "
                "robot a table of its own: softflagella surrogate robot ROBOT.toml --out TABLE.json"
            )
    if (values["N"] < 2).any():
        raise InputError(
            "N = 1: the response of one tail depends too much on the phase of the disc, so the look-up table "
            "has not learned it; simulate it (softflagella replay)"
        )


def steady_outputs(motions: Motions, tails: WrenchTable) -> dict[str, Floats]:
    """Return STEADY_OUTPUTS of motions."""
    values = tails.outputs(motions.heads, motions.motion, tails.quick_gap(motions.tails, motions.inputs))
    return dict(zip(STEADY_OUTPUTS, values, strict=True))


def _checked_dwells(dwells: Floats) -> Floats:
    try:
        dwells = np.asarray(dwells, dtype=float)
    except (TypeError, ValueError):
        raise InputError(f"{DWELL} has a value that is no number; give numbers") from None
    for value in dwells[~(np.isfinite(dwells) & (dwells >= SHORTEST))][:1]:
        raise InputError(f"{DWELL} = {value:g}; give a dwell from {SHORTEST:g} on")
    return dwells


def table_content(lookup: NeuralTable) -> dict[str, Any]:
    """Return a table as nested dictionaries and lists of arrays and plain values."""
    content = {
        "wrench": [None if network is None else _stored(network) for network in lookup.tails.wrench],
        "gap": _stored(lookup.tails.gap),
        "curves": [_stored(network) for network in lookup.curves.networks],
        "bases": {name: {"mean": b.mean, "vectors": b.vectors} for name, b in lookup.curves.bases.items()},
        "support": [None if support is None else vars(support) for support in lookup.support],
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
    return {name: _plain(value) for name, value in vars(intervals).items()}


def _stored(network: Ensemble) -> dict[str, Any]:
    return {"shape": network.shape, "state": network.state}


def _plain(value: Any) -> Any:
    """Return mappings as dictionaries, and pairs as lists."""
    if isinstance(value, np.ndarray):
        return value
    return {name: list(part) if isinstance(part, tuple) else part for name, part in dict(value).items()}
