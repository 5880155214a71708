"""Laws that state themselves by name: the catalogue's own formulas, derivatives, symmetry, names."""

from __future__ import annotations

import math
from itertools import product

import numpy as np
import pytest

from sim.effects import catalogue, check_size
from sim.inputs import check_columns
from sim.io.errors import InputError
from sim.model.groups import Groups
from sim.model.power_law import (
    COEFFICIENTS,
    MOTIONS,
    TAILS,
    WRENCHES,
    Powers,
    factor_law,
    force_law,
    law_from_name,
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


@pytest.mark.parametrize(
    ("effect", "size", "wrench", "motion", "factor"),
    [
        ("end_over_end_drag", 5.0, "My", "wyr", -8 * math.pi),
        ("disc_drag", 0.4, "Mz", "wt", -8 * math.pi),
        ("anisotropic_head_drag", -0.2, "Fz", "vz", -6 * math.pi * CONTROL_VALUES["C_t"]),
    ],
)
def test_a_law_with_the_formula_of_an_effect_is_that_effect(
    effect: str, size: float, wrench: str, motion: str, factor: float
) -> None:
    law = force_law(wrench, motion, Powers())
    for changes in ({}, {"N": 4, "l_over_R": 4.0, "omega_bar": -20.0}):
        one = numbers(with_law(effect, size, **changes))
        assert np.allclose(numbers(with_law(law.name, size * factor, **changes)), one, rtol=1e-14, atol=0)


def test_a_couple_linear_in_length_and_number_is_that_of_tails_under_the_surface() -> None:
    """M_y = ε μ0 N a² l ω_t, with a = R, is (2 l_c/R) ε μ0 R³ (l/l_c)(N/2) ω_t."""
    law = force_law("My", "wt", Powers(length=1, tails=1))
    for changes in ({}, {"N": 4, "l_over_R": 4.0, "omega_bar": -20.0}):
        one = numbers(with_law("surface_couple", 0.1, **changes))
        other = numbers(with_law(law.name, 0.1 * 2 * CONTROL_VALUES["l_over_R"], **changes))
        assert np.allclose(other, one, rtol=1e-14, atol=0)


@pytest.mark.parametrize("coefficient", COEFFICIENTS)
def test_a_coefficient_as_a_power_law_is_that_coefficient(coefficient: str) -> None:
    law = factor_law(coefficient, STEEP)
    groups = with_law(law.name, 0.7, N=3, l_over_R=4.0, omega_bar=20.0)
    factor = float(np.exp(0.7 * STEEP.logarithm(groups)[0]))
    assert abs(factor - 1) > 0.05
    symbol = COEFFICIENTS[coefficient]
    same = control(N=3, l_over_R=4.0, omega_bar=20.0, **{symbol: CONTROL_VALUES[symbol] * factor})
    assert np.allclose(assemble(groups).resistance, assemble(same).resistance, rtol=1e-13, atol=1e-16)


def test_drag_of_the_tails_is_that_of_a_viscous_fluid_around_the_tails_alone() -> None:
    """In units of that fluid, the head has less drag and the motor turns faster."""
    law = factor_law("tail_drag", STEEP)
    groups = with_law(law.name, 0.7, N=3, l_over_R=4.0, omega_bar=20.0)
    factor = float(np.exp(0.7 * STEEP.logarithm(groups)[0]))
    head = {symbol: CONTROL_VALUES[symbol] / factor for symbol in COEFFICIENTS.values()}
    one, other = steady(groups), steady(control(N=3, l_over_R=4.0, omega_bar=20.0 * factor, **head))
    for output in OUTPUTS:
        assert float(getattr(other, output)[0]) == pytest.approx(factor * float(getattr(one, output)[0]), rel=1e-9)


def test_stiffness_of_the_tails_is_a_slower_motor_in_its_unit_of_time() -> None:
    law = factor_law("tail_stiffness", STEEP)
    groups = with_law(law.name, 0.7, N=3, l_over_R=4.0, omega_bar=20.0)
    factor = float(np.exp(0.7 * STEEP.logarithm(groups)[0]))
    one, other = steady(groups), steady(control(N=3, l_over_R=4.0, omega_bar=20.0 / factor))
    for output in OUTPUTS:
        assert factor * float(getattr(other, output)[0]) == pytest.approx(float(getattr(one, output)[0]), rel=1e-9)


def test_no_run_tells_stiffer_tails_from_a_thinner_fluid() -> None:
    """Drag of head and tails that grows with speed is less stiffness at the same speed."""
    law = factor_law("tail_stiffness", Powers(speed=-0.42))
    softer = with_law(law.name, 1.0, N=3, omega_bar=20.0)
    drag = 1 / float(np.exp(law.powers.logarithm(softer)[0]))  # type: ignore[attr-defined]
    slow = float(np.exp(Powers(speed=1.0).logarithm(softer)[0]))  # ω/ω_control
    denser = with_law("inertia", (drag - 1) / slow, N=3, omega_bar=20.0)
    for output in OUTPUTS:
        one, other = getattr(steady(softer), output), getattr(steady(denser), output)
        assert float(one[0]) == pytest.approx(float(other[0]), rel=1e-12)


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
    *(force_law(w, m, STEEP).name for w, m in product(WRENCHES, MOTIONS)),
    *(factor_law(c, STEEP).name for c in (*COEFFICIENTS, *TAILS)),
    force_law("Fx", "wt", STEEP, lever=-0.5, lever_unit="l").name,
    force_law("Fx", "wyr", STEEP, lever=0.75, lever_unit="L").name,
]


