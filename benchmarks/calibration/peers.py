"""What other ways of finding an effect name, in the tables on which the loop is tested, and in published ones.

Least squares with every effect and pair of the catalogue (lmfit), of which one is chosen by BIC, by AICc, or by
F-tests, forwards, with a level of 1 % in all (Bonferroni); without a level for each session, and with one. A mixed
model (statsmodels), linear near the fit without effects, with a random level for each session, by BIC. On cups
that cool pysindy, with rates of cooling up to the cube of the excess. All of them fit all rows; the loop holds out
a session.

Usage: python -m benchmarks peers [TABLES] [FIRST_SEED] [PICTURE.png]
       TABLES: of each case. A method that is not installed (extra `peers`) is left out, and named.

Takes 20 minutes.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from importlib.util import find_spec
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from scipy.stats import f as f_distribution
from threadpoolctl import threadpool_limits

import softflagella as sf
from benchmarks.calibration.forms import PLANTED, FormsCase, length
from benchmarks.common import heading, in_parallel, per_cent, row
from calibration.own_model.model_file import load_model
from common.arrays import Floats
from tests.oracles.drawn_falls import EFFECTS, declared, falls
from tests.oracles.drawn_traces import AIR, FAMILIES, Design, draw_traces, model_of_traces, size_at
from tests.oracles.others import MODELS, SETS

LOOP, MIXED, SINDY = "this loop", "mixed model, BIC", "pysindy"
_CRITERIA = ("BIC", "AICc", "F-tests")
_LEVELS = {"": False, ", a level a session": True}
LEAST_SQUARES = tuple(f"{criterion}{levels}" for criterion in _CRITERIA for levels in _LEVELS)
NEEDS = {**dict.fromkeys(LEAST_SQUARES, "lmfit"), MIXED: "statsmodels", SINDY: "pysindy"}
_ALPHA, _TAIL = 0.01, 1.959964  # level of the F-tests; of a 95 % interval
_STEP = 1e-4  # of derivatives, in typical sizes


class Answer(NamedTuple):
    """What a method says of a table."""

    named: frozenset[str]  # effects
    intervals: Mapping[str, tuple[float, float]]  # 95 %, of numbers that all rows share


@dataclass(frozen=True)
class Measured:
    """A table as least squares have it."""

    model: sf.Model
    columns: Mapping[str, Any]  # (n,) each
    parts: Sequence[Any]  # rows of each trace, or of all
    session: Floats  # (n,) numbers from 0
    own: tuple[str, ...]  # numbers that each part has of its own

    @classmethod
    def of(cls, model: sf.Model, table: pd.DataFrame, session: str | None, trace: str | None) -> Measured:
        """Read a table whose columns are those that the model asks for."""
        columns = {str(name): table[name].to_numpy() for name in table}
        parts = [np.arange(len(table))] if trace is None else [
            np.flatnonzero(columns[trace] == name) for name in dict.fromkeys(columns[trace])
        ]  # fmt: skip
        codes = (
            np.zeros(len(table))
            if session is None
            else np.unique(columns[session], return_inverse=True)[1].astype(float)
        )
        return cls(model, columns, parts, codes, tuple(n.name for n in model.numbers if n.per == "trace"))

    def scaled(self, output: str, values: Any) -> Floats:
        """Return an output on the scale on which it is fitted."""
        return np.log(values) if self.model.outputs[output].kind == "ratio" else np.asarray(values, dtype=float)

    @property
    def y(self) -> Floats:
        """What was measured, (k n,)."""
        return np.concatenate([self.scaled(o, self.columns[o]) for o in self.model.outputs])

    def predict(self, p: Mapping[str, float]) -> Floats:
        """Compute all outputs (k n,) of numbers by name; those of a part have its place behind their name."""
        result = {output: np.empty(len(self.session)) for output in self.model.outputs}
        for place, rows in enumerate(self.parts):
            of_part = {**p, **{name: p[f"{name}_{place}"] for name in self.own}}
            seen = self.model.function({name: of[rows] for name, of in self.columns.items()}, of_part)
            for output, values in seen.items():
                result[output][rows] = self.scaled(output, values)
        return np.concatenate([result[output] for output in self.model.outputs])

    def start(self) -> dict[str, Any]:
        """List the parameters of all numbers: name -> as declared."""
        found: dict[str, Any] = {}
        for number in self.model.numbers:
            places = range(len(self.parts)) if number.name in self.own else [None]
            found |= {number.name if k is None else f"{number.name}_{k}": number.parameter for k in places}
        return found


def least_squares(table: Measured, effects: Sequence[str], *, levels: bool) -> Any:
    """Fit numbers, some effects and, if wanted, a level for each session; return the result of lmfit."""
    import lmfit

    parameters, catalogue = lmfit.Parameters(), {e.name: e.parameter for e in table.model.effects}
    for name, p in {**table.start(), **catalogue}.items():
        start = p.start + (0.2 * p.typical if name in effects else 0.0)
        parameters.add(name, float(np.clip(start, *p.bounds)), min=p.bounds[0], max=p.bounds[1],
                       vary=name not in catalogue or name in effects)  # fmt: skip
    sessions = np.unique(table.session)[1:] if levels else np.empty(0)
    for of in sessions:
        parameters.add(f"level_{of:.0f}", 0.0)
    y, outputs = table.y, len(table.model.outputs)
    which = [np.tile(table.session == of, outputs) for of in sessions]

    def residual(p: Any) -> Floats:
        values = p.valuesdict()
        shift = sum(
            (values[f"level_{of:.0f}"] * rows for of, rows in zip(sessions, which, strict=True)), np.zeros(1)
        )
        left = y - table.predict(values) - shift
        return np.nan_to_num(left, nan=1e3, posinf=1e3, neginf=-1e3)

    return lmfit.minimize(residual, parameters, method="leastsq", max_nfev=2000)


def _sets(table: Measured) -> Iterator[tuple[str, ...]]:
    """List no effect, each, and each pair."""
    names = [effect.name for effect in table.model.effects]
    return (some for count in range(3) for some in combinations(names, count))


def _intervals(table: Measured, fitted: Any) -> dict[str, tuple[float, float]]:
    shared = [number.name for number in table.model.numbers if number.name not in table.own]
    found = {name: (fitted.params[name].value, fitted.params[name].stderr) for name in shared}
    return {n: (v - _TAIL * s, v + _TAIL * s) for n, (v, s) in found.items() if s is not None}


def by_least_squares(table: Measured) -> dict[str, Answer]:
    """Choose among all fits by each criterion."""
    answers: dict[str, Answer] = {}
    for words, levels in _LEVELS.items():
        fits = {some: least_squares(table, some, levels=levels) for some in _sets(table)}

        def corrected(fit: Any) -> float:
            k = fit.nvarys + 1
            return float(fit.aic + 2 + 2 * k * (k + 1) / max(fit.ndata - k - 1, 1))

        chosen = {
            "BIC": min(fits, key=lambda some: fits[some].bic),
            "AICc": min(fits, key=lambda some: corrected(fits[some])),
            "F-tests": _forwards(fits),
        }
        answers |= {
            f"{how}{words}": Answer(frozenset(some), _intervals(table, fits[some])) for how, some in chosen.items()
        }
    return answers


def _forwards(fits: Mapping[tuple[str, ...], Any]) -> tuple[str, ...]:
    """Add the effect that lowers the residual most, as long as its F-test is significant."""
    here: tuple[str, ...] = ()
    while wider := [some for some in fits if len(some) == len(here) + 1 and set(here) <= set(some)]:
        best = min(wider, key=lambda some: fits[some].chisqr)
        freedom = fits[best].ndata - fits[best].nvarys
        ratio = (fits[here].chisqr - fits[best].chisqr) / (fits[best].chisqr / freedom)
        if f_distribution.sf(max(ratio, 0.0), 1, freedom) > _ALPHA / len(wider):
            break
        here = best
    return here


def by_mixed_model(table: Measured) -> dict[str, Answer]:
    """Choose by BIC among mixed models that are linear near the fit without effects."""
    from statsmodels.regression.mixed_linear_model import MixedLM

    base = least_squares(table, (), levels=False).params.valuesdict()
    steps = {
        **{n: (abs(base[n]) or 1.0) for n in table.start()},
        **{e.name: e.parameter.typical for e in table.model.effects},
    }
    at = table.predict(base)
    slopes = {n: (table.predict({**base, n: base[n] + _STEP * s}) - at) / _STEP for n, s in steps.items()}
    groups, fits = np.tile(table.session, len(table.model.outputs)), {}
    numbers = list(table.start())
    for some in _sets(table):
        columns = np.column_stack([slopes[name] for name in (*numbers, *some)])
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            fits[some] = MixedLM(table.y - at, columns, groups).fit(reml=False)
    k = len(numbers) + 2
    chosen = min(fits, key=lambda some: (k + len(some)) * np.log(len(at)) - 2 * fits[some].llf)
    fitted, found = fits[chosen], {}
    for place, name in enumerate(numbers):
        change, error = (steps[name] * float(each[place]) for each in (fitted.fe_params, fitted.bse_fe))
        found[name] = (base[name] + change - _TAIL * error, base[name] + change + _TAIL * error)
    return {MIXED: Answer(frozenset(chosen), found)}


def by_sindy(table: Measured) -> dict[str, Answer]:
    """Name the terms of the rate of cooling that sequential thresholding keeps."""
    import pysindy

    excess = [table.columns["T"][rows][:, None] - AIR for rows in table.parts]
    times = [table.columns["t_s"][rows] for rows in table.parts]
    # In units of 50 K and of the time constant, so that one threshold suits all terms.
    search = pysindy.SINDy(
        optimizer=pysindy.STLSQ(threshold=0.05), feature_library=pysindy.PolynomialLibrary(degree=3),
        differentiation_method=pysindy.SmoothedFiniteDifference(),
    )  # fmt: skip
    search.fit([each / 50 for each in excess], t=[each / 900 for each in times])
    kept = np.abs(search.coefficients()[0]) > 0
    terms = dict(zip(("warming", "", "radiation", "evaporation"), kept, strict=True))
    return {SINDY: Answer(frozenset(name for name, there in terms.items() if name and there), {})}


def by_loop(model: sf.Model, table: pd.DataFrame, **roles: Any) -> dict[str, Answer]:
    """Ask the loop."""
    verdict = sf.calibrate(table, model, progress=False, **roles)
    sets = [claim.added for claim in (*verdict.claims, *verdict.attribution.rival_effects)]
    return {LOOP: Answer(frozenset(e.name for added in sets for e in added), verdict.final_intervals)}


class Case(NamedTuple):
    """How tables are drawn."""

    label: str
    draw: Callable[[int], tuple[sf.Model, pd.DataFrame, str]]  # seed -> model, table, what is planted
    truth: Mapping[str, float]
    roles: Mapping[str, str]


def _falls(case: FormsCase, seed: int) -> tuple[sf.Model, pd.DataFrame, str]:
    term = PLANTED[seed % len(PLANTED)] if case.strength[1] else ""
    planted: dict[str, Any] = {term: case.strength[0] / length(term, case)} if term else {}
    names = [effect.name for effect in EFFECTS if case.in_catalogue or effect.name != term]
    return declared(names), falls(seed, rounds=case.rounds, scatter=case.scatter, **planted), term


def _cups(rho: float, kind: str, seed: int) -> tuple[sf.Model, pd.DataFrame, str]:
    family, design = FAMILIES["cups"], Design(rho=rho)
    terms = {"effect": [e.name for e in family.effects], "mimic": list(family.mimics)}.get(kind, [""])
    term = terms[seed % len(terms)]
    planted: dict[str, Any] = {term: size_at(family, design, seed, term, 8.0)} if term else {}
    return model_of_traces(family), draw_traces(family, design, seed, **planted), term


def _balls(label: str, *drawn: Any) -> Case:
    return Case(
        f"balls, {label}", partial(_falls, FormsCase("", *drawn)), {"viscosity": 1.0}, {"session": "round"}
    )


def _of_cups(label: str, *drawn: Any) -> Case:
    truth, roles = FAMILIES["cups"].shared, {"session": "day", "trace": "trace"}
    return Case(f"cups, {label}", partial(_cups, *drawn), truth, roles)


CASES = (
    *(_balls(f"nothing; 5 rounds scatter by {100 * scatter:.0f} %", 5, scatter) for scatter in (0.0, 0.01, 0.03)),
    _balls("one effect at 8 σ; 1 %", 5, 0.01, (8.0, 8.0)),
    _balls("one at 8 σ that is not in the catalogue", 5, 0.01, (8.0, 8.0), False),
    *(_of_cups(f"nothing; neighbours correlated by {rho}", rho, "") for rho in (0.0, 0.9)),
    _of_cups("one effect at 8 σ; 0.9", 0.9, "effect"),
    _of_cups("one at 8 σ that is not in the catalogue; 0.9", 0.9, "mimic"),
)


def answers_of(model: sf.Model, table: pd.DataFrame, roles: Mapping[str, str]) -> dict[str, Answer]:
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
    case = CASES[place]
    model, table, term = case.draw(seed)
    worth = {}
    for method, answer in answers_of(model, table, case.roles).items():
        held = [low <= case.truth[n] <= high for n, (low, high) in answer.intervals.items() if n in case.truth]
        worth[method] = {"named": bool(answer.named), "right": term in answer.named,
                         "alone": answer.named == {term}, "held": held}  # fmt: skip
    return place, worth


def published() -> None:
    """Print what each method names in the published tables of runs, without and with a level for each session."""
    sets = {name: of for name, of in SETS.items() if of.table and of.trace is None}
    rows = in_parallel(_of_published, [(name,) for name in sets])
    methods = [method for method in (LOOP, *LEAST_SQUARES, MIXED) if any(method in answers for _, answers in rows)]
    print("\n" + heading("published table", "withheld", *methods))
    for name, answers in rows:
        print(row(sets[name].title, sets[name].withheld, *(answers.get(method, "–") for method in methods)))


def _of_published(name: str) -> tuple[str, dict[str, str]]:
    threadpool_limits(1)
    model, table = load_model(MODELS / SETS[name].model, MODELS / "data" / SETS[name].table)
    frame = table if isinstance(table, pd.DataFrame) else pd.read_csv(table)
    roles = {key: value for key in ("session", "specimen") if (value := getattr(SETS[name], key))}
    answers = answers_of(model, frame.dropna(), roles)
    return name, {method: ", ".join(sorted(answer.named)) or "nothing" for method, answer in answers.items()}


def draw(shares: Mapping[str, Mapping[str, float]], picture: str) -> None:
    """Draw for each method how often it names an effect that is not there, and one that is."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.2, 0.42 * len(shares) + 1.2), layout="constrained")
    axes = figure.add_subplot()
    for k, (kind, colour) in enumerate(
        (("nothing planted: names an effect", "C1"), ("one effect at 8 σ: right, alone", "C2"))
    ):
        values = [of.get(kind, np.nan) for of in shares.values()]
        axes.barh(np.arange(len(shares)) + 0.2 - 0.4 * k, values, height=0.36, color=colour, label=kind)
    axes.set_yticks(range(len(shares)), list(shares), fontsize=9)
    axes.invert_yaxis()
    axes.set_xlim(0, 100)
    axes.set_xlabel("% of tables")
    figure.legend(loc="outside upper center", ncols=2, frameon=False, fontsize=9)
    figure.savefig(picture, dpi=110)


