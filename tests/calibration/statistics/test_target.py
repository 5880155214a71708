"""The search of a fit ends where it cannot reach the noise any more, and nowhere else."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import pytest

from calibration.statistics.fit import Fit, fit, noise_at_most
from calibration.statistics.statistical_model import Parameter, Parameters, Runs
from sim.arrays import Floats

COUNT = 60


@dataclass
class Valley:
    """One output y = x + curvature (b − a²) + 0.01 a: a narrow bent valley, along which a fit creeps."""

    offset: float  # of the data, which no parameter can remove
    calls: list[float] = field(default_factory=list)

    coefficients = (Parameter("a", "a", 3.0, (-50.0, 50.0), 1.0), Parameter("b", "b", 9.0, (-5e3, 5e3), 1.0))
    nuisances: tuple[Parameter, ...] = ()
    effects: tuple[Parameter, ...] = ()
    untestable: dict[str, str] = field(default_factory=dict)

    @property
    def runs(self) -> Runs:
        rng = np.random.default_rng(3)
        half = np.arange(COUNT) // 2
        y = 0.1 * rng.normal(size=(COUNT, 2))
        y[:, 0] += self.offset * np.where(half % 2, 1.0, -1.0)
        return Runs(
            y=y, outputs=("y", "z"), condition=half, session=half % 3, session_names=("1", "2", "3"),
            inputs=half[:, None] / COUNT, input_names=("x",), rows=np.arange(COUNT), excluded=(), caveats=(),
        )  # fmt: skip

    def predict(self, sets: list[Parameters], *, title: str = "") -> Floats:
        return np.array([self._at(p["a"], p["b"]) for p in sets])

    def derivatives(
        self, parameters: Parameters, names: list[str], *, title: str = "", quick: bool = False
    ) -> tuple[Floats, Floats]:
        a, b = parameters["a"], parameters["b"]
        self.calls.append(a)
        slopes = {"a": np.array([0.02 * a, -20 * a]), "b": np.array([0.0, 10.0])}
        table = np.stack([np.tile(slopes[name], (COUNT, 1)) for name in names], -1)
        return self._at(a, b), table

    def _at(self, a: float, b: float) -> Floats:
        return np.tile([0.01 * a**2, 10 * (b - a**2)], (COUNT, 1))


def fitted(model: Valley, target: float = np.inf) -> Fit:
    used = np.ones(COUNT, dtype=bool)
    return fit(model, {"a": 3.0, "b": 9.0}, ("a", "b"), used, target=target, title="")  # type: ignore[arg-type]


def test_a_fit_far_above_the_noise_ends_early() -> None:
    free, ended = Valley(5.0), Valley(5.0)
    best, given_up = fitted(free), fitted(ended, noise_at_most(2 * COUNT, 2))
    assert len(ended.calls) < len(free.calls)
    assert given_up.deviance == pytest.approx(best.deviance, rel=0.05)


def test_a_fit_that_reaches_the_noise_is_the_same_with_a_target() -> None:
    free, aimed = Valley(0.0), Valley(0.0)
    one, other = fitted(free), fitted(aimed, noise_at_most(2 * COUNT, 2))
    assert one.deviance < noise_at_most(2 * COUNT, 2)
    assert other.parameters == one.parameters
    assert aimed.calls == free.calls
