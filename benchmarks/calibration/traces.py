"""Claims and intervals on time series: cups that cool and a pendulum, with noise that remembers.

Tables by `tests.oracles.drawn_traces`: three, six or twelve traces of 40 to 100 readings on three days, one
of which is held out. ρ is the correlation of neighbouring readings. Planted terms have the size λ in standard
deviations of their score under the true covariance, all numbers free. Tables of a case differ in experiment,
number of traces and term, in turn.

Usage: python -m benchmarks traces [TABLES] [FIRST_SEED] [CASES] [FILE]
       CASES: words of the cases to run, separated by |; default all. Seeds of a case begin a thousand apart.
       FILE: JSON lines, a table each; a run goes on where the file ends.

Seeds from 10100000 to 10201999 and from 10400000 to 10500999 led to choices in the code, such as how left-out
traces are judged, and tell no rates. Those of docs/results-calibration.md have seeds from 10300000 to 10311999.

Takes 10 minutes.
"""

from __future__ import annotations

import time
from itertools import product
from typing import Any, NamedTuple

import softflagella as sf
from benchmarks.common import Records, heading, per_cent, row
from calibration.verdict.verdict import Verdict
from tests.oracles.drawn_traces import FAMILIES, Design, Family, draw_traces, model_of_traces, size_at

_NULL, _PLANTED, _MIMIC = "nothing", "effect", "mimic"
_CROWDS = (3, 6, 12)  # traces of a table
_STRENGTH = 8.0  # λ
_ASKED = {
    "claimed": "an effect is claimed",
    "plainly": "without a warning",
    "right": "right, or in the set",
    "adopted": "a form is adopted",
    "differs": "repeats differ",
    "moved": "a number moved",
    "unexplained": "unexplained",
}


class TraceCase(NamedTuple):
    """How tables are drawn."""

    label: str
    design: Design
    kind: str = _NULL
    crowds: tuple[int, ...] = _CROWDS


CASES = (
    *(TraceCase(f"nothing, ρ = {rho:g}", Design(rho=rho)) for rho in (0.0, 0.5, 0.9, 0.99)),
    TraceCase("nothing, ρ = 0.5, days shift by a standard deviation", Design(day_shift=1.0)),
    TraceCase("nothing, ρ = 0.9, clocks jitter by a quarter step", Design(rho=0.9, jitter=0.25)),
    TraceCase("nothing, ρ = 0.9, no repeats", Design(rho=0.9, repeated=False)),
    TraceCase("an effect, ρ = 0.9, no repeats", Design(rho=0.9, repeated=False), _PLANTED, (6, 12)),
    *(TraceCase(f"an effect, λ = 8, ρ = {rho:g}", Design(rho=rho), _PLANTED, (6, 12)) for rho in (0.5, 0.9)),
    *(TraceCase(f"a mimic, λ = 8, ρ = {rho:g}", Design(rho=rho), _MIMIC, (6, 12)) for rho in (0.5, 0.9)),
)  # fmt: skip


def varied(case: TraceCase, seed: int) -> tuple[str, Design, str]:
    """Return the experiment of a table, its design and the term that is planted, each in turn."""
    kinds = []
    for crowd, (name, family) in product(case.crowds, FAMILIES.items()):
        terms = {_NULL: ("",), _PLANTED: tuple(e.name for e in family.effects), _MIMIC: family.mimics}[case.kind]
        kinds += [(name, case.design._replace(traces=crowd), term) for term in terms]
    return kinds[seed % len(kinds)]


def covered(verdict: Verdict, family: Family) -> list[bool]:
    """Say of each shared number whether its 95 % interval contains the truth."""
    intervals = [(verdict.final_intervals[name], truth) for name, truth in family.shared.items()]
    return [bool(low <= truth <= high) for (low, high), truth in intervals]


def said(case: TraceCase, seed: int) -> dict[str, Any]:
    """Draw a table, and say what its verdict is worth."""
    name, design, term = varied(case, seed)
    family, began = FAMILIES[name], time.process_time()
    planted: dict[str, Any] = {term: size_at(family, design, seed, term, _STRENGTH)} if term else {}
    table = draw_traces(family, design, seed, **planted)
    record = {"case": case.label, "seed": seed, "experiment": name, "traces": design.traces, "term": term}
    try:
        verdict = sf.calibrate(
            table, model_of_traces(family), trace="trace", session="day", seed=seed, progress=False
        )
    except Exception as error:
        return record | {"failed": f"{type(error).__name__}: {error}", "seconds": time.process_time() - began}
    sets = [{e.name for e in c.added} for c in verdict.claims]
    beside = [{e.name for e in c.added} for c in verdict.attribution.rival_effects]
    return record | {
        "verdict": verdict.verdict,
        "claimed": sorted(set().union(*sets)),
        "adopted": verdict.nearest.effect.name if verdict.nearest else "",
        "differs": bool(verdict.facts["differences"]),
        "moved": bool(verdict.moves),
        "unexplained": verdict.verdict == "unexplained",
        "right": bool(term) and any(term in each for each in (*sets, *beside)),
        "plainly": bool(sets) and not verdict.facts["imitable"],  # as its sentence says
        "covered": covered(verdict, family),
        "seconds": time.process_time() - began,
    }


def report(records: list[dict[str, Any]]) -> None:
    """Print the table: a row for each case, and for its parts."""
    print(heading("case", "tables", "failed", *_ASKED.values(), "intervals hold"))
    for case in CASES:
        whole = [each for each in records if each["case"] == case.label]
        parts = {case.label: whole} if whole else {}
        for key, words in (("experiment", "{}"), ("traces", "{} traces"), ("term", "{}")):
            for value in sorted({each[key] for each in whole} - {""}):
                parts[f"… {words.format(value)}"] = [each for each in whole if each[key] == value]
        for label, part in parts.items():
            judged = [each for each in part if "failed" not in each]
            held = [hit for each in judged for hit in each["covered"]]
            shares = [per_cent(sum(bool(each[key]) for each in judged), len(judged)) if judged else ""
                      for key in _ASKED]  # fmt: skip
            covered_share = per_cent(sum(held), len(held)) if held else ""
            print(row(label, len(part), len(part) - len(judged), *shares, covered_share))
    seconds = [each["seconds"] for each in records]
    print(f"\nProcessor time of a table: mean {sum(seconds) / len(seconds):.1f} s, largest {max(seconds):.1f} s")


def main(tables: str = "40", first: str = "0", chosen: str = "", file: str = "") -> None:
    records = Records(file)
    for place, case in enumerate(CASES):
        for seed in range(int(first) + 1000 * place, int(first) + 1000 * place + int(tables)):
            if any(words in case.label for words in chosen.split("|")) and seed not in records:
                records.add(said(case, seed))
    report(records.all)
