"""Effects are fitted one after the other, and it is told how long that takes."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

from calibration.attribution import effects
from common.errors import InputError


def test_a_robot_that_cannot_be_simulated_does_not_end_the_search() -> None:
    """The verdict on a swim ended with an error, as the time of a fit was measured."""
    asked: list[float] = []

    def predict(sets: Any) -> Any:
        asked.append(sets[0]["drag"])
        raise InputError("the simulation of a swim broke down")

    candidate: Any = SimpleNamespace(
        evidence=SimpleNamespace(expected=None),
        effect=SimpleNamespace(name="drag", typical=2.0, bounds=(0.0, 1.5)),
    )
    study: Any = SimpleNamespace(model=SimpleNamespace(predict=predict))
    near: Any = SimpleNamespace(parameters={"C_t": 3.0})
    assert effects._cost(study, near, candidate) > 0
    assert asked == [1.5, 1.5, 1.4]