def main(tables: str = "40", first: str = "0", picture: str = "") -> None:
    missing = sorted({module for module in NEEDS.values() if find_spec(module) is None})
    if missing:
        print(f"not installed, and left out: {', '.join(missing)}\n")
    seeds = range(int(first), int(first) + int(tables))
    done = in_parallel(said, [(place, seed) for place in range(len(CASES)) for seed in seeds])
    shares: dict[str, dict[str, list[bool]]] = {}
    print(heading("case", "method", "names an effect", "right, or in the set", "right, alone", "intervals hold"))
    for place, case in enumerate(CASES):
        of_case = [worth for at, worth in done if at == place]
        nothing, outside = "nothing" in case.label, "not in" in case.label
        for method in of_case[0]:
            each = [worth[method] for worth in of_case]
            held = [hit for worth in each for hit in worth["held"]]
            cells = [per_cent(sum(worth[key] for worth in each), len(each)) for key in ("named", "right", "alone")]
            print(row(case.label, method, cells[0], *(("", "") if nothing or outside else cells[1:]),
                      per_cent(sum(held), len(held)) if held else ""))  # fmt: skip
            if not outside:
                kind, key = (("nothing planted: names an effect", "named") if nothing
                             else ("one effect at 8 σ: right, alone", "alone"))  # fmt: skip
                shares.setdefault(method, {}).setdefault(kind, []).extend(worth[key] for worth in each)
    if picture:
        draw({m: {k: 100 * float(np.mean(v)) for k, v in of.items()} for m, of in shares.items()}, picture)
    published()
