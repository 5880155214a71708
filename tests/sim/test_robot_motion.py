"""The whole robot: balance, symmetry, convergence, batches, reference points, switching, replay."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import torch

from sim import direct
from sim.balance import assemble, fluid_wrench
from sim.banded import BlockBanded
from sim.batches import steady_columns
from sim.contact import tail_gap
from sim.interface import side_force_coefficient
from sim.march import TOLERANCE, advance, new_state
from sim.replay import Schedule, replay
from sim.resolution import Resolution
from sim.robot import PRESETS
from sim.settling import settle
from sim.steady import steady
from sim.stepper import PHASE, YAW, at_rest, step
from sim.switching import switch_response
from sim.tail import HEAD_LENGTH, body_of
from tests.reference.cases import (
    CONTROL,
    INDEPENDENT_HEAD_SHARE,
    MEASURED_HEAD_SHARE,
    STEADY_INPUTS,
    STEADY_POINTS,
)
from tests.sim.robots import CONTROL_VALUES, control

ORACLE = Path(__file__).parents[3] / "shared" / "design" / "oracle_points.csv"
OUTPUTS = ("omega_t_bar", "omega_h_bar", "omega_yr_bar", "v_x", "v_z", "R_yr_over_l", "theta_deg")


def check_against(found: dict[str, np.ndarray], wanted: dict[str, np.ndarray]) -> None:
    """Spins within 0.2 %, yaw rate, velocity and radius within 0.5 %, θ within 0.2 degrees."""
    for name in OUTPUTS[:2]:
        assert np.abs(found[name] / wanted[name] - 1).max() < 2e-3, name
    for name in OUTPUTS[2:6]:
        assert np.abs(found[name] / wanted[name] - 1).max() < 5e-3, name
    assert np.abs(found["theta_deg"] - wanted["theta_deg"]).max() < 0.2


def test_control_example_matches_the_independent_solver() -> None:
    motion = steady(control())
    found = motion.columns()
    assert found["converged"].all()
    check_against(found, {k: np.array([v]) for k, v in CONTROL.items()})


def test_points_over_the_domain_match_the_independent_solver() -> None:
    inputs = np.array([p[0] for p in STEADY_POINTS]).T
    outputs = np.array([p[1] for p in STEADY_POINTS]).T
    found = steady_columns(dict(zip(STEADY_INPUTS, inputs, strict=True)), title="")
    assert found["converged"].all()
    check_against(found, dict(zip(OUTPUTS, outputs, strict=True)))


@pytest.mark.skipif(not ORACLE.is_file(), reason="the independent solver's table is not on this machine")
def test_every_point_of_the_independent_solver() -> None:
    table = pd.read_csv(ORACLE)
    found = steady_columns({k: table[k].to_numpy(float) for k in STEADY_INPUTS}, title="")
    check_against(found, {k: table[k].to_numpy(float) for k in OUTPUTS})


def test_head_share_of_the_paper_s_measured_robot() -> None:
    motion = steady(PRESETS["paper-measured"].groups())
    share = float(motion.omega_h[0] / (motion.omega_h[0] - motion.omega_t[0]))
    assert share == pytest.approx(INDEPENDENT_HEAD_SHARE, abs=2e-3)
    assert abs(share - MEASURED_HEAD_SHARE) < 0.05  # the paper's own fit misses its point by 0.04


def test_side_force_coefficient_of_the_paper_s_profile() -> None:
    assert side_force_coefficient() == pytest.approx(-1.4026, abs=1e-4)
    assert side_force_coefficient(steepness=5000.0) == pytest.approx(-2 * math.sqrt(1 - 0.49), rel=1e-3)


@pytest.mark.parametrize("tails", [1, 2, 5])
def test_total_force_and_moment_vanish_to_round_off(tails: int) -> None:
    """Also in the middle of a transient, where nothing is steady."""
    groups = control(3, N=tails, omega_bar=[3.0, 10.0, -60.0])
    swimmer = assemble(groups, edges=12)
    state = at_rest(swimmer)
    dt = torch.full((3,), 0.004, dtype=torch.float64)
    for _ in range(30):
        state = step(swimmer, state, groups.omega_bar, dt, tolerance=1e-12)
    tail, head = fluid_wrench(swimmer, state.x, state.x_dot, state.pose[PHASE], state.u, groups.omega_bar)
    assert (tail + head).abs().max() < 1e-11 * tail.abs().max()
    assert tail.abs().max() > 0.1


def test_reversing_the_motor_mirrors_the_motion() -> None:
    for solve in (steady, settle):
        forward, backward = solve(control(N=3)), solve(control(N=3, omega_bar=-10.0))
        for name, sign in (("omega_t", -1), ("omega_h", -1), ("omega_yr", -1), ("v_x", -1), ("v_z", 1)):
            assert getattr(backward, name) == pytest.approx(sign * getattr(forward, name), rel=1e-7)


def test_batch_equals_one_by_one() -> None:
    rng = np.random.default_rng(0)
    changes = {"C_t": rng.uniform(2, 5, 4), "C_yr": rng.uniform(1, 6, 4), "omega_bar": rng.uniform(5, 15, 4)}
    for solve, close in ((steady, 1e-12), (settle, 1e-12)):
        together = solve(control(4, **changes))
        for i in range(4):
            alone = solve(control(**{k: v[i] for k, v in changes.items()}))
            for name in ("omega_t", "omega_yr", "v_x", "v_z", "tail_gap"):
                assert getattr(alone, name)[0] == pytest.approx(getattr(together, name)[i], rel=close)


@pytest.mark.parametrize(("tails", "omega"), [(1, 8.0), (2, 40.0), (5, -15.0)])
def test_compiled_steps_equal_steps_with_tensors(tails: int, omega: float) -> None:
    """The same scheme on the same equations, from rest, with motor droop, drag on the disc and loads."""
    groups, steps, edges = control(N=tails, omega_bar=omega, C_yr=5.0), 40, 10
    swimmer = assemble(groups, edges=edges)
    load = torch.tensor([[0.3], [-0.6], [0.2]], dtype=torch.float64)
    swimmer = replace(swimmer, gain=swimmer.gain * 1.2, tail_load=load)
    swimmer.resistance[3, 4] = 0.02
    row = direct.bodies(groups)[0]
    body = body_of(row)
    body.resistance[3, 4] = 0.02
    body = body._replace(gain=1.2, load=(0.3, -0.6, 0.2))
    dt = 0.15 / abs(omega)
    state, poses = new_state(tails, edges, body.offset), np.empty((steps, 6))
    assert advance(body, row[HEAD_LENGTH], state, dt, steps, 1e-10, poses, np.empty((0, *state.x.shape)))
    tensors = at_rest(swimmer)
    for i in range(steps):
        tensors = step(
            swimmer, tensors, groups.omega_bar, torch.tensor([dt], dtype=torch.float64), tolerance=1e-10
        )
        assert poses[i] == pytest.approx(tensors.pose[:, 0].numpy(), rel=1e-8, abs=1e-10)
    assert state.u == pytest.approx(tensors.u[:, 0].numpy(), rel=1e-8, abs=1e-9)
    assert state.x[:, 0] == pytest.approx(tensors.x[:, :, 0, 0].numpy(), abs=1e-9)


def test_a_step_that_breaks_down_is_reported() -> None:
    row = direct.bodies(control())[0].copy()
    row[3] = np.nan
    state = new_state(2, 8, row[1])
    steps = np.empty((3, 6))
    assert not advance(body_of(row), row[6], state, 0.01, 3, TOLERANCE, steps, np.empty((0, *state.x.shape)))


def yaw_after(steps: int, *, edges: int = 12, time: float = 1.5) -> float:
    groups = control(omega_bar=20.0)
    swimmer = assemble(groups, edges=edges)
    state = at_rest(swimmer)
    dt = torch.tensor([time / steps], dtype=torch.float64)
    for _ in range(steps):
        state = step(swimmer, state, groups.omega_bar, dt, tolerance=1e-9)
    return float(state.pose[YAW])


def test_time_steps_are_of_second_order() -> None:
    coarse, middle, fine = (yaw_after(n) for n in (240, 480, 960))
    assert math.log2(abs((coarse - middle) / (middle - fine))) > 1.8


def test_the_robot_converges_at_second_order_in_edges() -> None:
    yaw = [yaw_after(400, edges=n) for n in (8, 16, 32)]
    assert math.log2(abs((yaw[0] - yaw[1]) / (yaw[1] - yaw[2]))) > 1.8


@pytest.mark.parametrize("n", [3, 8])
def test_banded_and_dense_solves_agree(n: int) -> None:
    generator = torch.Generator().manual_seed(n)

    def noise(*shape: int) -> torch.Tensor:
        return torch.randn(*shape, generator=generator, dtype=torch.float64)

    lanes = (2, 3)
    blocks = {m: noise(n - abs(m), 3, 3, *lanes) for m in range(-2, 3)}
    blocks[0] += 30 * torch.eye(3, dtype=torch.float64).reshape(3, 3, 1, 1)
    r, border, foot = noise(n, 3, *lanes), noise(4, n, 3, *lanes), noise(4, 6, *lanes)
    corner = noise(4, 4, 3) + 20 * torch.eye(4, dtype=torch.float64).unsqueeze(-1)
    s = noise(4, 3)
    answers = []
    for dense in (True, False):
        matrix = BlockBanded(n, lanes, r, dense=dense)
        for m, block in blocks.items():
            matrix.diagonal(m).add_(block)
        answers.append(matrix.solve_bordered(r, border, foot, corner, s))
    for a, b in zip(*answers, strict=True):
        assert torch.allclose(a, b, rtol=1e-10, atol=1e-12)
    # And both solve the system: check the rows of robot 1.
    x, u = answers[0]
    row = torch.zeros(n, 3, 2, dtype=torch.float64)
    for m, block in blocks.items():
        for k in range(n - abs(m)):
            i = k + max(0, -m)
            row[i] += (block[k, :, :, :, 1] * x[i + m, :, :, 1].unsqueeze(0)).sum(1)
    row += (border[..., 1] * u[:, 1].reshape(4, 1, 1, 1)).sum(0)
    assert torch.allclose(row, r[..., 1], atol=1e-10)
    body = (foot[..., 1] * x[:2, :, :, 1].reshape(6, 2)).sum((1, 2)) + corner[..., 1] @ u[:, 1]
    assert torch.allclose(body, s[:, 1], atol=1e-10)


def test_one_lane_that_breaks_down_does_not_disturb_the_others() -> None:
    groups = control(2, omega_bar=[10.0, 10.0])
    swimmer = assemble(groups, edges=12)
    broken = replace(swimmer, zeta_perp=swimmer.zeta_perp * torch.tensor([1.0, float("nan")]))
    state, good = at_rest(broken), at_rest(swimmer)
    dt = torch.full((2,), 0.02, dtype=torch.float64)
    for _ in range(5):
        state = step(broken, state, groups.omega_bar, dt)
        good = step(swimmer, good, groups.omega_bar, dt)
    assert state.failed.tolist() == [False, True]
    assert float(state.pose[YAW, 0]) == pytest.approx(float(good.pose[YAW, 0]), rel=1e-6)
    assert torch.isfinite(state.pose).all()


def test_tail_gap_of_straight_tails() -> None:
    offset, radius = 1 / CONTROL_VALUES["l_over_R"], 1 / CONTROL_VALUES["l_over_r0"]
    straight = new_state(4, 8, offset).x
    assert tail_gap(straight, offset, radius) == pytest.approx(math.sqrt(2) * offset / (2 * radius), rel=1e-12)
    assert math.isinf(tail_gap(straight[:, :1].copy(), offset, radius))


def test_net_speed_falls_with_faster_flips_as_the_tails_turn_over() -> None:
    dwell = np.array([0.5, 1.0, 2.0, 4.0])
    groups = control(4)
    response = switch_response(groups, dwell)
    surge = steady(groups).v_z[0]
    assert not response.failed.any()
    assert (np.diff(response.net_speed) > 0).all()
    assert response.net_speed[-1] < surge
    assert response.net_speed == pytest.approx([0.0133, 0.0160, 0.0169, 0.0173], rel=0.02)
    # The offset of a flip no longer changes once the tails have turned over.
    assert response.lag_z[2:] == pytest.approx(np.full(2, response.lag_z[1]), rel=0.05)


@pytest.mark.parametrize("dwell", [0.35, 1.0, 2.5])
def test_net_motion_agrees_with_a_brute_force_replay(dwell: float) -> None:
    """Many flips in the lab against lag and arc of one; shorter and longer dwells than the tails' memory."""
    count = 24
    response = switch_response(control(N=3), np.array([dwell]))
    schedule = Schedule({**CONTROL_VALUES, "N": 3.0}, 1, np.full(count, dwell), (0.0, 0.0, 0.0), 1.0)
    track = replay([schedule])[0]
    flips = track.groupby("dwell").last()[["x_over_l", "y_over_l"]].to_numpy()
    moved = np.linalg.norm(flips[-1] - flips[3]) / (dwell * (count - 4))
    assert moved == pytest.approx(float(response.net_speed[0]), rel=8e-3)


@pytest.mark.parametrize("dwell", [0.35, 1.0])
def test_a_flip_leaves_little_error_of_the_step(dwell: float) -> None:
    """Every mode of the tails starts anew at a flip; equal steps were 1.6 and 0.5 % off."""
    default, fine = (
        switch_response(control(N=4), np.array([dwell]), resolution=Resolution(16, steps)).net_speed[0]
        for steps in (24, 24 * 16)
    )
    assert default == pytest.approx(fine, rel=4e-3)


def test_replays_of_several_schedules_equal_replays_alone() -> None:
    schedules = [
        Schedule(CONTROL_VALUES, 1, np.array([0.8, 1.2, 0.9]), (1.0, 2.0, 0.5), 2.0),
        Schedule(CONTROL_VALUES, -1, np.array([1.0]), (0.0, 0.0, 0.0), 2.0),
    ]
    together = replay(schedules)
    for schedule, track in zip(schedules, together, strict=True):
        alone = replay([schedule])[0]
        assert track.equals(alone)
        assert float(track.time_bar.iloc[-1]) == pytest.approx(schedule.dwells.sum())
    assert together[0].iloc[0][["x_over_l", "y_over_l", "heading_rad"]].tolist() == [1.0, 2.0, 0.5]
