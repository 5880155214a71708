"""A query, the wrench of the tails and the balance of the head: golden answers, differences, another method."""

from __future__ import annotations

import copy
import pickle
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from common.errors import InputError
from sim.effects import catalogue, effect_named
from sim.mechanics.linear_theory import linear_filament
from sim.model.groups import DWELL, Groups
from sim.model.response import DWELLS, SETTLED
from sim.motion.batches import steady_columns
from sim.solve.assembly import bodies
from sim.solve.refinement import orbit_on_mesh
from surrogate.domain import INSIDE, ROBOT
from surrogate.held_out import certified_error
from surrogate.interface import OutsideError
from surrogate.intervals import GROUPS
from surrogate.table import NeuralTable
from surrogate.table_file import load
from surrogate.tails import (
    linear_thrust,
    linear_torque,
    needs_no_learning,
    pack_robots,
    packed_robots,
    robots_of,
    straight_resistance,
    unpack_robots,
)
from surrogate.training.fits import wrench_samples
from surrogate.training.simulated import draw_robots
from tests.oracles import query
from tests.oracles.query import answer
from tests.sim.robots import mean_tail_wrench
from tests.surrogate.small import robots_inside, rows, table

ONE = {"C_t": 3.0, "C_r": 2.8, "C_yr": 2.0, "l_over_R": 6.875, "L_over_R": 3.75, "l_over_r0": 34.375,
       "omega_bar": 10.0, "N": 3.0, "a_over_R": 1.0}  # fmt: skip
KNOWN = [name for name in catalogue() if needs_no_learning(name)]
OF_SPEED = ("v_x", "v_z", "lag_x", "lag_z", "net_speed_bar")  # differences of numbers of this size
FLAT = ("R_yr_over_l", "theta_deg")  # ill-conditioned where a robot moves straight ahead, or hardly at all


def robots(count: int = 400, seed: int = 5) -> dict[str, np.ndarray]:
    """Draw robots with two to eight tails, every third with its motor reversed; some are outside the domain."""
    drawn = draw_robots(count, seed, wide=True)
    rows = np.arange(count)
    speed = drawn["omega_bar"] * np.where(rows % 3 == 0, -1.0, 1.0)
    return drawn | {"N": 2.0 + rows % 7, "omega_bar": speed}


def check_same(found: dict[str, np.ndarray], wanted: dict[str, np.ndarray], tolerance: float = 1e-10) -> None:
    """Compare outputs, velocities and lags relative to their size."""
    assert (found["outside"] == wanted["outside"]).all()
    known = ~wanted["outside"]
    assert known.mean() > 0.3
    speed = np.hypot(wanted["v_x"], wanted["v_z"])
    for name in wanted:
        if name != "outside" and not name.endswith("_half"):
            size = speed if name in OF_SPEED else np.abs(wanted[name])
            size = size + np.abs(wanted["omega_yr_bar"]) if name == "lag_psi_rad" else size
            finite = known & np.isfinite(wanted[name])
            apart = np.abs(found[name][finite] - wanted[name][finite])
            bound = tolerance * (100 if name in FLAT else 1)
            assert (apart <= bound * size[finite] + 1e-300).all(), name


LAW = "law_Fx_wt_rectified_speed-100_length1000_tails1000"


@pytest.mark.parametrize("name", ["", *KNOWN, LAW])
def test_robots_with_every_effect_that_the_table_knows(name: str) -> None:
    drawn = robots()
    if name:
        effect = effect_named(name)
        random = np.random.default_rng(len(name))
        drawn[name] = np.clip(effect.typical * random.uniform(-1, 1, 400), *effect.bounds)
    check_same(load().query(drawn, flag=True), answer(load(), drawn))


SINGLE: dict[str, dict[str, Any]] = {
    "plain": {},
    "with couples and droop": {"surface_couple": np.linspace(-1, 1, 400), "motor_droop": np.tile([0.0, 2.0], 200)},
}


@pytest.mark.parametrize("case", SINGLE)
def test_robots_with_one_tail(case: str) -> None:
    drawn = {name: values for name, values in robots().items() if name in ROBOT}
    drawn |= {"N": np.ones(400)} | SINGLE[case]
    found = load().query(drawn, flag=True)
    check_same(found, answer(load(), drawn))
    assert np.isinf(found["tail_gap"]).all()


def check_widths(lookup: NeuralTable, drawn: dict[str, np.ndarray], found: dict[str, np.ndarray]) -> None:
    """Compare the widths of intervals."""
    wanted, known = answer(lookup, drawn), ~found["outside"]
    names = [name for name in found if f"{name}_half" in wanted]
    assert len(names) >= 8
    for name in names:
        half = wanted[f"{name}_half"]
        rows = known & np.isfinite(found[name])  # a single tail has no gap
        width = (found[f"{name}_high"][rows] - found[f"{name}_low"][rows]) / 2
        size = np.abs(found[name][rows]) + half[rows]
        assert (np.abs(width - half[rows]) <= 1e-8 * half[rows] + 1e-13 * size).all(), name


