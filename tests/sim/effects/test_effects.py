"""Every effect of the catalogue keeps its contract; those of hardware are what an independent solver finds."""

from __future__ import annotations

import math
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import quad

import sim.effects
from common.arrays import Floats
from common.errors import InputError
from dataset.simulate import simulate
from sim.effects import catalogue, effect_named
from sim.effects.tail_contact import least_gap
from sim.model.groups import Groups
from sim.motion.steady import orbits, steady
from sim.solve.assembly import assemble, numbers
from tests.oracles.harmonic_balance import settle_in_harmonics
from tests.oracles.plain_swimmer import NOMINAL, Hardware
from tests.oracles.switching import switch_response
from tests.processes import LIMIT
from tests.sim.robots import CONTROL_VALUES, control

OUTPUTS = ("omega_t", "omega_yr", "v_x", "v_z")
FOLDER = Path(sim.effects.__file__).parent

NEW_EFFECT = """
from sim.model.effect import Effect, Factors

EFFECT = Effect(
    name="{reach}_one", title="stickiness", equation="drag × (1 + ε)", source="none", unit="1", null=0.0,
    bounds=(0.0, 1.0), typical=0.1, symmetry="even", dissipative=True, reach={reach!r},
    scales=lambda size, groups: Factors(drag=1 + size),
)
"""


def test_the_folder_is_the_catalogue() -> None:
    assert list(catalogue()) == sorted(f.stem for f in FOLDER.glob("*.py") if f.stem != "__init__")


def test_a_misspelt_effect_is_told_the_nearest_one() -> None:
    for name, told in (("disc_darg", "is it disc_drag"), ("tumble", "known are anisotropic")):
        with pytest.raises(InputError, match=f"unknown effect '{name}'; {told}"):
            effect_named(name)


def test_adding_an_effect_is_adding_a_file(tmp_path: Path) -> None:
    """Columns, sizes, numbers of the body and candidates of the calibration follow from the file alone."""
    for package in ("sim", "calibration", "surrogate", "dataset", "planner"):
        shutil.copytree(
            FOLDER.parents[1] / package, tmp_path / package, ignore=shutil.ignore_patterns("__pycache__")
        )
    for reach in ("local", "nonlocal"):
        (tmp_path / "sim" / "effects" / f"{reach}_one.py").write_text(NEW_EFFECT.format(reach=reach))
    code = """
import numpy as np
from calibration.swimmer.influences import influences
from sim.inputs import check_columns
from sim.model.groups import Groups
from sim.model.presets import PRESETS
from sim.solve.assembly import bodies
columns = {**PRESETS["paper-control"].group_values(), "local_one": 0.5, "nonlocal_one": 0.25}
values = check_columns({name: np.array([value]) for name, value in columns.items()})
body = bodies(Groups.from_columns(values))[0]
assert {"local_one", "nonlocal_one"} <= set(influences())
print(body.resistance[3, 3], body.nonlocal_terms.nonlocal_one, hasattr(body.nonlocal_terms, "local_one"))
"""
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=True, timeout=LIMIT
    )
    spin, number, local = done.stdout.split()
    assert float(spin) == pytest.approx(1.5 * 1.25 * float(assemble(control()).resistance[3, 3, 0]))
    assert (number, local) == ("0.25", "False")


def test_the_order_of_effects_does_not_matter() -> None:
    """Terms are added, then factors multiply: inertia scales the drag of terms that come after it, too."""
    names = list(catalogue())
    sizes = {name: catalogue()[name].typical for name in names}
    for seed in range(5):
        shuffled = [names[i] for i in np.random.default_rng(seed).permutation(len(names))]
        one, other = (numbers(control(**{name: sizes[name] for name in order})) for order in (names, shuffled))
        assert np.allclose(one, other, rtol=1e-13, atol=0)
    disc, both = assemble(control(disc_drag=0.4)), assemble(control(inertia=0.1, disc_drag=0.4))
    assert float(both.resistance[3, 4, 0]) == pytest.approx(1.1 * float(disc.resistance[3, 4, 0]))


