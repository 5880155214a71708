"""Other ways of finding an effect in a table: least squares with criteria, mixed models, sparse regression.

They are what one would write with lmfit, statsmodels and pysindy, each fitted to all rows.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from scipy.stats import f as f_distribution

import softflagella as sf
from common.arrays import Floats
from tests.oracles.drawn_traces import AIR

MIXED, SINDY = "mixed model, BIC", "pysindy"
_CRITERIA = ("BIC", "AICc", "F-tests")
_LEVELS = {"": False, ", a level a session": True}
LEAST_SQUARES = tuple(f"{criterion}{levels}" for criterion in _CRITERIA for levels in _LEVELS)
NEEDS = {**dict.fromkeys(LEAST_SQUARES, "lmfit"), MIXED: "statsmodels", SINDY: "pysindy"}
_ALPHA, TAIL = 0.01, 1.959964  # level of the F-tests; of a 95 % interval
_STEP = 1e-4  # of derivatives, in typical sizes


class Finding(NamedTuple):
    """What a method says of a table."""

    named: frozenset[str]  # effects
    intervals: Mapping[str, tuple[float, float]]  # 95 %, of numbers that all rows share
    words: str = ""  # what is named, where that is not all


@dataclass(frozen=True)
class Measured:
    """A table as least squares have it."""

    model: sf.Model
    columns: Mapping[str, Any]  # (n,) each
    parts: Sequence[Any]  # rows of each trace, or of all
    session: Floats  # (n,) numbers from 0

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
        return cls(model, columns, parts, codes)

    @property
    def own(self) -> tuple[str, ...]:
        """Numbers that each part has of its own."""
        return tuple(number.name for number in self.model.numbers if number.per == "trace")

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


def sets_of(names: Sequence[str]) -> Iterator[tuple[str, ...]]:
    """List no effect, each, and each pair."""
    return (some for count in range(3) for some in combinations(names, count))


def _intervals(table: Measured, fitted: Any) -> dict[str, tuple[float, float]]:
    shared = [number.name for number in table.model.numbers if number.name not in table.own]
    found = {name: (fitted.params[name].value, fitted.params[name].stderr) for name in shared}
    return {n: (v - TAIL * s, v + TAIL * s) for n, (v, s) in found.items() if s is not None}


def by_least_squares(table: Measured) -> dict[str, Finding]:
    """Choose among all fits by each criterion."""
    answers: dict[str, Finding] = {}
    for words, levels in _LEVELS.items():
        fits = {
            some: least_squares(table, some, levels=levels)
            for some in sets_of([e.name for e in table.model.effects])
        }
        chosen = by_criteria(fits)
        answers |= {
            f"{how}{words}": Finding(frozenset(some), _intervals(table, fits[some]))
            for how, some in chosen.items()
        }
    return answers


def by_criteria(fits: Mapping[tuple[str, ...], Any]) -> dict[str, tuple[str, ...]]:
    """Choose among fits, each with numbers as a result of lmfit has them, by each of the criteria."""

    def corrected(fit: Any) -> float:
        k = fit.nvarys + 1
        return float(fit.aic + 2 + 2 * k * (k + 1) / max(fit.ndata - k - 1, 1))

    return {
        "BIC": min(fits, key=lambda some: fits[some].bic),
        "AICc": min(fits, key=lambda some: corrected(fits[some])),
        "F-tests": forwards(fits),
    }


def forwards(fits: Mapping[tuple[str, ...], Any]) -> tuple[str, ...]:
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


def by_mixed_model(table: Measured) -> dict[str, Finding]:
    """Choose by BIC among mixed models that are linear near the fit without effects; none if no fit succeeds."""
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
    for some in sets_of([e.name for e in table.model.effects]):
        columns = np.column_stack([slopes[name] for name in (*numbers, *some)])
        # Powell's search: the default one diverges where levels hardly scatter. Some fits have a singular matrix.
        with warnings.catch_warnings(), suppress(np.linalg.LinAlgError):
            warnings.simplefilter("ignore")
            fits[some] = MixedLM(table.y - at, columns, groups).fit(reml=False, method="powell")
    if not fits:
        return {}
    k = len(numbers) + 2
    chosen = min(fits, key=lambda some: (k + len(some)) * np.log(len(at)) - 2 * fits[some].llf)
    fitted, found = fits[chosen], {}
    for place, name in enumerate(numbers):
        change, error = (steps[name] * float(each[place]) for each in (fitted.fe_params, fitted.bse_fe))
        found[name] = (base[name] + change - TAIL * error, base[name] + change + TAIL * error)
    return {MIXED: Finding(frozenset(chosen), found)}


def by_sindy(table: Measured) -> dict[str, Finding]:
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
    return {SINDY: Finding(frozenset(name for name, there in terms.items() if name and there), {})}
