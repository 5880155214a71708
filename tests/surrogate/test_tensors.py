"""Table and simulator as functions of tensors: gradients against differences, a fit, and what is refused."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import torch
from torch import Tensor

import softflagella as sf

ROBOT = sf.load_robot("paper-control").group_values() | {"N": 3}


def columns() -> dict[str, Any]:
    """Return three robots, of which two columns require gradients, one of them for all robots."""
    C_yr = torch.tensor([1.5, 2.0, 3.0], dtype=torch.float64, requires_grad=True)
    speed = torch.tensor(10.0, dtype=torch.float64, requires_grad=True)
    return {**ROBOT, "C_yr": C_yr, "omega_bar": speed}


@pytest.mark.parametrize(("ask", "more"), [
    (sf.torch_query, {}), (sf.torch_query, {"dwell_bar": 1.0}), (sf.torch_query, {"N": 1}), (sf.torch_steady, {}),
])  # fmt: skip
def test_gradients_are_those_of_differences(ask: Callable[..., dict[str, Tensor]], more: dict[str, float]) -> None:
    given = columns() | more
    outputs = ["omega_yr_bar", "v_z"] + ["net_speed_bar"] * ("dwell_bar" in more)

    def total(robots: dict[str, Any]) -> Tensor:
        answer = ask(robots)
        return torch.stack([(answer[name] ** 2).sum() for name in outputs]).sum()

    total(given).backward()  # type: ignore[no-untyped-call]
    for name in ("C_yr", "omega_bar"):
        at = given[name].detach()
        high, low = (total({**given, name: at * (1 + s * 1e-3)}).item() for s in (1, -1))
        assert float((given[name].grad * at).sum()) == pytest.approx((high - low) / 2e-3, rel=1e-4)


def test_a_query_adds_its_jacobian() -> None:
    found = sf.query("paper-control", derivatives=True)
    robot = sf.load_robot("paper-control").group_values()
    slopes = sf.sensitivities("paper-control", ["C_yr", "omega_bar"])
    for name in ("C_yr", "omega_bar"):
        assert found[f"omega_yr_bar_per_{name}"].item() == pytest.approx(
            slopes["omega_yr_bar", name].item(), rel=0.01
        )
    named = sf.query(robot, derivatives=["end_over_end_drag"])
    assert [name for name in named if name.startswith("v_z_per")] == ["v_z_per_end_over_end_drag"]
    with pytest.raises(sf.InputError, match="no input with derivatives"):
        sf.query(robot, derivatives=["v_x"])


def test_values_without_gradients_are_those_of_the_table() -> None:
    robots = {name: np.full(2, value) for name, value in ROBOT.items()}
    answer = sf.torch_query(robots)
    wanted = sf.load_table().query(robots)
    assert {name: value.tolist() for name, value in answer.items()} == {n: v.tolist() for n, v in wanted.items()}
    assert not any(value.requires_grad for value in answer.values())


def test_what_cannot_be_is_refused() -> None:
    with pytest.raises(sf.InputError, match="N requires a gradient"):
        sf.torch_query({**ROBOT, "N": torch.tensor(3.0, requires_grad=True)})
    with pytest.raises(sf.InputError, match="differ in length"):
        sf.torch_query({**ROBOT, "C_t": torch.ones(2), "C_r": torch.ones(3)})
    with pytest.raises(sf.InputError, match="outside the look-up table"):
        sf.torch_query({**ROBOT, "omega_bar": 2000.0})
