"""Runs that are readings of traces: the noise along a trace, and a model whose runs and predictions are white.

**Noise.** Readings of a trace have the covariance S ⊗ R (`calibration.linear.memory`). S, s and τ come from
repeated traces: what these share is no noise, so a missing effect does not hide in R. With J traces of equal
settings, at the times that all of them have, the residuals r_j of a first fit give J − 1 series

    d_c = Σ_j h_cj r_j,   h orthonormal, each row with the sum 0,

in which the model's misfit cancels. A number that each trace, session or specimen has of its own is absorbed along
its derivative. A level of a session is scatter of sessions, and no memory: where each trace is a session it is
absorbed, too; otherwise the mean of each session is taken from the residuals. Without repeats S, s and τ come from
what all parameters and effects leave of each trace. This may contain what the model lacks, so the noise counts as
unknown.

**White runs.** `Whitened` multiplies what was measured and what is predicted by L⁻¹, R = L Lᵀ, trace by trace.
Fits, tests and bootstrap see rows that are white but for S and the scatter of sessions, and know of no traces.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.linalg import helmert

from calibration.linear.gls import averaging_rows
from calibration.linear.memory import Memory, Repeats, estimate_memory
from calibration.statistics.fit import Fit, fit
from calibration.statistics.forward import derivatives
from calibration.statistics.statistical_model import (
    Experiment,
    Parameter,
    Parameters,
    Predict,
    Wrapped,
    with_runs,
)
from calibration.statistics.study import Study
from calibration.table.between_traces import repeated_traces
from calibration.table.runs import Runs
from common.arrays import Flags, Floats

_MORE = 3  # readings, beside what a series absorbs
_SEEN = 1e-8  # least share of the largest singular value
_ABSORBED = 1 / 3  # most columns of a trace without repeats, over its readings


@dataclass(frozen=True)
class Whitened(Wrapped):
    """A model of readings of traces, white along these."""

    memory: Memory

    @property
    def runs(self) -> Runs:
        inner = self.inner.runs
        known = self.__dict__.get("_white")
        if known is None or known[0] is not inner:
            known = inner, replace(inner, y=self.memory.whiten(inner.y), memory=self.memory)
            object.__setattr__(self, "_white", known)
        return known[1]

    @property
    def coefficients(self) -> tuple[Parameter, ...]:
        return self.inner.coefficients

    def predict(self, sets: Sequence[Parameters], *, title: str = "") -> Floats:
        """Predict (P, n, k), see `ForwardModel`."""
        return self._white_sets(self.inner.predict(sets, title=title))

    def linearised(
        self, at: Parameters, along: Sequence[Parameter], *, title: str = "", quick: bool = False
    ) -> Predict:
        """Return the linear model, see `ForwardModel`."""
        predict = self.inner.linearised(at, along, title=title, quick=quick)
        return lambda sets: self._white_sets(predict(sets))

    def possible(self) -> tuple[Whitened, list[dict[str, Any]]]:
        """Return traces that can be made next, in the same noise."""
        model, settings = self.inner.possible()
        return whitened(model, self.memory.share, self.memory.tau), settings  # type: ignore[arg-type]

    def _white_sets(self, predictions: Floats) -> Floats:
        return np.moveaxis(self.memory.whiten(np.moveaxis(predictions, 0, -1)), -1, 0)


def whitened(model: Experiment, share: float, tau: float) -> Whitened:
    """Make a model of readings of traces white in noise with a memory, see `Memory`."""
    runs = model.runs
    assert runs.trace is not None
    assert runs.time is not None
    return Whitened(model, Memory(runs.trace, runs.time, share, tau))


def whiten_traces(study: Study, start: dict[str, float]) -> tuple[Study, dict[str, float]]:
    """Estimate the noise of a study's traces from a first fit, and let its model be white in it.

    Returns:
        The study, and the parameters of the first fit.
    """
    plain, used = study.model, study.split.fitted
    runs = plain.runs
    spread = (runs.y - plain.predict([start])[0])[used].var(0)
    rough = np.where(spread > 0, spread, 1.0)
    model = with_runs(plain, noise_known=False, sigma=np.sqrt(rough))
    names = tuple(p.name for p in (*model.coefficients, *model.nuisances))
    first = fit(model, start, names, used, title="fit" if study.progress else "")
    # Repeats are compared with each other, not with the model, so those too take part that are held out.
    residual, repeats = _without_sessions(runs, runs.y - first.prediction), list(_repeats(first, runs))
    known = bool(repeats) and runs.noise_known
    noise = estimate_memory(repeats or list(_of_each_trace(study, first, used)), residual)
    changes = {"noise_of_traces": noise, "noise_known": known, "sigma": None}
    inner: Any = with_runs(plain, **changes, states=_states(runs, first.prediction))
    return replace(study, model=whitened(inner, noise.share, noise.tau)), first.parameters


def _repeats(first: Fit, runs: Runs) -> Iterator[Repeats]:
    """Yield each set of repeated traces."""
    own = _places_of_numbers(first)
    for rows in repeated_traces(runs):  # (J, t)
        assert runs.time is not None
        time, along = runs.time[rows].mean(0), first.jacobian[rows]  # (J, t, k, p)
        columns = [along[..., places].sum(-1).mean(0) for places in own.values()]  # (t, k) each
        level = np.ones((len(time), int(runs.traces_are_sessions)))
        absorbed = np.column_stack([level, *columns])
        if len(time) >= absorbed.shape[1] + _MORE:
            yield Repeats(rows, helmert(len(rows)), time, absorbed)


def _without_sessions(runs: Runs, residual: Floats) -> Floats:
    """Take the mean of each session from a residual (n, k), where sessions have several traces."""
    if runs.traces_are_sessions:
        return residual
    picks, sizes = averaging_rows(runs.session)
    return residual - ((picks @ residual) / np.sqrt(sizes)[:, None])[runs.session]


def _places_of_numbers(first: Fit) -> dict[str, list[int]]:
    """Find what groups have of each number of their own among the parameters of a fit."""
    own: dict[str, list[int]] = {}
    for place, parameter in enumerate(first.fitted):
        if parameter.of_group:
            own.setdefault(parameter.of_group[0], []).append(place)
    return own


def _of_each_trace(study: Study, first: Fit, used: Flags) -> Iterator[Repeats]:
    """Yield each trace alone; parameters and effects may change its residual to any amount."""
    runs = study.model.runs
    assert runs.trace is not None
    assert runs.time is not None
    effects = derivatives(first.model, first.parameters, study.effects)[1]
    every = np.concatenate([first.jacobian, effects], -1)
    for trace in np.unique(runs.trace[used]):
        rows = np.flatnonzero(used & (runs.trace == trace))
        columns = np.column_stack([np.ones(len(rows)), every[rows].reshape(len(rows), -1)])
        columns = columns / np.maximum(np.abs(columns).max(0), 1e-300)
        vectors, sizes, _ = np.linalg.svd(columns, full_matrices=False)
        seen = min(int((sizes > _SEEN * sizes[0]).sum()), int(_ABSORBED * len(rows)))
        yield Repeats(rows[None], np.ones((1, 1)), runs.time[rows], vectors[:, :seen])


def _states(runs: Runs, prediction: Floats) -> dict[str, Floats]:
    """Name what a residual may depend on beside settings and time: each output, and its rate of change."""
    assert runs.trace is not None
    assert runs.time is not None
    states: dict[str, Floats] = {}
    for place, name in enumerate(runs.outputs):
        values, rate = prediction[:, place], np.zeros(len(runs))
        for trace in np.unique(runs.trace):
            rows = np.flatnonzero(runs.trace == trace)
            time, first = np.unique(runs.time[rows], return_index=True)
            slope = np.gradient(values[rows][first], time)
            rate[rows] = np.interp(runs.time[rows], time, slope)
        states |= {name: values, f"rate of {name}": rate}
    return states
