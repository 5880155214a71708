"""What other ways of finding an effect name, in the tables on which the loop is tested, and in published ones.

Least squares with every effect and pair of the catalogue (lmfit), of which one is chosen by BIC, by AICc, or by
F-tests, forwards, with a level of 1 % in all (Bonferroni); without a level for each session, and with one. A mixed
model (statsmodels), linear near the fit without effects, with a random level for each session, by BIC. On cups
that cool pysindy, with rates of cooling up to the cube of the excess. On swims, a quarter as many, least squares
with white noise of the poses. All of them fit all rows; the loop holds out a session, or the last third of a swim.

Usage: python -m benchmarks peers [TABLES] [FIRST_SEED] [PICTURE.png] [FOLDER]
       TABLES: of each case. A method that is not installed (extra `peers`) is left out, and named.
       FOLDER: of published tables that are not in the project.

Takes fifteen minutes, and the swims of 40 tables as much.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from importlib.util import find_spec
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from threadpoolctl import threadpool_limits

import softflagella as sf
from benchmarks.calibration.forms import FormsCase, drawn
from benchmarks.calibration.swims import hidden
from benchmarks.common import as_they_end, heading, in_parallel, per_cent, row
from calibration.own_model.model_file import load_model
from sim.knowledge import COEFFICIENTS
from tests.oracles.drawn_falls import declared
from tests.oracles.drawn_swims import drawn_swim
from tests.oracles.drawn_traces import FAMILIES, Design, draw_traces, model_of_traces, size_at
from tests.oracles.others import MODELS, SETS, named, table_of
from tests.oracles.peers import (
    LEAST_SQUARES,
    MIXED,
    NEEDS,
    Finding,
    Measured,
    by_least_squares,
    by_mixed_model,
    by_sindy,
)
from tests.oracles.swim_peers import swim_by_least_squares
from tests.oracles.swims import make_track

LOOP = "this loop"
_NULL, _PLANTED, _HELD = (
    "nothing planted: an effect is named", "one effect at 8 σ: it is among what is named", "95 % intervals hold",
)  # fmt: skip
_SWIMS = 4  # one table in so many is a swim, which takes a minute
_DRAWN = {_NULL: "C3", _PLANTED: "C2", _HELD: "C0"}


def by_loop(model: sf.Model, table: pd.DataFrame, **roles: Any) -> dict[str, Finding]:
    """Ask the loop; a form that it adopts is no claim."""
    return {LOOP: _found(sf.calibrate(table, model, progress=False, **roles))}


def _found(verdict: Any) -> Finding:
    sets = [claim.added for claim in (*verdict.claims, *verdict.attribution.rival_effects)]
    words = named(verdict.facts)
    if verdict.nearest:
        words = f"as a description: {words}"
    return Finding(frozenset(e.name for added in sets for e in added), verdict.final_intervals, words)


class Answered(NamedTuple):
    """What the methods say of one table or swim, what is planted in it, and its true numbers."""

    answers: Mapping[str, Finding]
    term: str
    truth: Mapping[str, float]


class Case(NamedTuple):
    """What the methods are asked."""

    label: str
    ask: Callable[[int], Answered]  # of a seed
    share: int = 1  # one seed in so many is asked


def _falls(case: FormsCase, seed: int) -> tuple[sf.Model, pd.DataFrame, str]:
    table, catalogue, term = drawn(case, seed)
    return declared(catalogue), table, term * bool(case.strength[1])


def _cups(rho: float, kind: str, seed: int) -> tuple[sf.Model, pd.DataFrame, str]:
    family, design = FAMILIES["cups"], Design(rho=rho)
    terms = {"effect": [e.name for e in family.effects], "mimic": list(family.mimics)}.get(kind, [""])
    term = terms[seed % len(terms)]
    planted: dict[str, Any] = {term: size_at(family, design, seed, term, 8.0)} if term else {}
    return model_of_traces(family), draw_traces(family, design, seed, **planted), term


def _of_table(draw: Any, truth: Mapping[str, float], roles: Mapping[str, str], seed: int) -> Answered:
    model, table, term = draw(seed)
    return Answered(answers_of(model, table, roles), term, truth)


def _balls(label: str, *case: Any) -> Case:
    drawn_with = partial(_falls, FormsCase("", *case))
    return Case(f"balls, {label}", partial(_of_table, drawn_with, {"viscosity": 1.0}, {"session": "round"}))


def _of_cups(label: str, *case: Any) -> Case:
    truth, roles = FAMILIES["cups"].shared, {"session": "day", "trace": "trace"}
    return Case(f"cups, {label}", partial(_of_table, partial(_cups, *case), truth, roles))


def _swim(with_effect: bool, seed: int) -> Answered:
    swim = drawn_swim(seed)
    term, truth = hidden(swim, seed) if with_effect else ("", swim.truth)
    track = make_track(truth, swim.plan, seed=seed, **swim.disturbed)
    verdict = sf.calibrate(track, swim.given, plan=swim.plan, seed=seed, jobs=1, progress=False)
    answers = {LOOP: _found(verdict), **swim_by_least_squares(swim, track)}
    return Answered(answers, term, {name: getattr(swim.truth, name) for name in COEFFICIENTS})


CASES = (
    *(_balls(f"nothing; 5 rounds scatter by {100 * scatter:.0f} %", 5, scatter) for scatter in (0.0, 0.01, 0.03)),
    _balls("one effect at 8 σ; 1 %", 5, 0.01, (8.0, 8.0)),
    _balls("one at 8 σ that is not in the catalogue", 5, 0.01, (8.0, 8.0), False),
    *(_of_cups(f"nothing; neighbours correlated by {rho}", rho, "") for rho in (0.0, 0.9)),
    _of_cups("one effect at 8 σ; 0.9", 0.9, "effect"),
    _of_cups("one at 8 σ that is not in the catalogue; 0.9", 0.9, "mimic"),
    Case("swims, nothing", partial(_swim, False), _SWIMS),
    Case("swims, one effect at 8 σ", partial(_swim, True), _SWIMS),
)


def answers_of(model: sf.Model, table: pd.DataFrame, roles: Mapping[str, str]) -> dict[str, Finding]:
    """Ask every method that is installed and applies."""
    measured = Measured.of(model, table, roles.get("session"), roles.get("trace"))
    answers = by_loop(model, table, **roles)
    for module, ask in (("lmfit", by_least_squares), ("statsmodels", by_mixed_model)):
        if find_spec("lmfit") and find_spec(module) and (module == "lmfit" or "session" in roles):
            answers |= ask(measured)
    if "T" in model.outputs and "t_s" in measured.columns and find_spec("pysindy"):
        answers |= by_sindy(measured)
    return answers


def said(place: int, seed: int) -> tuple[int, dict[str, dict[str, Any]]]:
    """Draw a table of a case, and say what every method's answer is worth."""
    threadpool_limits(1)
    answers, term, truth = CASES[place].ask(seed)
    worth = {}
    for method, answer in answers.items():
        held = [low <= truth[n] <= high for n, (low, high) in answer.intervals.items() if n in truth]
        worth[method] = {"named": bool(answer.named), "right": term in answer.named,
                         "alone": answer.named == {term}, "held": held}  # fmt: skip
    return place, worth


