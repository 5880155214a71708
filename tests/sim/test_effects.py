"""Every effect of the catalogue keeps its contract."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from sim.effects import catalogue
from sim.motion.steady import steady
from sim.motion.switching import switch_response
from sim.solve.assembly import assemble, numbers
from tests.sim.robots import control

OUTPUTS = ("omega_t", "omega_yr", "v_x", "v_z")


def test_the_folder_is_the_catalogue() -> None:
    assert {"end_over_end_drag", "anisotropic_head_drag"} <= set(catalogue())


@pytest.mark.parametrize("name", list(catalogue()))
def test_declaration(name: str) -> None:
    effect = catalogue()[name]
    assert effect.bounds[0] <= effect.null <= effect.bounds[1]
    assert effect.bounds[0] <= effect.typical <= effect.bounds[1]
    assert effect.typical != effect.null
    assert effect.equation
    assert effect.source
    assert effect.unit


@pytest.mark.parametrize("name", list(catalogue()))
def test_null_is_exactly_the_base_model(name: str) -> None:
    assert torch.equal(numbers(control(**{name: catalogue()[name].null})), numbers(control()))


@pytest.mark.parametrize("name", list(catalogue()))
def test_symmetry_visibility_and_dissipation(name: str) -> None:
    effect = catalogue()[name]
    sizes = [effect.null, effect.typical, effect.typical]
    beside = {effect.beside: catalogue()[effect.beside].typical} if effect.beside else {}
    groups = control(3, omega_bar=[10.0, 10.0, -10.0], **{**beside, name: sizes})
    motion = steady(groups)
    values = {o: getattr(motion, o) for o in OUTPUTS}
    change = max(abs(values[o][1] / values[o][0] - 1) for o in OUTPUTS)
    if change < 1e-3:  # what steady swimming hardly shows, switching must
        response = switch_response(groups.select(torch.tensor([0, 1])), np.full(2, 0.5))
        change = abs(response.net_speed[1] / response.net_speed[0] - 1)
    assert change > 1e-3
    mirrored = {"omega_t": -1, "omega_yr": -1, "v_x": -1, "v_z": 1}
    same = all(values[o][2] == pytest.approx(s * values[o][1], rel=1e-6) for o, s in mirrored.items())
    assert same == (effect.symmetry == "even")


@pytest.mark.parametrize("name", [e.name for e in catalogue().values() if e.dissipative])
@pytest.mark.parametrize("share", [0.3, 1.0])
def test_a_dissipative_effect_takes_power_and_gives_none(name: str, share: float) -> None:
    """Power into the fluid, for any motion, with the side force (which does work on the head) left out."""
    effect = catalogue()[name]
    for end in effect.bounds:
        size = effect.null + share * (end - effect.null)
        body = assemble(control(C_yr=0.0, **{name: size}))
        assert float(body.zeta_parallel) > 0
        assert float(body.zeta_perp) > 0
        assert float(body.droop) >= 0
        # Torque, bending viscosity and friction; their power: see tests/sim/mechanics.
        assert all(float(number) >= 0 for number in body.nonlocal_terms)
        R = body.resistance[..., 0]
        on_head = torch.linalg.eigvalsh((R[:, :4] + R[:, :4].T) / 2)
        assert on_head.min() > -1e-12
        assert (R[:3, 4] == 0).all()
        assert R[3, 4] >= 0  # the disc's own drag


@pytest.mark.parametrize("name", list(catalogue()))
def test_finite_over_its_bounds_and_batch_equals_loop(name: str) -> None:
    low, high = catalogue()[name].bounds
    sizes = np.linspace(low, high, 3)
    together = steady(control(3, **{name: sizes}))
    assert not together.failed.any()
    alone = steady(control(**{name: sizes[1]}))
    assert alone.omega_yr[0] == pytest.approx(together.omega_yr[1], rel=1e-12)


def test_end_over_end_drag_slows_the_turn_as_much_as_estimated() -> None:
    """About a third of ω_yr for N = 2, l = 5 cm and ε = 5."""
    short = {"l_over_R": 0.05 / 0.016, "l_over_r0": 0.05 / 0.0032, "omega_bar": 1.6}
    motion = steady(control(2, end_over_end_drag=[0.0, 5.0], **short))
    ratio = motion.omega_yr[1] / motion.omega_yr[0]
    assert 0.5 < ratio < 0.75
