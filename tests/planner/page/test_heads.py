"""Head, disc, motor and tails of robots are Python's, whichever way the motor turns."""

from __future__ import annotations

from sim.model.groups import checked_values
from surrogate.wrench.heads import heads_and_tails, straight_resistance
from tests.planner.page.page_core import answers, check_near
from tests.planner.page.robots import check_alike, columns_of, random_groups

FIELDS = ("perp", "parallel", "offset", "radius", "number", "spinDrag", "head")


def test_heads_and_tails() -> None:
    robots = random_groups(20)
    heads, tails = heads_and_tails(checked_values(columns_of(robots)))
    found = answers([("heads.js", "headAndTails", robot) for robot in robots])
    for name in heads._fields:
        check_near([one["head"][name] for one in found], getattr(heads, name), 1e-12)
    for name, part in zip(FIELDS, tails, strict=True):
        check_alike([one["tails"][name] for one in found], part, 1e-14)


def test_straight_tails() -> None:
    robots = random_groups(5)
    _, tails = heads_and_tails(checked_values(columns_of(robots)))
    pages = [one["tails"] for one in answers([("heads.js", "headAndTails", robot) for robot in robots])]
    check_near(answers([("heads.js", "straightResistance", page) for page in pages]), straight_resistance(tails))
