"""The model card: one page of Markdown beside a look-up table.

It describes the training data, the held-out errors by region, the coverage of the intervals, the worst robots with
the reason, and the limits of validity.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from sim.arrays import Flags, Floats
from surrogate.input_ranges import ROBOT
from surrogate.table.errors import COMPARED, relative_errors
from surrogate.table.intervals import COVERAGE
from surrogate.table.lookup import NeuralTable
from surrogate.training.simulated import SimulatedRobots
from surrogate.training.train import with_radius, without_effects
from surrogate.wrench.heads import heads_and_tails

_WORST = 10
_FEWEST = 20  # robots, for a line of a table
_OUTER = 0.1  # of an input's range in logarithms: a face; three of them: a corner
_TITLES = {
    "omega_t_bar": "spin of the tails", "omega_h_bar": "spin of the head", "omega_yr_bar": "yaw rate",
    "v_x": "sway", "R_yr_over_l": "turn radius", "tail_gap": "gap between tails", "v_z": "surge, of the speed",
    "theta_deg": "slip angle [degrees]",
}  # fmt: skip
_NO_TRUST = """
- One tail: its errors are several times those of other robots, mostly where the tail's spin yaws the robot by a
  strong couple (surface couple, left-right bias). Its response to a flip is not learned.
- Tails that touch: the model has no contact.
- Surge near zero: a small error of the speed is a large part of it.
- Dwells below about 0.6 time units: the net speed is a small difference of large numbers.
- Outside the domain a query is refused. `flag=True` answers all the same, without any promise.
- The errors are those of the table against the simulator, not against a tank.
"""


_MORE_ROWS = """
How errors fall with the number of rows is drawn by `python -m benchmarks learning_curve DATA`. For the domain of
the shipped table the picture is in docs/figures.md, under "Error against rows".
"""


def _about_errors(inside: int, outside: int) -> str:
    if not inside:
        return (
            f"Not known: all {outside} held-out robots are outside its domain, so it was trained on too few rows. "
            "Simulate more of them, and train again."
        )
    return (
        f"On {inside} held-out robots, in per cent where no unit is given. {outside} more were outside its "
        "domain. Coverage is the share of intervals that hold the simulator's value; they are made for "
        f"{100 * COVERAGE:.0f} %."
    )


def model_card(lookup: NeuralTable, held_out: SimulatedRobots) -> str:
    """Write the card of a table, from robots that it did not learn."""
    answer = lookup.query(held_out.robots, intervals=True, flag=True)
    truth = with_radius(held_out.motion)
    known = ~answer["outside"]
    errors = {name: np.abs(error) for name, error in relative_errors(answer, truth).items()}
    inside = {
        name: (answer[f"{name}_low"] <= truth[name]) & (truth[name] <= answer[f"{name}_high"]) for name in COMPARED
    }
    names = [name for name in ROBOT if name in lookup.ranges]
    ranges = [(name, *(f"{end:.4g}" for end in lookup.ranges[name])) for name in names]
    tails, apart = held_out.robots["N"], held_out.motion["tail_gap"] >= 1
    parts = [
        f"# Look-up table {lookup.identity}",
        _what(lookup),
        "## What it learned",
        _lines(("input", "from", "to"), ranges),
        "The domain is not this box but the joint support of what was learned. Robots with effects on head, disc "
        "and motor are answered, too.",
        "## Errors",
        _about_errors(int(known.sum()), int((~known).sum())),
    ]
    plain, couples = without_effects(held_out.robots), heads_and_tails(held_out.robots)[0].couples
    shown = known & plain if (known & plain).any() else known
    kinds = (
        ("Two tails and more, which do not touch:", plain & (tails > 1) & apart),
        ("Two tails and more, touching or not:", plain & (tails > 1)),
        ("One tail:", plain & (tails == 1)),
        ("Two tails and more, with effects on head and motor:", ~plain & ~couples & (tails > 1) & apart),
        ("One tail, with effects on head and motor:", ~plain & ~couples & (tails == 1)),
        ("Two tails and more, with a couple in yaw:", couples & (tails > 1) & apart),
        ("One tail, with a couple in yaw:", couples & (tails == 1)),
    )
    for words, kind in kinds:
        rows = [_row(_TITLES[name], name, errors, inside, known & kind) for name in COMPARED]
        if any(rows):
            parts += [words, _lines(("output", "median", "95 %", "worst", "coverage"), filter(None, rows))]
    regions = [
        (words, *row[1:])
        for words, kind in _regions(held_out.robots)
        if (row := _row("", "omega_yr_bar", errors, inside, shown & kind))
    ]
    parts += ["## Yaw rate by region", _lines(("robots", "median", "95 %", "worst", "coverage"), regions)]
    parts += ["## The worst robots", _worst(held_out, answer, errors["omega_yr_bar"], shown)]
    parts += ["## More rows", _MORE_ROWS.strip()]
    parts += ["## Where not to trust it", _NO_TRUST.strip()]
    return "\n\n".join(parts) + "\n"


def _what(lookup: NeuralTable) -> str:
    rows, made = lookup.provenance["rows"], lookup.provenance
    words = f"{rows['train']} robots learned for the steady motion, {rows['flips']} for the response to a flip."
    libraries = ", ".join(f"{name} {version}" for name, version in made.get("libraries", {}).items())
    return f"{words} Code {made.get('code_version', 'unknown')}, {libraries}."


def _row(
    words: str, name: str, errors: dict[str, Floats], inside: dict[str, Flags], kind: Flags
) -> tuple[str, ...] | None:
    """Return figures of one output over some robots; None where there are too few."""
    kind = kind & np.isfinite(errors[name])
    if np.count_nonzero(kind) < _FEWEST:
        return None
    size = errors[name][kind] * (1 if name == "theta_deg" else 100)
    figures = (np.median(size), np.quantile(size, 0.95), size.max())
    return words, *(f"{value:.2g}" for value in figures), f"{100 * inside[name][kind].mean():.0f} %"


def _regions(robots: dict[str, Floats]) -> list[tuple[str, Flags]]:
    """Return robots by N, by thirds of each input's range, near a face and in a corner of the ranges; N > 1."""
    several = robots["N"] > 1
    regions = [(f"N = {count:.0f}", robots["N"] == count) for count in np.unique(robots["N"])]
    faces = np.zeros(len(several), dtype=int)
    for name in ROBOT:
        values = np.log(np.abs(robots[name]))
        low, high = values.min(), values.max()
        if name == "N" or high - low < 1e-9:
            continue
        share = (values - low) / (high - low)
        faces += (share < _OUTER) | (share > 1 - _OUTER)
        for third, words in enumerate(("low", "middle", "high")):
            part = several & (share >= third / 3) & (share <= (third + 1) / 3)
            ends = np.exp(low + (high - low) * np.array([third, third + 1]) / 3)
            regions.append((f"{name} {words}: {ends[0]:.3g} to {ends[1]:.3g}", part))
    return [
        *regions,
        ("one input or more near its end", several & (faces > 0)),
        ("three or more", several & (faces > 2)),
    ]