@pytest.mark.parametrize("name", LAWS)
def test_derivatives_are_those_of_finite_differences(name: str) -> None:
    size, step = catalogue()[name].typical / 5, 1e-3
    values = [steady(with_law(name, size + sign * step, N=3)) for sign in (1, -1)]
    slopes = sensitivities(with_law(name, size, N=3), [name, "l_over_R", "omega_bar"])
    for output, key in (("omega_yr", "omega_yr_bar"), ("v_x", "v_x"), ("v_z", "v_z")):
        difference = (getattr(values[0], output)[0] - getattr(values[1], output)[0]) / (2 * step)
        assert float(slopes.derivatives[key][0, 0]) == pytest.approx(difference, rel=2e-3, abs=1e-6)


@pytest.mark.parametrize("name", LAWS)
def test_a_law_is_mirror_symmetric_and_null_at_zero(name: str) -> None:
    law = catalogue()[name]
    assert law.symmetry == "even"
    assert np.array_equal(numbers(with_law(name, 0.0)), numbers(control()))
    left, right = (steady(with_law(name, law.typical, omega_bar=speed)) for speed in (10.0, -10.0))
    for output, odd in (("omega_yr", -1), ("v_x", -1), ("v_z", 1)):
        assert float(getattr(right, output)[0]) == pytest.approx(odd * float(getattr(left, output)[0]), rel=1e-6)


def test_a_law_is_known_by_its_name_and_not_listed() -> None:
    for name in LAWS:
        law = law_from_name(name)
        assert law is not None
        assert law.name == name
        assert name in catalogue()
        assert name not in list(catalogue())


@pytest.mark.parametrize(
    "name",
    [
        "law_Fx_wh_speed0_length0",
        "law_Fx_wh_speed007_length0_tails0",
        "law_Fx_wh_speed-0_length0_tails0",
        "law_Fx_wh_speed4001_length0_tails0",
        "law_Fy_wh_speed0_length0_tails0",
        "law_Fx_speed0_length0_tails0",
        "law_Ct_wh_speed0_length0_tails0",
        "law_tail_drag_wh_speed0_length0_tails0",
        "law_Ct_rectified_speed100_length0_tails0",
        "law_Fz_wt_l-500_speed0_length0_tails0",
        "law_Fx_wt_l-5000_speed0_length0_tails0",
        "law_Fx_wt_l-0_speed0_length0_tails0",
        "law_Ct_l-500_speed100_length0_tails0",
    ],
)
def test_what_is_no_name_of_a_law_is_refused(name: str) -> None:
    assert name not in catalogue()
    with pytest.raises(InputError, match="unknown effect"):
        check_size(name, 0.1)
    with pytest.raises(InputError, match="unknown column"):
        with_law(name, 0.1)


@pytest.mark.parametrize(("unit", "ahead"), [("l", 1.0), ("L", CONTROL_VALUES["L_over_R"] / 4.0)])
def test_a_side_force_with_a_lever_is_a_force_and_a_couple(unit: str, ahead: float) -> None:
    """F_x at z ahead of J has M_y = z F_x about J."""
    changes = {"N": 3, "l_over_R": 4.0, "omega_bar": 20.0}
    law = force_law("Fx", "wt", STEEP, lever=-0.4, lever_unit=unit)
    one = numbers(with_law(law.name, 0.3, **changes))
    force = numbers(with_law(force_law("Fx", "wt", STEEP).name, 0.3, **changes))
    couple = numbers(with_law(force_law("My", "wt", STEEP).name, -0.3 * 0.4 * ahead * 4.0, **changes))
    assert np.allclose(one, force + couple - numbers(control(**changes)), rtol=1e-13, atol=1e-16)


@pytest.mark.parametrize(
    ("wrench", "lever", "unit", "message"),
    [("Fz", -0.5, "l", "only Fx has one"), ("Fx", 1.0, "R", "only Fx has one"), ("Fx", 5.0, "l", "from -4 to 4")],
)
def test_a_lever_that_cannot_be_is_refused(wrench: str, lever: float, unit: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        force_law(wrench, "wt", Powers(), lever=lever, lever_unit=unit)


def test_an_exponent_out_of_its_bounds_is_refused() -> None:
    with pytest.raises(InputError, match=r"exponent of length = 5; it must lie from -4 to 4"):
        Powers(length=5)