@pytest.mark.parametrize("name", [name for name in catalogue() if name != "viscosity_drift"])
def test_dynamic_similarity_is_kept_or_said_to_be_broken(name: str) -> None:
    """At viscosity f and speed ω a robot moves as at viscosity 1 and speed f ω, all rates divided by f."""
    effect = catalogue()[name]
    sizes = {name: effect.typical}
    if effect.beside:
        sizes[effect.beside] = catalogue()[effect.beside].typical
    drift, speed = 0.3, 2.0
    factor = np.exp(-drift)
    thin = orbits(control(N=4, omega_bar=speed, viscosity_drift=drift, **sizes))
    slow = orbits(control(N=4, omega_bar=speed * factor, **sizes))
    away = max(abs(getattr(thin, o)[0] * factor / getattr(slow, o)[0] - 1) for o in OUTPUTS)
    assert (away < 5e-7) == effect.similar
    if not effect.similar:
        assert away > 1e-6


@pytest.mark.parametrize("name", list(catalogue()))
def test_an_effect_declares_its_size_and_is_nothing_at_its_null(name: str) -> None:
    effect = catalogue()[name]
    assert effect.bounds[0] <= effect.null <= effect.bounds[1]
    assert effect.bounds[0] <= effect.typical <= effect.bounds[1]
    assert effect.typical != effect.null
    assert effect.equation
    assert effect.source
    assert effect.unit
    assert np.array_equal(numbers(control(**{name: effect.null})), numbers(control()))


@pytest.mark.parametrize("name", list(catalogue()))
def test_symmetry_visibility_and_dissipation(name: str) -> None:
    effect = catalogue()[name]
    sizes = [effect.null, effect.typical, effect.typical]
    beside = {effect.beside: catalogue()[effect.beside].typical} if effect.beside else {}
    speed, where = (30.0, {"N": 4}) if name == "tail_contact" else (10.0, {})  # tails must touch to feel it
    groups = control(3, omega_bar=[speed, speed, -speed], **{**where, **beside, name: sizes})
    motion = steady(groups)
    values = {o: getattr(motion, o) for o in OUTPUTS}
    change = max(abs(values[o][1] / values[o][0] - 1) for o in OUTPUTS)
    if change < 1e-3:  # what steady swimming hardly shows, switching must
        response = switch_response(groups.select(np.array([0, 1])), np.full(2, 0.5))
        change = abs(response.net_speed[1] / response.net_speed[0] - 1)
    assert change > 1e-3
    mirrored = {"omega_t": -1, "omega_yr": -1, "v_x": -1, "v_z": 1}
    same = all(values[o][2] == pytest.approx(s * values[o][1], rel=1e-6) for o, s in mirrored.items())
    assert same == (effect.symmetry == "even")


@pytest.mark.parametrize("name", [e.name for e in catalogue().values() if e.dissipative])
def test_a_dissipative_effect_takes_power_and_gives_none(name: str) -> None:
    """Power into the fluid, for any motion, with the side force (which does work on the head) left out."""
    effect = catalogue()[name]
    for size in np.linspace(*effect.bounds, 5):
        body = assemble(control(C_yr=0.0, **{name: size}))
        assert body.zeta_parallel.item() > 0
        assert body.zeta_perp.item() > 0
        assert body.droop.item() >= 0
        # Torque, bending viscosity and friction; their power: see tests/sim/mechanics.
        for term, number in body.nonlocal_terms._asdict().items():
            assert term not in catalogue() or catalogue()[term].grid or number.item() >= 0
        R = body.resistance[..., 0]
        on_head = np.linalg.eigvalsh((R[:, :4] + R[:, :4].T) / 2)
        assert on_head.min() > -1e-12
        assert (R[:3, 4] == 0).all()
        assert R[3, 4] >= 0  # the disc's own drag


@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=pytest.mark.rest if n == "free_surface" else ()) for n in catalogue()]
)
def test_robots_move_at_both_ends_of_its_bounds(name: str) -> None:
    assert not steady(control(2, **{name: catalogue()[name].bounds})).failed.any()


def test_end_over_end_drag_slows_the_turn_as_much_as_estimated() -> None:
    """About a third of ω_yr for N = 2, l = 5 cm and ε = 5."""
    short = {"l_over_R": 0.05 / 0.016, "l_over_r0": 0.05 / 0.0032, "omega_bar": 1.6}
    motion = steady(control(2, end_over_end_drag=[0.0, 5.0], **short))
    ratio = motion.omega_yr[1] / motion.omega_yr[0]
    assert 0.5 < ratio < 0.75