def _worst(rows: SimulatedRobots, answer: dict[str, Any], error: Floats, known: Flags) -> str:
    """Return the robots with the largest errors of the yaw rate, N > 1, and why."""
    size = np.where(known & (rows.robots["N"] > 1), error, -1.0)
    order = np.argsort(-size)[:_WORST]
    names = [name for name in ROBOT if np.ptp(rows.robots[name]) > 0]
    lines = []
    for row in order[size[order] >= 0]:
        quick = abs(rows.motion["omega_yr_bar"][row] / rows.motion["omega_t_bar"][row])
        reasons = ["tails touch"] if rows.motion["tail_gap"][row] < 1 else []
        reasons += [f"yaws at {quick:.2f} of the tails' spin"] if quick > 0.3 else []
        reasons += [f"the simulator's own error is {100 * rows.motion['error'][row]:.2f} %"] * bool(
            rows.motion["error"][row] > 0.2 * size[row]
        )
        width = (answer["omega_yr_bar_high"] - answer["omega_yr_bar"])[row] / abs(answer["omega_yr_bar"][row])
        robot = [f"{rows.robots[name][row]:.3g}" for name in names]
        lines.append(
            (f"{100 * size[row]:.2g}", f"± {100 * width:.2g}", *robot, "; ".join(reasons) or "a far corner")
        )
    return _lines(("error [%]", "interval [%]", *names, "why"), lines)


def _lines(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Format a table in Markdown."""
    every = [head, ["---"] * len(head), *rows]
    return "\n".join(f"| {' | '.join(cells)} |" for cells in every)