@pytest.mark.parametrize("at_once", [1, 7, 2000])
@pytest.mark.parametrize("with_dwell", [False, True])
def test_any_number_of_robots_at_once(with_dwell: bool, at_once: int) -> None:
    """Short, long and very long dwells, knots among them; one to eight tails where there are none."""
    count = {1: 100, 7: 400, 2000: 2000}[at_once]
    drawn = robots(count)
    if with_dwell:
        drawn[DWELL] = np.concatenate([np.geomspace(0.2, 80.0, count - 3), [0.2, 4.0, 1.0]])
    else:
        drawn["N"] = 1.0 + np.arange(count) % 8
    parts = [slice(start, start + at_once) for start in range(0, count, at_once)]
    answers = [load().query({k: v[part] for k, v in drawn.items()}, flag=True, intervals=True) for part in parts]
    found = {name: np.concatenate([one[name] for one in answers]) for name in answers[0]}
    check_same(found, answer(load(), drawn))
    check_widths(load(), drawn, found)


def test_widths_of_intervals_with_a_spread_of_the_members() -> None:
    drawn = robots_inside(40)
    drawn[DWELL] = np.geomspace(0.3, 8.0, len(drawn["N"]))
    check_widths(table(), drawn, table().query(drawn, flag=True, intervals=True))