@pytest.mark.rates
def test_a_row_with_contact_is_valid_where_its_gap_is_kept() -> None:
    """0.99 of a diameter: overlap without contact, within its limit with it."""
    assert least_gap([0.0, 0.5, 1.0]).tolist() == [1.0, 0.98, 0.98]
    groups = {**CONTROL_VALUES, "N": 4.0, "omega_bar": 60.0, "l_over_r0": 22.0, "history": False}
    inputs = {name: np.array([value, value]) for name, value in groups.items()}
    rows = simulate({**inputs, "tail_contact": np.array([0.0, 1.0])})
    assert rows["tail_gap"][0] < 0.6
    assert 0.98 < rows["tail_gap"][1] < 1.0
    assert rows["touching"].tolist() == [True, False]
    assert not rows["failed"].any()


WITHIN = 5e-4


def here(groups: Groups) -> Floats:
    motion = steady(groups)
    return np.array([motion.omega_t[0], motion.omega_yr[0], motion.v_x[0], motion.v_z[0]])


def independent(groups: Groups, hardware: Hardware = NOMINAL) -> Floats:
    coarse, fine = (settle_in_harmonics(groups, hardware, edges=edges) for edges in (8, 16))
    return np.asarray((4 * fine - coarse) / 3)


@pytest.mark.parametrize(("N", "omega_bar"), [(1, -5.0), (3, 30.0)])
def test_equal_tails_move_as_in_the_simulator(N: int, omega_bar: float) -> None:
    groups = control(N=N, omega_bar=omega_bar)
    assert here(groups) == pytest.approx(independent(groups), rel=WITHIN)


@pytest.mark.parametrize(
    ("name", "size", "hardware", "within"),
    [
        ("root_compliance", 0.1, Hardware(compliance=0.1), 3e-3),
        ("stratified_viscosity", 0.05, Hardware(stratification=0.05 * 6.875), WITHIN),
    ],
)
def test_an_effect_on_the_tails_changes_the_motion_as_in_the_independent_solver(
    name: str, size: float, hardware: Hardware, within: float
) -> None:
    groups = control(N=2, omega_bar=10.0)
    changed = here(replace(groups, effects={name: np.array([size])}))
    assert changed[:3] == pytest.approx(independent(groups, hardware)[:3], rel=WITHIN)
    assert changed[3] == pytest.approx(independent(groups, hardware)[3], rel=within)
    assert np.abs(changed / here(groups) - 1).max() > 20 * WITHIN


def test_the_same_clamps_give_less_to_shorter_tails_in_their_units() -> None:
    """α/M in rad/(N m) is the same for tails of 11 and 5.5 cm; l/EI is half as large for the shorter."""
    lengths = control(2, l_over_R=[6.875, 6.875 / 2], l_over_r0=[34.375, 34.375 / 2], root_compliance=0.1)
    assert assemble(lengths).nonlocal_terms.root_compliance == pytest.approx([0.1, 0.2])


@pytest.mark.parametrize("size", [-0.1, 0.1])
def test_immersion_changes_the_head_as_far_as_it_is_wetted(size: float) -> None:
    level = math.asin(0.7) + size
    before, after = (assemble(control(immersion_by_weight=s)).resistance[..., 0] for s in (0.0, size))
    arcs = [(-math.pi - end, end) for end in (math.asin(0.7), level)]
    side, spin = ([quad(f, *arc)[0] for arc in arcs] for f in (math.sin, lambda _: 1.0))
    assert after[0, 3] / before[0, 3] == pytest.approx(side[1] / side[0])
    assert after[3, 3] / before[3, 3] == pytest.approx(spin[1] / spin[0])
    assert after[1, 1] / before[1, 1] == pytest.approx(spin[1] / spin[0])


def test_a_head_that_turns_about_its_centre_of_drag_has_no_drag() -> None:
    groups = control(head_drag_centre=0.2)
    R = assemble(groups).resistance[..., 0]
    ahead = 0.7 * (groups.L_over_R / groups.l_over_R).item()  # of J
    assert R[:, :4] @ [-ahead, 0, 1, 0] == pytest.approx(0, abs=1e-12)
