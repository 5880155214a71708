"""Which of several explanations new runs speak for: the sequential use of a batch of next runs.

Each explanation was fitted before the new runs were made, and gives them a density: Gaussian about its prediction,
with covariance Σ + J Cov Jᵀ. Σ is the noise of runs and sessions, J Cov Jᵀ the error of the fit. The ratio of two
densities, of all new runs together, is an e-value. If one of the two is true, the ratio of the other to it exceeds
`discriminate.STOP` with a probability of at most 1/STOP, however often one looks (Ville 1939). So an explanation
is given up if it is behind the best one by more than 2 ln STOP. Source: Grünwald, de Heide and Koolen (2024).
"""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from calibration.discriminate import STOP
from calibration.fit import Fit
from calibration.model import Model, Runs
from sim.arrays import Flags, Floats
from sim.io.errors import InputError

GIVEN_UP = 2 * math.log(STOP)


@dataclass(frozen=True)
class Explanation:
    """A fitted model that explains a table, as verdict.json keeps it."""

    title: str
    parameters: dict[str, float]  # all that are fitted
    covariance: Floats  # (p, p) of them
    run: Floats  # (k, k) covariance of a run
    share: float  # ρ of the sessions

    @staticmethod
    def of(title: str, fitted: Fit) -> Explanation:
        parameters = {name: fitted.parameters[name] for name in fitted.names}
        return Explanation(title, parameters, fitted.covariance, fitted.noise.run, fitted.noise.share)

    def record(self) -> dict[str, Any]:
        arrays = {"covariance": self.covariance.tolist(), "run": self.run.tolist()}
        return {**vars(self), **arrays}


@dataclass(frozen=True)
class Standing:
    """How far an explanation is behind the best one on the new runs."""

    title: str
    behind: float  # 2 ln of the ratio of the densities

    @property
    def given_up(self) -> bool:
        return self.behind > GIVEN_UP


def read_explanations(path: str | Path) -> tuple[list[Explanation], set[str]]:
    """Explanations that the runs of a verdict.json could not tell apart, and the sessions of these runs.

    Raises:
        InputError: no such file, or its verdict has nothing to decide.
    """
    try:
        record = json.loads(Path(path).read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(f"{path}: {error.strerror}") from None
    except ValueError:
        raise InputError(f"{path} is not a verdict.json") from None
    if not isinstance(record, dict) or not record.get("explanations"):
        raise InputError(f"{path}: this verdict has no two explanations between which new runs could decide")
    found = [
        Explanation(**{**one, "covariance": np.array(one["covariance"]), "run": np.array(one["run"])})
        for one in record["explanations"]
    ]
    return found, set(record["sessions"])


def new_runs(runs: Runs, before: set[str]) -> Flags:
    """Runs (n,) of sessions that were not there before.

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


def standings(model: Model, explanations: Sequence[Explanation], new: Flags) -> list[Standing]:
    """How explanations stand after the new runs in `new` (n,), best first.

    Raises:
        InputError: the table has not the outputs that were fitted.
    """
    data = model.runs
    scores = []
    for one in explanations:
        if len(one.run) != data.y.shape[1]:
            raise InputError("the table must have the outputs of the table that the verdict was made from")
        known = {p.name: p.start for p in (*model.coefficients, *model.given, *model.effects)}
        prediction, J = model.derivatives({**known, **one.parameters}, list(one.parameters))
        same = (data.session[new][:, None] == data.session[new]).astype(float)
        spread = np.kron(np.eye(int(new.sum())) + one.share * same, one.run)
        slopes = J[new].reshape(-1, J.shape[-1])
        spread += slopes @ one.covariance @ slopes.T
        left = (data.y - prediction)[new].ravel()
        scores.append(float(left @ np.linalg.solve(spread, left) + np.linalg.slogdet(spread)[1]))
    found = [Standing(one.title, score - min(scores)) for one, score in zip(explanations, scores, strict=True)]
    return sorted(found, key=lambda s: s.behind)


def sentence(found: Sequence[Standing]) -> str:
    """What to do now."""
    left = [s.title for s in found if not s.given_up]
    if len(left) == 1:
        return f"Decided: {left[0]}. The next step is to close the loop with all runs."
    return f"Not decided between {' and '.join(left)}: make more runs."
