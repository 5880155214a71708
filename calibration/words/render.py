"""Render what a verdict says: each text is a template over the content of verdict.json, and over nothing else.

So a stored verdict.json says again what it said. `sentence.j2` is the verdict with its certainty, `next_steps.j2`
what a lab does next.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from jinja2 import Environment

Record = Mapping[str, Any]  # content of verdict.json

_RESOLVED = 2.01  # over the number of draws and one more: the bootstrap resolves no smaller p


def sentence(record: Record) -> str:
    """Say the verdict in one sentence with its certainty; a second one for a nuisance parameter that is wrong.

    The first sentence says so if the claim does not lower the error on the held-out runs.
    """
    return _one_line(_rendered("sentence.j2", record))


def next_steps(record: Record) -> list[str]:
    """List what a lab does next, the most urgent first; code is between backticks.

    A verdict that the held-out runs contradict comes before all others: more runs, and no use of it until then. A
    corrected robot that does not lower their error is not advised.
    """
    steps = re.split(r"^\* ", _rendered("next_steps.j2", record), flags=re.MULTILINE)
    return [_one_line(step) for step in steps[1:]]


def _rendered(template: str, record: Record) -> str:
    return _environment().get_template(template).render(record)


def _one_line(text: str) -> str:
    return " ".join(text.split())


@cache
def _environment() -> Environment:
    """Make the environment of the templates; jinja2 is loaded where something is said."""
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    environment = Environment(
        loader=FileSystemLoader(Path(__file__).parent), undefined=StrictUndefined, trim_blocks=True,
        lstrip_blocks=True,
    )  # fmt: skip
    environment.filters |= {"percent": percent, "digits": digits, "p": p_in_words}
    return environment


def percent(value: float, decimals: int = 2) -> str:
    """Write a share in per cent."""
    return f"{100 * value:.{decimals}f} %"


def digits(value: float, count: int = 3) -> str:
    """Write a number with so many significant digits."""
    return f"{value:.{count}g}"


def p_in_words(p_value: float, draws: int) -> str:
    """Write a p-value of a bootstrap."""
    return f"p {'≤' if p_value <= _RESOLVED / (draws + 1) else '='} {p_value:.2g}"
