"""Replays, and response curves: against time steps, brute-force replays of random schedules, and their limits."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from common.errors import InputError
from sim.mechanics import planar
from sim.model.groups import Groups
from sim.model.response import BEFORE, DWELLS, FORGOTTEN, Responses, memory_after
from sim.model.schedule import Schedule
from sim.motion import response
from sim.motion.replay import replay, replay_error
from sim.motion.response import responses
from sim.motion.run import Resolution, SteppedRobot
from sim.motion.steady import steady
from sim.motion.stepped_response import steady_state, steady_twist, stepped_response
from sim.solve.assembly import bodies
from tests.oracles.switching import switch_response
from tests.oracles.unseen_robots import lab_robot
from tests.sim.robots import CONTROL_VALUES, control, first_body

FINE = Resolution(24, 72)
FEW = np.array([0, 6, 12, 18, 24])  # of the dwells


@pytest.mark.parametrize(
    ("omega_bar", "changes"),
    [
        (12.0, {"N": 4.0}),
        (-25.0, {}),
        (12.0, {"N": 3.0, "left_right_bias": 0.3}),
        (-12.0, {"left_right_bias": 0.3}),
    ],
)
def test_curves_agree_with_time_steps(omega_bar: float, changes: dict[str, float]) -> None:
    groups = control(omega_bar=omega_bar, **changes)
    curves = responses(groups)
    assert not curves.stepped.any()
    lag, memory, rest, _ = stepped_response(
        first_body(groups), groups.N, DWELLS[FEW], BEFORE[[1, 3]],
        reverse=bodies(groups.reversed())[0], resolution=FINE,
    )  # fmt: skip
    assert curves.lag[0, FEW] == pytest.approx(lag, abs=2.5e-4)
    assert curves.memory[0][[1, 3]][:, FEW] == pytest.approx(memory, abs=5e-4)
    assert curves.rest[0, FEW] == pytest.approx(rest, abs=6e-4)


@pytest.mark.parametrize("omega_bar", [6.0, 12.0, 40.0])
def test_the_spread_is_what_the_phase_of_the_disc_adds_flip_by_flip(omega_bar: float) -> None:
    """With equal dwells the disc comes back to its phase at every second flip, so what the phase does adds up."""
    groups = control(N=2.0, omega_bar=omega_bar)
    body, reverse = first_body(groups), bodies(groups.reversed())[0]
    run = SteppedRobot(reverse, 2, FINE, steady_state(reverse, 2, FINE), reverse=body)
    _, period = steady_twist(run, 2, 1.0)
    parts = period * np.arange(4) / 4
    turned = np.array([[turned_in_two_flips(run, wait, 1.2 + longer) for wait in parts] for longer in parts])
    by_phase = float(np.sqrt((turned - turned.mean(1, keepdims=True)).var()))
    spread = responses(groups, history=False).spread[0, -1, 2]
    assert 0.5 < by_phase / (np.sqrt(2) * spread) < 1.5


def turned_in_two_flips(run: SteppedRobot, wait: float, dwell: float) -> float:
    """Return the turn of a robot that waits and then flips after equal dwells."""
    own, headings = run.copy(), []
    own.go(wait)
    for _ in range(10):
        own.flip()
        own.go(dwell)
        headings.append(own.pose[2])
    return float(headings[9] - headings[3]) / 3


def test_a_turn_of_two_tails_has_instants_enough(monkeypatch: pytest.MonkeyPatch) -> None:
    """Harmonics of a transient that no orbit has would change the mean of three instants by 0.09 mrad."""
    groups = lab_robot(np.random.default_rng(50044)).groups()
    usual = responses(groups, history=False).lag
    monkeypatch.setattr(response, "_LEAST_INSTANTS", {2: 9})
    assert responses(groups, history=False).lag == pytest.approx(usual, abs=1e-6)


def test_a_fast_robot_is_solved_for_in_many_small_steps() -> None:
    groups = lab_robot(np.random.default_rng(50160)).groups()
    assert groups.N == 2
    assert not responses(groups, tolerance=1e-4).stepped.any()


def test_other_dwells_do_not_change_the_curves() -> None:
    """Short dwells are on the way of the same flips; memory after a dwell does not depend on shorter ones."""
    early = np.array([0.03, 0.1])
    usual, found = responses(control()), responses(control(), before=BEFORE[-4:], dwells=np.append(early, DWELLS))
    assert found.lag[:, 2:] == pytest.approx(usual.lag, abs=1e-12)
    assert found.rest[:, 2:] == pytest.approx(usual.rest, abs=1e-12)
    assert found.memory[:, :, 2:] == pytest.approx(usual.memory[:, -4:], abs=2e-6)  # time steps end at these
    long = np.append([False, False], BEFORE[-4] <= DWELLS)
    assert np.isnan(found.net_speed[:, ~long]).all()
    assert found.net_speed[:, long] == pytest.approx(usual.net_speed[:, long[2:]], abs=2e-6)
    stepped = stepped_response(first_body(control()), 2, early, BEFORE[-4:], resolution=FINE)
    assert found.lag[0, :2] == pytest.approx(stepped.lag, abs=2.5e-4)


@pytest.mark.parametrize(("tails", "ends"), [(2.0, (0.5, 2.0)), (4.0, (0.3, 0.6))])
def test_a_random_schedule_is_the_product_of_its_responses(tails: float, ends: tuple[float, float]) -> None:
    """A replay in the lab against lag, memory and arc of every dwell, with nothing fitted."""
    dwells = np.random.default_rng(4).uniform(*ends, 12)
    values = {**CONTROL_VALUES, "N": tails, "omega_bar": 15.0}
    track = replay(Schedule(values, 1, dwells, (0.0, 0.0, 0.0), 1.0))
    flips = track.groupby("dwell").last()[["x_over_l", "y_over_l", "heading_rad"]].to_numpy()
    predicted = composed(responses(control(N=tails, omega_bar=15.0)), control(N=tails, omega_bar=15.0), dwells)
    travelled = np.abs(np.diff(flips[:, 2])).sum()
    assert predicted[:, 2] == pytest.approx(flips[:, 2], abs=max(2e-3, 2e-3 * travelled))
    assert predicted[:, :2] == pytest.approx(flips[:, :2], abs=3e-3)


def composed(found: Responses, groups: Groups, dwells: np.ndarray) -> np.ndarray:
    """Compose poses at the ends of the dwells of a schedule from rest, the first dwell with a positive motor."""
    motion = steady(groups)
    twist = np.array([motion.v_z[0], motion.v_x[0], motion.omega_yr[0]])
    pose, poses = np.zeros(3), []
    for i, dwell in enumerate(dwells):
        curve = found.rest[0] if i == 0 else found.lag[0] + memory_after(found.memory[0], dwells[i - 1])
        lag = np.array([np.interp(np.log(dwell), np.log(DWELLS), column) for column in curve.T])
        change = planar.compose(lag, planar.arc(twist, dwell))
        pose = planar.compose(pose, change * (planar.MIRROR if i % 2 else 1.0))
        poses.append(pose)
    return np.array(poses)


def test_net_speed_agrees_with_flips_that_go_on_until_the_motion_repeats() -> None:
    groups = control(len(FEW), omega_bar=20.0, N=3.0)
    stepped = switch_response(groups, DWELLS[FEW], resolution=FINE)
    found = responses(groups)
    speed = np.hypot(steady(groups).v_x, steady(groups).v_z)
    away = np.abs(np.diagonal(found.net_speed[:, FEW]) - stepped.net_speed) / speed
    assert away[0] < 0.02  # dwells of 0.2: two dwells before matter as well
    assert (away[1:] < 1e-3).all()


def test_the_lag_stops_changing_and_a_long_dwell_is_forgotten() -> None:
    found = responses(control(omega_bar=20.0))
    late = DWELLS > 1.9
    assert np.ptp(found.lag[0, late], axis=0) == pytest.approx(0, abs=2e-4)
    first, last = np.abs(found.memory[0]).max((1, 2))[[0, -1]]
    assert last < 0.2 * first
    assert (memory_after(found.memory[0], FORGOTTEN) == 0).all()
    assert memory_after(found.memory[0], BEFORE[2]) == pytest.approx(found.memory[0, 2])


def test_without_history_the_net_speed_of_quick_flips_is_not_known() -> None:
    found = responses(control(), history=False)
    assert np.isnan(found.memory).all()
    assert np.isnan(found.rest).all()
    assert (np.isfinite(found.net_speed[0]) == (DWELLS >= FORGOTTEN)).all()
    assert np.isfinite(found.lag).all()


def test_a_robot_that_cannot_be_solved_for_is_stepped(monkeypatch: pytest.MonkeyPatch) -> None:
    direct = responses(control())
    monkeypatch.setattr(
        response, "orbits_with_phases", lambda rows, _, meshes, *__: [[None] * len(rows)] * len(meshes)
    )
    stepped = responses(control())
    assert stepped.stepped.all()
    assert not stepped.failed.any()
    assert stepped.lag == pytest.approx(direct.lag, abs=1e-3)


def test_a_robot_that_breaks_down_is_flagged_and_the_others_go_on() -> None:
    found = responses(control(2, omega_bar=np.array([10.0, 1e9])))
    assert found.failed.tolist() == [False, True]
    assert np.isnan(found.lag[1]).all()
    assert np.isfinite(found.lag[0]).all()


def test_a_robot_whose_memory_alone_breaks_down_is_flagged(monkeypatch: pytest.MonkeyPatch) -> None:
    extrapolated = response._extrapolated

    def broken(*given: Any) -> Any:
        curves = extrapolated(*given)
        return curves._replace(memory=np.where(np.arange(len(DWELLS))[:, None] == 3, np.nan, curves.memory))

    monkeypatch.setattr(response, "_extrapolated", broken)
    found = responses(control())
    assert found.failed.all()
    assert np.isnan(found.lag).all()
    assert not responses(control(), history=False).failed.any()


def test_a_replay_turns_at_the_rate_of_each_direction() -> None:
    """With an odd effect the two directions differ; each flip must change the effect, too."""
    values = {**CONTROL_VALUES, "omega_bar": 15.0, "left_right_bias": 0.3}
    both = steady(control(2, omega_bar=np.array([15.0, -15.0]), left_right_bias=0.3))
    track = replay(Schedule(values, 1, np.array([8.0, 8.0]), (0.0, 0.0, 0.0), 1.0))
    for dwell, rate in enumerate(both.omega_yr):
        late = track[(track["dwell"] == dwell) & (track["time_bar"] > 8.0 * dwell + 4.0)]
        turned = np.diff(late["heading_rad"].to_numpy()[[0, -1]]) / np.diff(late["time_bar"].to_numpy()[[0, -1]])
        assert turned[0] == pytest.approx(rate, rel=0.01)


def test_a_replay_begins_at_the_start_and_ends_with_the_last_dwell() -> None:
    schedules = [
        Schedule(CONTROL_VALUES, 1, np.array([0.8, 1.2, 0.9]), (1.0, 2.0, 0.5), 2.0),
        Schedule(CONTROL_VALUES, -1, np.array([1.0]), (0.0, 0.0, 0.0), 2.0),
    ]
    for schedule in schedules:
        track = replay(schedule)
        assert "x_cm" not in track
        assert float(track.time_bar.iloc[-1]) == pytest.approx(schedule.dwells.sum())
        assert track.iloc[0][["x_over_l", "y_over_l", "heading_rad"]].tolist() == list(schedule.start)


def test_a_track_of_a_robot_with_a_size_is_in_centimetres_too() -> None:
    track = replay(Schedule(CONTROL_VALUES, 1, np.array([0.8]), (1.0, 2.0, 0.5), 2.0, 0.11))
    assert track["x_cm"].to_numpy() == pytest.approx(11 * track["x_over_l"].to_numpy())
    assert track["y_cm"].to_numpy() == pytest.approx(11 * track["y_over_l"].to_numpy())
    assert np.radians(track["heading_deg"].to_numpy()) == pytest.approx(track["heading_rad"].to_numpy())
    with pytest.raises(InputError, match="tail_length_m = -1"):
        Schedule(CONTROL_VALUES, 1, np.array([0.8]), (1.0, 2.0, 0.5), 2.0, -1.0)


@pytest.mark.parametrize("robot", [
    pytest.param({**CONTROL_VALUES, "N": 2.0}, id="control"),
    pytest.param({**CONTROL_VALUES, "N": 4.0, "omega_bar": 30.0}, id="fast", marks=pytest.mark.rest),
])  # fmt: skip
def test_the_error_of_a_track_is_that_against_a_much_finer_mesh(robot: dict[str, float]) -> None:
    """The reference has three times the edges and the steps, so a ninth of the error."""
    dwells = np.array([1.0, 0.6, 1.4, 0.8, 1.0, 0.5])
    schedule = Schedule(robot, 1, dwells, (0.0, 0.0, 0.0), 1.0)
    track = replay(schedule)
    finest = replay(schedule, resolution=Resolution.for_tracks(robot["omega_bar"]).finer(3))
    places = [part.groupby("dwell").last()[["x_over_l", "y_over_l"]].to_numpy() for part in (track, finest)]
    found = np.hypot(*(places[0] - places[1]).T).max()
    assert 0.5 * found < replay_error(schedule, track) < 2 * found


@pytest.mark.parametrize("dwell", [0.35, 2.5])
def test_net_motion_agrees_with_a_brute_force_replay(dwell: float) -> None:
    """Many flips in the lab against lag and arc of one; shorter and longer dwells than the tails' memory."""
    count = 24
    response = switch_response(control(N=3), np.array([dwell]))
    schedule = Schedule({**CONTROL_VALUES, "N": 3.0}, 1, np.full(count, dwell), (0.0, 0.0, 0.0), 1.0)
    track = replay(schedule)
    flips = track.groupby("dwell").last()[["x_over_l", "y_over_l"]].to_numpy()
    moved = np.linalg.norm(flips[-1] - flips[3]) / (dwell * (count - 4))
    assert moved == pytest.approx(float(response.net_speed[0]), rel=8e-3)


@pytest.mark.parametrize("dwell", [0.35, 1.0])
def test_a_flip_leaves_little_error_of_the_step(dwell: float) -> None:
    """Every mode of the tails starts anew at a flip; with equal steps they are 1.6 and 0.5 % off."""
    default, fine = (
        switch_response(control(N=4), np.array([dwell]), resolution=Resolution(16, steps)).net_speed[0]
        for steps in (24, 24 * 16)
    )
    assert default == pytest.approx(fine, rel=4e-3)
