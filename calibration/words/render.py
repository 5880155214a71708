"""Render what a verdict says: each text is a template over the content of verdict.json, and over nothing else.

So a stored verdict.json says again what it said. `headline.j2` is the verdict in one sentence, `sentence.j2` the
same with its certainty and all that goes beside it, `errors.j2` its errors, `laws.j2` what laws say,
`next_steps.j2` what a lab does next, `report.j2` the first screen and the sections of the report.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from calibration.words import quantities
from calibration.words.quantities import Record
from common.units import length_in_lab

if TYPE_CHECKING:
    from jinja2 import Environment

_ENOUGH = "¦"  # in next_steps.j2: what stands before it is enough where there is little room
_NAMED, _LONGEST = 4, 25  # explanations in a headline, and its words
_KINDS = {
    "none": "nothing beyond noise", "number": "claimed", "effect": "claimed", "ambiguous": "undecided",
    "unexplained": "unexplained",
}  # fmt: skip


def headline(record: Record) -> str:
    """Say the verdict in one sentence, with the size of what it names."""
    for named in range(_NAMED, 0, -1):
        context = {**record, "named": named, "unconfirmed": _unconfirmed(record)}
        said = _one_line(rendered("headline.j2", context))
        if len(said.split()) <= _LONGEST:
            break
    return said


def badges(record: Record) -> list[str]:
    """List what kind of verdict it is, in a word or two, and what weakens it."""
    described = record["nearest"] or record["described"]
    kind = "description only" if described else _KINDS[record["verdict"]]
    if record["verdict"] == "none" and record["moves"]:
        kind = "claimed"
    doubted = record["imitable"] or (record["number_check"] or {}).get("uncertain")
    unconfirmed = _unconfirmed(record)
    found = {
        kind: (record["noise_known"] or record["verdict"] != "none") and not (kind == "claimed" and unconfirmed),
        "noise unknown": not record["noise_known"],
        "provisional": record["not_tried"],
        "not confirmed": unconfirmed,
        "look-alikes possible": doubted,
    }
    return [words for words, holds in found.items() if holds]


def _unconfirmed(record: Record) -> bool:
    """Tell whether the held-out runs do not bear out a verdict."""
    explained = record["verdict"] not in ("partial", "unexplained")
    refuted = record["held_out_error_falls"] is False or record["gain_is_certain"] is False
    return refuted or (explained and not record["held_out_runs_agree"])


def in_brief(record: Record) -> list[str]:
    """Say headline, badges and the errors on the held-out runs, in up to 1 + `quantities.SHOWN` lines."""
    outputs, errors = quantities.held_out_errors(record)
    lines = [
        f"error on the held-out {record['row']}s{f', {output}' if len(outputs) > 1 else ''}: "
        + ", ".join(f"{model} {each[place]}" for model, each in errors.items())
        for place, output in enumerate(outputs)
    ]
    return [f"{headline(record)} [{', '.join(badges(record))}]", *lines]


def sentence(record: Record) -> str:
    """Say the verdict in a sentence with its certainty, and whether the held-out runs bear it out.

    Further sentences say what goes before it or beside it, such as another value of a nuisance parameter.
    """
    return _one_line(rendered("sentence.j2", record))


def errors_in_words(record: Record) -> str:
    """Say the errors on the held-out runs, in a line."""
    return _one_line(rendered("errors.j2", record))


def say_laws(laws: Record) -> str:
    """Say which laws describe the runs, without a claim about the cause, or which fit as well as a claim."""
    return _one_line(rendered("laws.j2", {**laws, "by_place": {law["place"]: law for law in laws["laws"]}}))


def next_steps(record: Record) -> list[str]:
    """List what a lab does next; code is between backticks.

    The first step is the only one that says which model to use; the others are experiments, the most urgent first.
    """
    return [_one_line(step.replace(_ENOUGH, "")) for step in _steps(record)]


def next_in_short(record: Record) -> list[str]:
    """List the beginnings of the next steps, each up to the mark in the template or to its first full stop."""
    ends = (_one_line(re.split(rf"{re.escape(_ENOUGH)}|\.\s", step)[0]) for step in _steps(record))
    return [f"{words.rstrip(' .,:;')}." for words in ends]


def _steps(record: Record) -> list[str]:
    return re.split(r"^\* ", rendered("next_steps.j2", record), flags=re.MULTILINE)[1:]


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
        auto_reload=False,
        autoescape=lambda name: name == "report.j2",
    )
    environment.filters |= _FILTERS | {name: pass_context(words) for name, words in _OF_OUTPUTS.items()}
    environment.globals |= {
        "held_out_errors": pass_context(quantities.held_out_errors),
        "noise_of_a_row": pass_context(quantities.noise_of_a_row),
        "gain_in_words": pass_context(quantities.gain_in_words),
    }
    return environment


_FILTERS: dict[str, Callable[..., str]] = {
    "percent": quantities.percent, "digits": quantities.digits, "p": quantities.p_in_words,
    "plain": quantities.plain, "size": quantities.size, "sized": quantities.sized,
    "of_theory": quantities.of_theory,
    "detectable": quantities.detectable, "tolerance": quantities.tolerance,
    "fitted_value": quantities.fitted_value, "direction": quantities.direction_in_words,
    "ranges": quantities.ranges_in_words, "removed": quantities.removed, "in_lab": length_in_lab,
}  # fmt: skip
_OF_OUTPUTS: dict[str, Callable[..., str]] = {  # their first argument is the whole record
    "output": quantities.output_label,
    "offset": quantities.offset,
    "output_error": quantities.output_error,
    "error": quantities.error_in_words,
    "interval": quantities.interval_in_words,
    "along": quantities.along_in_words,
    "given": quantities.given,
}
