"""The model card: one page of Markdown beside a look-up table.

It has the domain, the errors on held-out robots of several kinds, the coverage of the intervals in each group of
robots, and the limits of validity.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from common.arrays import Flags, Floats
from surrogate.domain import MOST_TAILS, ROBOT
from surrogate.held_out import coverage, relative_errors
from surrogate.intervals import COVERAGE, THIRDS
from surrogate.table import NeuralTable
from surrogate.tails import robots_of
from surrogate.training.simulated import SimulatedRobots
from surrogate.training.train import with_radius, without_effects

_FEWEST = 20  # robots, for a line of a table
_TITLES = {
    "omega_h_bar": "spin of the head", "omega_yr_bar": "yaw rate",
    "R_yr_over_l": "turn radius", "v_z": "surge, of the speed", "theta_deg": "slip angle [degrees]",
}  # fmt: skip
_NO_TRUST = """
- One tail: errors are several times larger, mostly where a strong couple yaws the robot (surface couple,
  left-right bias). Its response to a flip is not learned.
- Tails that touch: the model has no contact.
- Surge near zero: a small error of the speed is a large part of it.
- Dwells below about 0.6 time units: the net speed is a small difference of large numbers.
- Outside the domain a query is refused; `flag=True` answers without any promise.
- The errors are those against the simulator, not against a tank.
"""


def _about_errors(inside: int, outside: int) -> str:
    if not inside:
        return (
            f"Not known: all {outside} held-out robots are outside its domain, so it was trained on too few rows. "
            "Simulate more of them, and train again."
        )
    return (
        f"On {inside} held-out robots, median / 95 %, in per cent where no unit is given. {outside} more were "
        "outside its domain. Tails do not touch, unless stated."
    )


def coverage_by_group(lookup: NeuralTable, rows: SimulatedRobots) -> list[tuple[int, dict[str, float]]]:
    """Return the number of robots and the coverage by output of each group of `surrogate.intervals`, (THIRDS,)."""
    answer, truth = lookup.query(rows.robots, intervals=True, flag=True), with_radius(rows.motion)
    motions, found = lookup.solve(rows.robots), []
    assert lookup.intervals is not None
    group = lookup.intervals.groups(lookup.width_features(motions), motions.robots) // 2
    for own in ((group == third) & ~answer["outside"] for third in range(THIRDS)):
        inside = [{name: values[own] for name, values in part.items()} for part in (answer, truth)]
        found.append((int(own.sum()), coverage(*inside)))
    return found


def model_card(lookup: NeuralTable, held_out: SimulatedRobots, fresh: SimulatedRobots | None = None) -> str:
    """Write the card of a table, from robots that it did not learn, and fresh ones if given for the intervals."""
    answer, truth = lookup.query(held_out.robots, flag=True), with_radius(held_out.motion)
    known = ~answer["outside"]
    errors = {name: np.abs(error) for name, error in relative_errors(answer, truth).items()}
    names = [name for name in ROBOT if name in lookup.ranges]
    ranges = ["{} {:.4g} to {:.4g}".format(name, *lookup.ranges[name]) for name in names]
    kinds = {words: kind & known for words, kind in _kinds(held_out).items()}
    tails, plain = held_out.robots["N"], known & without_effects(held_out.robots)
    shown = plain if plain.any() else known
    counts = {f"N = {count:.0f}": shown & (tails == count) for count in np.unique(tails)}
    by_output = [
        (words, *(" / ".join(_quantiles(errors[name], name, kind)) for name in _TITLES))
        for words, kind in {**kinds, **counts}.items()
        if np.count_nonzero(kind) >= _FEWEST
    ]
    return "\n\n".join([
        f"# Look-up table {lookup.identity}",
        _what(lookup),
        "## Domain",
        f"{', '.join(ranges)}. The domain is not this box but the joint support of what was learned. Robots with "
        "effects on head, disc and motor are answered, too.",
        "## Errors",
        _about_errors(int(known.sum()), int((~known).sum())),
        *([_lines(("robots", *_TITLES.values()), by_output)] if by_output else []),
        *_about_groups(lookup, fresh or held_out, "fresh robots" if fresh else "robots that calibrated them"),
        "## Where not to trust it",
        _NO_TRUST.strip(),
    ]) + "\n"  # fmt: skip


def _about_groups(lookup: NeuralTable, rows: SimulatedRobots, which: str) -> list[str]:
    """Write the section of the intervals, from robots that are described in words; none where groups are small."""
    found = coverage_by_group(lookup, rows)
    ends = [(min(shares.values()), max(shares.values())) if n >= _FEWEST else () for n, shares in found]
    cells = [" to ".join(f"{100 * share:.0f}" for share in shares) for shares in ends]
    names = [f"N = {1 + k % MOST_TAILS}{', with a couple in yaw' * (k // MOST_TAILS)}" for k in range(THIRDS // 3)]
    thirds = zip(*(cells[third::3] for third in range(3)), strict=True)
    lines = [(name, *shares) for name, shares in zip(names, thirds, strict=True) if any(shares)]
    if not lines or lookup.intervals is None:
        return []
    slow, fast = lookup.intervals.speeds
    words = (
        f"Share of {len(rows)} {which} that intervals for {100 * COVERAGE:.0f} % hold, in per cent: the least and "
        "the largest of all outputs."
    )
    head = ("robots", f"omega_bar below {slow:.3g}", f"to {fast:.3g}", "above")
    return ["## Intervals", words, _lines(head, lines)]


def _kinds(held_out: SimulatedRobots) -> dict[str, Flags]:
    """Return which robots are of a kind."""
    plain, couples = without_effects(held_out.robots), robots_of(held_out.robots).resistance[:, 2, 4] != 0
    single, apart = held_out.robots["N"] == 1, held_out.motion["tail_gap"] >= 1
    return {
        "N ≥ 2": plain & ~single & apart,
        "N ≥ 2, touching or not": plain & ~single,
        "N = 1": plain & single,
        "N ≥ 2, with effects on head and motor": ~plain & ~couples & ~single & apart,
        "N = 1, with effects on head and motor": ~plain & ~couples & single,
        "N ≥ 2, with a couple in yaw": couples & ~single & apart,
        "N = 1, with a couple in yaw": couples & single,
    }


def _what(lookup: NeuralTable) -> str:
    rows, made = lookup.provenance["rows"], lookup.provenance
    words = f"{rows['train']} robots learned for the steady motion, {rows['flips']} for the response to a flip."
    libraries = ", ".join(f"{name} {version}" for name, version in made.get("libraries", {}).items())
    return f"{words} Code {made.get('code_version', 'unknown')}, {libraries}."


def _quantiles(errors: Floats, name: str, kind: Flags) -> list[str]:
    """Write the median and the 95 % quantile of the errors of one output over some robots."""
    size = errors[kind & np.isfinite(errors)] * (1 if name == "theta_deg" else 100)
    return [f"{value:.2g}" for value in np.quantile(size, [0.5, 0.95])]


def _lines(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Format a table in Markdown."""
    every = [head, ["---"] * len(head), *rows]
    return "\n".join(f"| {' | '.join(cells)} |" for cells in every)
