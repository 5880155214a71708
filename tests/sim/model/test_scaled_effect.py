"""Laws of effects that act on the tails, and of drag that differs along them."""

from __future__ import annotations

import math

import numpy as np
import pytest

from sim.effects import catalogue
from sim.model.groups import Groups
from sim.model.power_law import Powers, factor_law
from sim.model.scaled_effect import LOCAL_DRAG, SCALED, scaled_effect
from sim.motion.sensitivity import sensitivities
from sim.motion.steady import steady
from sim.solve.assembly import numbers
from tests.sim.model.test_power_law import OUTPUTS, STEEP, with_law
from tests.sim.robots import CONTROL_VALUES, control

CHANGES = {"N": 3, "l_over_R": 4.0, "omega_bar": 20.0}
NAMES = (*SCALED, *LOCAL_DRAG)


def law_of(name: str, powers: Powers = STEEP) -> str:
    return scaled_effect(LOCAL_DRAG[name] if name in LOCAL_DRAG else catalogue()[name], powers).name


def motion(groups: Groups) -> list[float]:
    solved = steady(groups)
    return [float(getattr(solved, output)[0]) for output in OUTPUTS]


@pytest.mark.parametrize("name", SCALED)
def test_a_law_of_an_effect_is_that_effect_of_another_size(name: str) -> None:
    size = catalogue()[name].typical / 2
    groups = with_law(law_of(name), size, **CHANGES)
    same = with_law(name, size * float(np.exp(STEEP.logarithm(groups)[0])), **CHANGES)
    assert np.allclose(numbers(groups), numbers(same), rtol=1e-13, atol=1e-16)
    assert motion(groups) == pytest.approx(motion(same), rel=1e-9)


def test_local_drag_by_speed_is_a_shear_thinning_fluid_of_high_shear() -> None:
    """Far above 1/λ, (1 + (λ γ̇)²)^(−ε/2) is (λ γ̇)^(−ε), and λ = e^2.5 λ_c is e^(−2.5 ε) of the law's drag."""
    longer = {"l_over_R": 2 * CONTROL_VALUES["l_over_R"], "omega_bar": 20.0}
    law = law_of("tail_drag_by_speed", Powers())
    drag = factor_law("tail_drag", Powers(length=1.0)).name
    one = motion(with_law(law, -0.1, **longer))
    fluid = {"shear_thinning": 0.1, "shear_thinning_time": 2.5, drag: 0.1 * 2.5 / math.log(2)}
    other = motion(control(**longer, **fluid))
    assert other == pytest.approx(one, rel=3e-3)
    assert motion(control(**longer)) != pytest.approx(one, rel=1e-2)


def test_drag_along_the_tail_is_larger_at_its_free_end() -> None:
    """Drag at the free end has a longer lever against yaw."""
    law = law_of("tail_drag_along", Powers())
    slower, still, faster = (abs(motion(with_law(law, size, **CHANGES))[1]) for size in (-0.5, 0.0, 0.5))
    assert still == abs(motion(control(**CHANGES))[1])
    assert slower > 1.1 * still > 1.1 * 1.1 * faster


@pytest.mark.parametrize("name", NAMES)
def test_derivatives_are_those_of_finite_differences(name: str) -> None:
    law = law_of(name)
    size, step = catalogue()[law].typical / 5, 1e-3
    if name == "tail_sag":
        step = size / 20
    values = [steady(with_law(law, size + sign * step, N=3)) for sign in (1, -1)]
    slopes = sensitivities(with_law(law, size, N=3), [law])
    for output, key in (("omega_yr", "omega_yr_bar"), ("v_x", "v_x"), ("v_z", "v_z")):
        difference = (getattr(values[0], output)[0] - getattr(values[1], output)[0]) / (2 * step)
        assert float(slopes.derivatives[key][0, 0]) == pytest.approx(difference, rel=2e-2, abs=1e-6)
