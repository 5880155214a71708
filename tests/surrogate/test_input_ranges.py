"""The ranges of the inputs: the sweep of the shipped table, what it learns, and where it is inverted."""

from __future__ import annotations

from pathlib import Path

from dataset.rows.design import load_design
from surrogate.input_ranges import BOUNDS, DOMAIN, MOST_TAILS, WIDE


def test_the_sweep_of_the_domain_and_the_bounds_of_the_inverse_are_those_of_the_domain() -> None:
    axes = load_design(Path(__file__).parents[2] / "surrogate/shipped/domain.toml").axes
    assert {name: (axis.low, axis.high) for name, axis in axes.items()} == {**DOMAIN, "N": (1, MOST_TAILS)}
    for name, (low, high) in BOUNDS.items():
        assert WIDE[name][0] <= low <= DOMAIN[name][0]
        assert DOMAIN[name][1] <= high <= WIDE[name][1]