@pytest.mark.parametrize("effect", ["", "surface_couple", "left_right_bias"])
def test_robots_with_couples_in_yaw_have_factors_of_their_own(effect: str) -> None:
    drawn = {name: values for name, values in robots(8).items() if name in ROBOT}
    drawn |= {effect: np.full(8, 0.05)} if effect else {}
    factors = np.ones(1), np.repeat([1.0, 3.0], GROUPS // 2)
    one, two = (with_factor(load(), factor) for factor in factors)
    before, after = (lookup.query(drawn, flag=True, intervals=True) for lookup in (one, two))
    known = ~after["outside"]
    assert known.sum() > 2
    assert two.intervals is not None
    for name in [name for name in before if name in two.intervals.factor]:
        narrow, wide = ((found[f"{name}_high"] - found[f"{name}_low"])[known] for found in (before, after))
        assert wide == pytest.approx((3 if effect else 1) * narrow, rel=1e-6), name


def with_factor(lookup: NeuralTable, factor: np.ndarray) -> NeuralTable:
    assert lookup.intervals is not None
    factors = dict.fromkeys(lookup.intervals.factor, factor)
    return replace(lookup, intervals=replace(lookup.intervals, factor=factors))


def test_a_table_without_networks_for_two_tails() -> None:
    drawn = robots_inside(4) | {"N": np.full(4, 2.0)}
    with pytest.raises(InputError, match="none with as many tails"):
        table().query(drawn)
    found = table().query(drawn, flag=True)
    assert found["outside"].all()
    assert np.isnan(found["omega_yr_bar"]).all()


def one(**changes: float) -> dict[str, np.ndarray]:
    return {name: np.array([value]) for name, value in (ONE | changes).items()}


def test_lists_and_integers_are_answered_alike_and_answers_do_not_change() -> None:
    wanted = load().query(one())
    kept = {name: values.copy() for name, values in wanted.items()}
    load().query(one(omega_bar=20.0))
    assert wanted == kept
    for columns in (
        {name: values.tolist() for name, values in one().items()},
        {**one(), "N": np.array([3])},
        {name: values for name, values in one().items() if name != "a_over_R"},
        {**one(), "end_over_end_drag": np.zeros(1)},
    ):
        assert load().query(columns) == wanted


def test_a_table_can_be_copied_and_pickled_after_a_query() -> None:
    lookup = load()
    wanted, before = lookup.query(one(), intervals=True), lookup.identity
    for copied in (copy.deepcopy(lookup), pickle.loads(pickle.dumps(lookup))):
        assert copied.query(one(), intervals=True) == wanted
        assert copied.identity == before


def test_a_head_without_side_force_has_no_learned_response() -> None:
    """Its steady motion has; so does one that an effect turns around."""
    straight = one(C_yr=0.0)
    assert load().query(straight)["v_z"] > 0
    for ask in (
        lambda **options: load().query({**straight, DWELL: np.ones(1)}, **options),
        lambda **options: load().response(straight, **options),
    ):
        with pytest.raises(OutsideError, match="no side force"):
            ask()
        ask(flag=True)
    assert load().query({**straight, DWELL: np.ones(1)}, flag=True)["outside"].all()


REFUSED: list[tuple[dict[str, float], str]] = [
    ({"omega_bar": 2000.0}, "row 1 is outside the look-up table.*omega_bar = 2000, learned were"),
    ({"C_yr": 900.0, "C_t": 0.01}, "outside the look-up table"), ({"N": 65.0}, "integer from 1 to 64"),
    ({"nonsense": 1.0}, "unknown column 'nonsense'"), ({"N": 1.0, DWELL: 1.0}, "the response of one tail"),
    ({DWELL: 0.1}, "give a dwell from 0.2 on"), ({DWELL: float("inf")}, "give a dwell from 0.2 on"),
    ({DWELL: 0.1, "omega_bar": 2000.0}, "outside the look-up table"),
    ({"tail_sag": 0.1}, "changes more than head, disc and motor"),
]  # fmt: skip


@pytest.mark.parametrize(("changes", "message"), REFUSED)
def test_refusals(changes: dict[str, float], message: str) -> None:
    with pytest.raises(InputError, match=message):
        load().query(one(**changes))


def test_words_missing_columns_and_one_robot_of_several_are_refused() -> None:
    with pytest.raises(InputError, match="no number"):
        load().query({**one(), "C_t": np.array(["many"])})
    with pytest.raises(InputError, match="missing column 'C_t'"):
        load().query({name: values for name, values in one().items() if name != "C_t"})
    three = {name: np.repeat(values, 3) for name, values in one().items()}
    with pytest.raises(OutsideError) as refused:
        load().query({**three, "omega_bar": three["omega_bar"] * [1, 1, 300]})
    assert refused.value.row == 2


def test_derivatives_are_those_of_wider_differences() -> None:
    """Of groups, of an effect, and of the dwell; negative motor speeds among them."""
    drawn = {name: values for name, values in robots(12).items() if name in ROBOT}
    drawn |= {DWELL: np.geomspace(0.6, 5.0, 12), "end_over_end_drag": np.full(12, 0.5)}
    inside = np.flatnonzero(~load().query(drawn, flag=True)["outside"])
    drawn = {name: values[inside] for name, values in drawn.items()}
    names = ["C_t", "omega_bar", "a_over_R", "end_over_end_drag", DWELL]
    slopes = load().derivatives(drawn, names)
    for name in names:
        value = drawn[name]
        width = 2e-3 * np.abs(value)
        one, two = (
            [load().query({**drawn, name: value + s * k * width}, flag=True) for s in (1, -1)] for k in (1, 2)
        )
        for output in ("omega_yr_bar", "v_z", "theta_deg", "net_speed_bar"):
            near, far = (high[output] - low[output] for high, low in (one, two))
            wanted = (8 * near - far) / (12 * width)  # of fourth order
            allowed = 2e-5 * np.abs(wanted).max() + 1e-9
            assert slopes[output][name] == pytest.approx(wanted, rel=2e-4, abs=allowed), (name, output)


@pytest.mark.parametrize("name", ["N", "v_z", DWELL])
def test_what_has_no_derivatives_is_refused(name: str) -> None:
    with pytest.raises(InputError, match="no input with derivatives"):
        load().derivatives(one(), [name])


def test_a_certified_error_is_the_difference_from_the_simulator() -> None:
    robots = robots_inside(3)
    answer = table().query(robots, certify=True)
    assert (answer["certified_error"] < 0.3).all()
    wrong = {**answer, "omega_yr_bar": 1.5 * answer["omega_yr_bar"]}
    assert (certified_error(robots, wrong) > 0.4).all()


def test_responses_are_curves_that_end_constant() -> None:
    robots = robots_inside()
    found = table().response(robots)
    late = DWELLS >= SETTLED
    assert late.sum() >= 2
    assert np.allclose(np.diff(found.lag[:, late], axis=1), 0, atol=1e-12)
    assert (found.spread >= 0).all()
    assert np.isfinite(found.net_speed).all()
    assert found.lag.shape == (len(robots["N"]), len(DWELLS), 3)


def test_odd_effects_and_short_dwells_have_no_learned_response() -> None:
    robots = robots_inside(1)
    with pytest.raises(InputError, match="left and right turns differ"):
        table().response({**robots, "left_right_bias": np.array([0.1])})
    with pytest.raises(InputError, match="dwell_bar = 0"):
        table().query({**robots, "dwell_bar": np.array([0.01])})


@pytest.mark.parametrize("effect", [name for name in catalogue() if needs_no_learning(name)])
def test_effects_on_head_disc_and_motor_need_no_learning(effect: str) -> None:
    """The shipped table is right with the effect, in both directions of the motor."""
    robot = {"C_t": 3.0, "C_r": 2.8, "C_yr": 2.0, "l_over_R": 6.875, "L_over_R": 3.75, "l_over_r0": 34.375,
             "omega_bar": 10.0, "N": 4.0}  # fmt: skip
    both = {name: np.array([value, value]) for name, value in robot.items()}
    both["omega_bar"] = both["omega_bar"] * [1.0, -1.0]
    both[effect] = np.full(2, catalogue()[effect].typical)
    truth, answer = steady_columns(both, title="", jobs=1), load().query(both)
    for name in ("omega_yr_bar", "omega_t_bar", "v_x", "R_yr_over_l"):
        assert answer[name] == pytest.approx(truth[name], rel=0.005), name
    if catalogue()[effect].symmetry == "odd":
        assert abs(truth["omega_yr_bar"].sum()) > 1e-3 * abs(truth["omega_yr_bar"][0])


def test_straight_tails_have_the_drag_of_their_nodes() -> None:
    """Force and moment of a straight rod from 0 to −l that moves sideways and turns."""
    robots = rows().at(np.arange(4)).robots
    tails = robots_of(robots)
    motion = np.tile([0.3, 0.2, 0.5, -1.0, 2.0], (4, 1))
    z = np.linspace(-1, 0, 4001)
    side = 0.3 + 0.5 * z
    force, moment = -np.trapezoid(side, z), -np.trapezoid(z * side, z)
    resisted = (straight_resistance(tails) @ motion[:, :3, None])[..., 0]
    found = -resisted / tails.number[:, None]
    assert np.allclose(found[:, 0], force * tails.perp, rtol=1e-6)
    assert np.allclose(found[:, 2], moment * tails.perp, rtol=1e-6)
    assert np.allclose(found[:, 1], -0.2 * tails.parallel)


def test_the_wrench_from_the_robots_own_motion_is_that_of_the_tails() -> None:
    """R (v_x, v_z, ω_yr, ω_h, ω_t) is the mean wrench that the simulator's tails have, mesh by mesh."""
    robots = {name: values[:3] for name, values in rows().robots.items()}
    heads = robots_of(robots)
    for i in range(3):
        one = {name: values[i : i + 1] for name, values in robots.items()}
        body = bodies(Groups.from_columns(one))[0]
        solved, x, u = orbit_on_mesh(body, int(one["N"][0]), 8)
        assert solved
        mean = u.mean(0)
        motion = np.append(mean, body.omega + heads.gain[i] * mean[3])
        wrench = heads.resistance[i] @ motion
        assert wrench == pytest.approx(mean_tail_wrench(body, x, u), rel=1e-4, abs=1e-6 * np.abs(wrench).max())


def test_forces_are_in_balance() -> None:
    robots = {name: values[:300] for name, values in draw_robots(2000, 31, wide=False).items() if name in ROBOT}
    robots["N"] = np.full(300, 4.0)
    found, r = load().solve(robots), query.robots_of(robots)
    known, u = found.outside == INSIDE, found.motion.T
    assert known.mean() > 0.9
    network = load().tails.wrench[2]
    assert network is not None
    left = query.residual(r, u, query.members(network, query.tail_inputs(r, u)).mean(0))
    size = np.einsum("ijm,jm->im", np.abs(r.drag), np.abs(u))
    assert np.abs(left / size)[:, known].max() < 1e-9


def test_robots_are_alike_in_loops_and_with_arrays() -> None:
    robots = {name: values for name, values in draw_robots(50, 3, wide=False).items() if name in ROBOT}
    robots["omega_bar"] = robots["omega_bar"] * np.tile([1.0, -1.0], 25)
    for part, other in zip(unpack_robots(packed_robots(robots)[1]), robots_of(robots), strict=True):
        assert part == pytest.approx(other, rel=1e-13)
    assert pack_robots(robots_of(robots)) == pytest.approx(packed_robots(robots)[1], rel=1e-13)


def test_linear_theory_is_a_good_start() -> None:
    some = rows(256, 13, wide=False)
    found = wrench_samples(some.robots, some.motion)
    guess = query.first_guess(query.robots_of(some.robots)).T
    assert np.median(np.abs(guess[:, 3] / found.motion[:, 3] - 1)) < 0.1
    assert np.median(np.abs(guess[:, 2] / found.motion[:, 2] - 1)) < 0.3
    for S in (0.1, 1.0, 10.0, 100.0):
        thrust, torque, _ = linear_filament(S)
        assert linear_thrust(S) == pytest.approx(thrust, rel=0.5)
        assert linear_torque(S) == pytest.approx(torque, rel=0.35)
