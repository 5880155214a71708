"""Render what a verdict says: each text is a template over the content of verdict.json, and over nothing else.

So a stored verdict.json says again what it said. `sentence.j2` is the verdict with its certainty, `errors.j2` its
errors, `laws.j2` what laws say, `next_steps.j2` what a lab does next, `report.j2` the sections of the report.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from calibration.words.quantities import (
    Record,
    along_in_words,
    detectable,
    digits,
    direction_in_words,
    final_model,
    fitted_value,
    given,
    offset,
    output_error,
    output_label,
    p_in_words,
    percent,
    plain,
    ranges_in_words,
    size,
    tolerance,
)
from common.units import length_in_lab

if TYPE_CHECKING:
    from jinja2 import Environment


def sentence(record: Record) -> str:
    """Say the verdict in one sentence with its certainty; a second one for a nuisance parameter that is wrong.

    The first sentence says so if the claim does not lower the error on the held-out runs.
    """
    return _one_line(rendered("sentence.j2", record))


def errors_in_words(record: Record) -> str:
    """Say the errors on the held-out runs, in a line."""
    return _one_line(rendered("errors.j2", record))


def say_laws(laws: Record) -> str:
    """Say which laws describe the runs, without a claim about the cause, or which fit as well as a claim."""
    return _one_line(rendered("laws.j2", {**laws, "by_place": {law["place"]: law for law in laws["laws"]}}))


def next_steps(record: Record) -> list[str]:
    """List what a lab does next, the most urgent first; code is between backticks.

    A verdict that the held-out runs contradict comes before all others: more runs, and no use of it until then. A
    corrected robot that does not lower their error is not advised.
    """
    steps = re.split(r"^\* ", rendered("next_steps.j2", record), flags=re.MULTILINE)
    return [_one_line(step) for step in steps[1:]]


def rendered(template: str, context: Record) -> str:
    """Fill a template; a name that the context lacks is an error."""
    return _environment().get_template(template).render(context)


def _one_line(text: str) -> str:
    return " ".join(text.split())


@cache
def _environment() -> Environment:
    """Make the environment of the templates; jinja2 is loaded where something is said."""
    from jinja2 import Environment, FileSystemLoader, StrictUndefined, pass_context

    environment = Environment(
        loader=FileSystemLoader(Path(__file__).parent),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        autoescape=lambda name: name == "report.j2",
    )
    environment.filters |= _FILTERS | {name: pass_context(words) for name, words in _OF_OUTPUTS.items()}
    environment.globals["final_model"] = final_model
    return environment


_FILTERS: dict[str, Callable[..., str]] = {
    "percent": percent, "digits": digits, "p": p_in_words, "plain": plain, "size": size, "detectable": detectable,
    "given": given, "tolerance": tolerance, "fitted_value": fitted_value, "direction": direction_in_words,
    "ranges": ranges_in_words, "in_lab": length_in_lab,
}  # fmt: skip
_OF_OUTPUTS: dict[str, Callable[..., str]] = {  # their first argument is the whole record
    "output": output_label,
    "offset": offset,
    "output_error": output_error,
    "along": along_in_words,
}
