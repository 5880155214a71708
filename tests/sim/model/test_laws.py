"""Laws that state themselves by name: the catalogue's own formulas, derivatives, symmetry, names."""

from __future__ import annotations

import math
from itertools import product

import numpy as np
import pytest

from common.arrays import Floats
from common.errors import InputError
from sim.effects import catalogue, check_effects, effect_named, is_effect
from sim.inputs import check_columns
from sim.model.groups import Groups
from sim.model.laws import (
    COEFFICIENTS,
    LOCAL_DRAG,
    MOTIONS,
    SCALED,
    TAILS,
    WRENCHES,
    Load,
    PowerLawEffect,
    Powers,
    make_law,
)
from sim.motion.sensitivity import sensitivities
from sim.motion.steady import steady
from sim.solve.assembly import assemble, numbers
from tests.sim.robots import CONTROL_VALUES, control

OUTPUTS = ("omega_t", "omega_yr", "v_x", "v_z")
STEEP = Powers(speed=0.3, length=-0.6, tails=0.5)


def with_law(name: str, size: float, **changes: object) -> Groups:
    columns = {**CONTROL_VALUES, **changes, name: size}
    return Groups.from_columns(check_columns({key: np.array([value]) for key, value in columns.items()}))


def motion(groups: Groups) -> Floats:
    solved = steady(groups)
    return np.array([getattr(solved, output)[0] for output in OUTPUTS])


@pytest.mark.parametrize(
    ("effect", "size", "wrench", "motion", "factor", "powers"),
    [
        ("end_over_end_drag", 5.0, "My", "wyr", -8 * math.pi, Powers()),
        ("disc_drag", 0.4, "Mz", "wt", -8 * math.pi, Powers()),
        ("anisotropic_head_drag", -0.2, "Fz", "vz", -6 * math.pi * CONTROL_VALUES["C_t"], Powers()),
        # M_y = ε μ0 N a² l ω_t, with a = R, is (2 l_c/R) ε μ0 R³ (l/l_c)(N/2) ω_t.
        ("surface_couple", 0.1, "My", "wt", 2 * CONTROL_VALUES["l_over_R"], Powers(length=1, tails=1)),
    ],
)
def test_a_law_with_the_formula_of_an_effect_is_that_effect(
    effect: str, size: float, wrench: str, motion: str, factor: float, powers: Powers
) -> None:
    law = make_law(Load(wrench, motion).place, powers)
    for changes in ({}, {"N": 4, "l_over_R": 4.0, "omega_bar": -20.0}):
        one = numbers(with_law(effect, size, **changes))
        assert np.allclose(numbers(with_law(law.name, size * factor, **changes)), one, rtol=1e-14, atol=0)


@pytest.mark.parametrize("coefficient", COEFFICIENTS)
def test_a_coefficient_as_a_power_law_is_that_coefficient(coefficient: str) -> None:
    law = make_law(coefficient, STEEP)
    groups = with_law(law.name, 0.7, N=3, l_over_R=4.0, omega_bar=20.0)
    factor = float(np.exp(0.7 * STEEP.logarithm(groups)[0]))
    assert abs(factor - 1) > 0.05
    symbol = COEFFICIENTS[coefficient]
    same = control(N=3, l_over_R=4.0, omega_bar=20.0, **{symbol: CONTROL_VALUES[symbol] * factor})
    assert np.allclose(assemble(groups).resistance, assemble(same).resistance, rtol=1e-13, atol=1e-16)


@pytest.mark.parametrize("name", ["tail_drag", "tail_stiffness"])
def test_a_factor_of_the_tails_is_another_unit_of_viscosity_or_time(name: str) -> None:
    """More drag: the head has less and the motor turns faster, in that unit; more stiffness: it turns slower."""
    law = make_law(name, STEEP)
    groups = with_law(law.name, 0.7, N=3, l_over_R=4.0, omega_bar=20.0)
    factor = float(np.exp(0.7 * STEEP.logarithm(groups)[0])) ** (1 if name == "tail_drag" else -1)
    head = {
        symbol: CONTROL_VALUES[symbol] / (factor if name == "tail_drag" else 1.0)
        for symbol in COEFFICIENTS.values()
    }
    other = motion(control(N=3, l_over_R=4.0, omega_bar=20.0 * factor, **head))
    assert other == pytest.approx(factor * motion(groups), rel=1e-9)


def test_no_run_tells_stiffer_tails_from_a_thinner_fluid() -> None:
    """Drag of head and tails that grows with speed is less stiffness at the same speed."""
    law = make_law("tail_stiffness", Powers(speed=-0.42))
    softer = with_law(law.name, 1.0, N=3, omega_bar=20.0)
    drag = 1 / float(law.powers.factor(softer)[0])
    slow = float(np.exp(Powers(speed=1.0).logarithm(softer)[0]))  # ω/ω_control
    denser = with_law("inertia", (drag - 1) / slow, N=3, omega_bar=20.0)
    assert motion(softer) == pytest.approx(motion(denser), rel=1e-12)


def test_the_power_law_is_in_motor_speed_and_not_in_its_group() -> None:
    """Of one material and fluid, a tail twice as long at the same speed in rad/s has 16 times the ω̄."""
    short = control(omega_bar=10.0)
    long = control(omega_bar=160.0, l_over_R=13.75, l_over_r0=68.75)
    assert float(Powers(speed=0.5).logarithm(long)[0]) == pytest.approx(
        float(Powers(speed=0.5).logarithm(short)[0]), abs=1e-14
    )
    assert float(Powers(length=0.5).logarithm(long)[0]) == pytest.approx(0.5 * math.log(2))
    assert float(Powers(tails=2).logarithm(control(N=4))[0]) == pytest.approx(2 * math.log(2))


