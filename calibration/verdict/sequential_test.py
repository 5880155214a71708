"""Which of several explanations new runs speak for: the sequential use of a batch of next runs.

Each explanation was fitted before the new runs were made, and gives them a density: Gaussian about its prediction,
with covariance Σ + J Cov Jᵀ. Σ is the noise of runs and sessions, J Cov Jᵀ the error of the fit. The ratio of two
densities, of all new runs together, is an e-value. If one of the two is true, the ratio of the other to it exceeds
`next_runs.STOP` with a probability of at most 1/STOP, however often one looks (Ville 1939). So an explanation
is given up if it is behind the best one by more than 2 ln STOP. Source: Grünwald, de Heide and Koolen (2024).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from calibration.statistics.gls import Noise
from calibration.statistics.statistical_model import ForwardModel, Runs, start_values
from calibration.verdict.next_runs import GIVEN_UP, Rival
from sim.arrays import Flags, Floats
from sim.io.errors import InputError
from sim.io.reading import ContentError, read_json


@dataclass(frozen=True)
class Explanation:
    """A fitted model that explains a table, as verdict.json keeps it."""

    title: str  # in words
    parameters: dict[str, float]  # all that are fitted
    covariance: Floats  # (p, p) of them
    noise: Noise  # of runs and sessions
    outputs: tuple[str, ...]  # (k,) that were fitted
    law: Mapping[str, Any] = field(default_factory=dict)  # of a rival that is a law, see `with_law` of `standings`

    @staticmethod
    def from_rival(rival: Rival) -> Explanation:
        """Keep of a rival what a decision needs."""
        fitted = rival.fit
        parameters = {name: fitted.parameters[name] for name in fitted.names}
        outputs = tuple(rival.model.runs.outputs)
        return Explanation(rival.title, parameters, fitted.covariance, fitted.noise, outputs, rival.law)

    def record(self) -> dict[str, Any]:
        """Write it for verdict.json."""
        return {
            "title": self.title,
            "parameters": self.parameters,
            "covariance": self.covariance.tolist(),
            "noise_of_a_run": self.noise.run.tolist(),
            "share_of_sessions": np.broadcast_to(self.noise.share, len(self.outputs)).tolist(),
            "outputs": list(self.outputs),
            **({"law": dict(self.law)} if self.law else {}),
        }

    @staticmethod
    def read(record: dict[str, Any]) -> Explanation:
        """Read it from verdict.json.

        Raises:
            ValueError, TypeError, KeyError, AttributeError, OverflowError: it is none.
        """
        parameters = {str(name): float(value) for name, value in record["parameters"].items()}
        covariance, run = (np.array(record[name], dtype=float) for name in ("covariance", "noise_of_a_run"))
        outputs, share = tuple(map(str, record["outputs"])), np.array(record["share_of_sessions"], dtype=float)
        numbers = np.concatenate([covariance.ravel(), run.ravel(), share.ravel(), list(parameters.values())])
        if covariance.shape != (len(parameters),) * 2 or run.shape != (len(outputs),) * 2:
            raise ValueError
        if share.shape not in ((), (len(outputs),)):  # one of all outputs, as before
            raise ValueError
        if not np.isfinite(numbers).all():
            raise ValueError
        law = dict(record.get("law", {}))
        return Explanation(str(record["title"]), parameters, covariance, Noise(run, share), outputs, law)


@dataclass(frozen=True)
class Standing:
    """How far an explanation is behind the best one on the new runs."""

    title: str  # of the explanation
    behind: float  # 2 ln of the ratio of the densities

    @property
    def given_up(self) -> bool:
        return self.behind > GIVEN_UP


def read_explanations(path: str | Path) -> tuple[list[Explanation], set[str]]:
    """Read the explanations that the runs of a verdict.json could not tell apart, and the sessions of these runs.

    Raises:
        InputError: no such file, or its verdict has nothing to decide.
    """
    try:
        record = read_json(path)
    except ContentError as unreadable:
        raise InputError(f"{path} is not a verdict.json ({str(unreadable).removeprefix(f'{path} ')})") from None
    if not isinstance(record, dict) or not record.get("explanations"):
        raise InputError(f"{path}: this verdict has no two explanations between which new runs could decide")
    try:
        explanations = [Explanation.read(explanation) for explanation in record["explanations"]]
        return explanations, set(map(str, record["sessions"]))
    except (KeyError, TypeError, ValueError, AttributeError, OverflowError):
        raise InputError(f"{path} is no verdict.json of this version: calibrate the table again") from None


def new_runs(runs: Runs, before: set[str]) -> Flags:
    """Choose the runs (n,) of sessions that were not there before.

    Raises:
        InputError: there are none.
    """
    new = np.array([runs.session_names[s] not in before for s in runs.session])
    if not new.any():
        raise InputError(
            "all sessions of this table were there before; give the new runs a session of their own "
            "(column session)"
        )
    return new


Model = TypeVar("Model", bound=ForwardModel)


def standings(
    model: Model,
    explanations: Sequence[Explanation],
    new: Flags,
    with_law: Callable[[Model, Mapping[str, Any]], ForwardModel] | None = None,
) -> list[Standing]:
    """Judge explanations by the new runs in `new` (n,), best first.

    It takes up where `calibration.verdict.verdict.reach_verdict` says "ambiguous", and where several laws describe
    what nothing explains.

    Args:
        with_law: makes the model of a law from the model without it and the law's record.

    Raises:
        InputError: the table has other outputs than were fitted, or lacks what an effect needs.
    """
    data, scores = model.runs, []
    for explanation in explanations:
        subject: ForwardModel = model
        if explanation.law and with_law:
            subject = with_law(model, explanation.law)
        known = start_values(subject)
        if explanation.outputs != data.outputs:
            raise InputError(
                f"this table has the outputs {', '.join(data.outputs)}; the verdict was made from "
                f"{', '.join(explanation.outputs)}"
            )
        missing = [name for name in explanation.parameters if name not in known]
        if missing:
            raise InputError(
                f"{explanation.title}: these runs cannot test {', '.join(missing)}; keep every column of the "
                "table before"
            )
        parameters = {**known, **explanation.parameters}
        prediction, J = subject.derivatives(parameters, list(explanation.parameters))
        slopes = J[new].reshape(-1, J.shape[-1])
        spread = explanation.noise.covariance(data.session[new]) + slopes @ explanation.covariance @ slopes.T
        residual = (data.y - prediction)[new].ravel()
        scores.append(float(residual @ np.linalg.solve(spread, residual) + np.linalg.slogdet(spread)[1]))
    best = min(scores)
    standing = [Standing(e.title, score - best) for e, score in zip(explanations, scores, strict=True)]
    return sorted(standing, key=lambda s: s.behind)


@dataclass(frozen=True)
class Decision:
    """What new runs say about several explanations.

    Example:
        >>> from softflagella import decide
        >>> decide("runs.csv", "calibrated/verdict.json", "robot.toml").sentence  # doctest: +SKIP
        'Decided: tank wall. The next step is to calibrate with all runs.'
    """

    standings: tuple[Standing, ...]  # best first
    new_runs: int  # how many there were

    @property
    def decided(self) -> str | None:
        """The explanation that is left; None if there are several."""
        titles = [standing.title for standing in self.standings if not standing.given_up]
        return titles[0] if len(titles) == 1 else None

    @property
    def sentence(self) -> str:
        """What to do now."""
        if self.decided:
            return f"Decided: {self.decided}. The next step is to calibrate with all runs."
        titles = [standing.title for standing in self.standings if not standing.given_up]
        return f"Not decided between {' and '.join(titles)}: make more runs."


def decide(
    model: Model,
    explanations: Sequence[Explanation],
    before: set[str],
    with_law: Callable[[Model, Mapping[str, Any]], ForwardModel] | None = None,
) -> Decision:
    """Judge explanations by the runs of sessions that were not among those `before`, see `standings`.

    Raises:
        InputError: there are no new runs, or they cannot be compared with what was fitted.
    """
    new = new_runs(model.runs, before)
    return Decision(tuple(standings(model, explanations, new, with_law)), int(new.sum()))