def published(folder: str = "") -> None:
    """Print what each method names in published tables and traces, those of a folder among them."""
    cases = [(name, folder) for name, of in SETS.items() if table_of(of, folder)]
    methods = (LOOP, *LEAST_SQUARES, MIXED)
    print("\n" + heading("published table", "withheld", *methods))
    for name, answers in as_they_end(_of_published, cases):
        cells = [answers.get(method, "–") for method in methods]
        print(row(SETS[name].title, SETS[name].withheld, *cells), flush=True)


def _of_published(name: str, folder: str) -> tuple[str, dict[str, str]]:
    """Ask every method; those beside the loop have no numbers of a specimen."""
    threadpool_limits(1)
    table = table_of(SETS[name], folder)
    assert table is not None
    model, rows = load_model(MODELS / SETS[name].model, table)
    frame = rows if isinstance(rows, pd.DataFrame) else pd.read_csv(rows)
    roles = {key: value for key in ("session", "specimen", "trace") if (value := getattr(SETS[name], key))}
    if any(number.per == "specimen" for number in model.numbers):
        answers = by_loop(model, frame, **roles)
    else:
        answers = answers_of(model, frame.dropna(), roles)
    return name, {
        method: answer.words or ", ".join(sorted(answer.named)) or "nothing" for method, answer in answers.items()
    }


def draw(shares: Mapping[str, Mapping[str, float]], picture: str) -> None:
    """Draw how often each method names an effect that is not there, and one that is, and its intervals hold."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.2, 0.5 * len(shares) + 1.2), layout="constrained")
    axes = figure.add_subplot()
    for k, (kind, colour) in enumerate(_DRAWN.items()):
        values = [of.get(kind, np.nan) for of in shares.values()]
        axes.barh(np.arange(len(shares)) + 0.27 * (k - 1), values, height=0.25, color=colour, label=kind)
    axes.set_yticks(range(len(shares)), list(shares), fontsize=9)
    axes.invert_yaxis()
    axes.set_xlim(0, 100)
    axes.set_xlabel("% of tables")
    figure.legend(loc="outside upper center", ncols=2, frameon=False, fontsize=9)
    figure.savefig(picture, dpi=110)


def main(tables: str = "40", first: str = "0", picture: str = "", folder: str = "") -> None:
    missing = sorted({module for module in NEEDS.values() if find_spec(module) is None})
    if missing:
        print(f"not installed, and left out: {', '.join(missing)}\n")
    seeds = range(int(first), int(first) + int(tables))
    asked = [(place, seed) for place, case in enumerate(CASES) for seed in seeds[:: case.share]]
    done = in_parallel(said, asked)
    shares: dict[str, dict[str, list[bool]]] = {}
    print(heading("case", "method", "names an effect", "right, or in the set", "right, alone", "intervals hold"))
    for place, case in enumerate(CASES):
        of_case = [worth for at, worth in done if at == place]
        nothing, outside = "nothing" in case.label, "not in" in case.label
        for method in dict.fromkeys(method for worth in of_case for method in worth):
            each = [worth[method] for worth in of_case if method in worth]
            held = [hit for worth in each for hit in worth["held"]]
            cells = [per_cent(sum(worth[key] for worth in each), len(each)) for key in ("named", "right", "alone")]
            print(row(case.label, method, cells[0], *(("", "") if nothing or outside else cells[1:]),
                      per_cent(sum(held), len(held)) if held else ""))  # fmt: skip
            if not outside:
                kind, key = (_NULL, "named") if nothing else (_PLANTED, "right")
                shares.setdefault(method, {}).setdefault(kind, []).extend(worth[key] for worth in each)
                shares[method].setdefault(_HELD, []).extend(held)
    if picture:
        draw({m: {k: 100 * float(np.mean(v)) for k, v in of.items() if v} for m, of in shares.items()}, picture)
    published(folder)