LAWS = [
    *(make_law(Load(w, m).place, STEEP).name for w, m in product(WRENCHES, MOTIONS)),
    *(make_law(c, STEEP).name for c in (*COEFFICIENTS, *TAILS)),
    make_law("Fx_wt_l", STEEP, lever=-0.5).name,
    make_law("Fx_wyr_L", STEEP, lever=0.75).name,
]


CHANGES = {"N": 3, "l_over_R": 4.0, "omega_bar": 20.0}


def law_of(name: str, powers: Powers = STEEP) -> str:
    return make_law(catalogue().get(name, name), powers).name


@pytest.mark.parametrize("name", [*LAWS, *map(law_of, (*SCALED, *LOCAL_DRAG))])
def test_derivatives_are_those_of_finite_differences(name: str) -> None:
    size = effect_named(name).typical / 5
    step = size / 20 if "tail_sag" in name else 1e-3
    values = [steady(with_law(name, size + sign * step, N=3)) for sign in (1, -1)]
    slopes = sensitivities(with_law(name, size, N=3), [name, "l_over_R", "omega_bar"])
    for output, key in (("omega_yr", "omega_yr_bar"), ("v_x", "v_x"), ("v_z", "v_z")):
        difference = (getattr(values[0], output)[0] - getattr(values[1], output)[0]) / (2 * step)
        close = 2e-3 if name in LAWS else 2e-2
        assert float(slopes.derivatives[key][0, 0]) == pytest.approx(difference, rel=close, abs=1e-6)


@pytest.mark.parametrize("name", LAWS)
def test_a_law_is_mirror_symmetric_and_null_at_zero(name: str) -> None:
    law = effect_named(name)
    assert law.symmetry == "even"
    assert np.array_equal(numbers(with_law(name, 0.0)), numbers(control()))
    left, right = (motion(with_law(name, law.typical, omega_bar=speed)) for speed in (10.0, -10.0))
    assert right == pytest.approx(left * [-1, -1, -1, 1], rel=1e-6)


def test_a_law_is_known_by_its_name_and_not_listed() -> None:
    for name in LAWS:
        law = effect_named(name)
        assert isinstance(law, PowerLawEffect)
        assert law == make_law(law.place, law.powers, lever=law.lever)
        assert (law.name, law.powers) == (name, STEEP)
        assert is_effect(name)
        assert name not in catalogue()


NO_LAWS = [
    "Fx_wh_speed0_length0", "Fx_wh_speed007_length0_tails0", "Fx_wh_speed-0_length0_tails0",
    "Fx_speed0_length0_tails0", "Fx_wh_speed4001_length0_tails0", "Fy_wh_speed0_length0_tails0",
    "Ct_wh_speed0_length0_tails0", "Ct_rectified_speed100_length0_tails0",
    "tail_drag_wh_speed0_length0_tails0", "Fz_wt_l-500_speed0_length0_tails0",
    "Fx_wt_l-5000_speed0_length0_tails0", "Fx_wt_l-0_speed0_length0_tails0",
    "Ct_l-500_speed100_length0_tails0",
]  # fmt: skip


@pytest.mark.parametrize("name", NO_LAWS)
def test_what_is_no_name_of_a_law_is_refused(name: str) -> None:
    assert not is_effect(f"law_{name}")
    with pytest.raises(InputError, match="unknown effect"):
        check_effects({f"law_{name}": 0.1})
    with pytest.raises(InputError, match="unknown column"):
        with_law(f"law_{name}", 0.1)


@pytest.mark.parametrize(("unit", "ahead"), [("l", 1.0), ("L", CONTROL_VALUES["L_over_R"] / 4.0)])
def test_a_side_force_with_a_lever_is_a_force_and_a_couple(unit: str, ahead: float) -> None:
    """F_x at z ahead of J has M_y = z F_x about J."""
    changes = {"N": 3, "l_over_R": 4.0, "omega_bar": 20.0}
    law = make_law(f"Fx_wt_{unit}", STEEP, lever=-0.4)
    one = numbers(with_law(law.name, 0.3, **changes))
    force = numbers(with_law(make_law("Fx_wt", STEEP).name, 0.3, **changes))
    couple = numbers(with_law(make_law("My_wt", STEEP).name, -0.3 * 0.4 * ahead * 4.0, **changes))
    assert np.allclose(one, force + couple - numbers(control(**changes)), rtol=1e-13, atol=1e-16)


def test_a_lever_or_an_exponent_that_cannot_be_is_refused() -> None:
    for place, lever, message in (
        ("Fz_vz", -0.5, "'Fz_vz' has no lever"),
        ("Fx_wt_R", 0.0, "no place 'Fx_wt_R' of a law"),
        ("Fx_wt_l", 5.0, "lever = 5; it must lie from -4"),
    ):
        with pytest.raises(InputError, match=message):
            make_law(place, lever=lever)
    with pytest.raises(InputError, match=r"exponent of length = 5; it must lie from -4 to 4"):
        Powers(length=5)


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
    drag = make_law("tail_drag", Powers(length=1.0)).name
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
