"""Steady motion: reference points, symmetry, batches, which route a robot takes, and lab units."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from time import perf_counter

import numpy as np
import pandas as pd
import pytest

import sim.motion.settling
import sim.motion.steady
from common.errors import InputError, run_command
from sim.__main__ import _counts, main
from sim.inputs import save_robot
from sim.model.presets import INDEPENDENT, PRESETS
from sim.model.robot import Robot
from sim.motion.batches import steady_columns, stepped_columns
from sim.motion.settling import settle
from sim.motion.stability import QUICK
from sim.motion.steady import orbits, steady
from sim.motion.steady_motion import DIRECT, LAB_COLUMNS, STEPPING, describe_motion, lab_columns, lab_motion
from sim.solve.refinement import LOST, REASONS, OrbitOnMeshes
from tests.reference.cases import INDEPENDENT_HEAD_SHARE, MEASURED_HEAD_SHARE, STEADY_INPUTS, STEADY_POINTS
from tests.sim.robots import control, sweep_points

OUTPUTS = ("omega_t_bar", "omega_h_bar", "omega_yr_bar", "v_x", "v_z", "R_yr_over_l", "theta_deg")


def check_against(found: dict[str, np.ndarray], wanted: dict[str, np.ndarray]) -> None:
    """Check spins within 0.2 %, yaw rate, velocity and radius within 0.5 %, θ within 0.2 degrees."""
    for name in OUTPUTS[:2]:
        assert np.abs(found[name] / wanted[name] - 1).max() < 2e-3, name
    for name in OUTPUTS[2:6]:
        assert np.abs(found[name] / wanted[name] - 1).max() < 5e-3, name
    assert np.abs(found["theta_deg"] - wanted["theta_deg"]).max() < 0.2


def test_control_example_matches_the_independent_solver() -> None:
    motion = steady(control())
    found = motion.columns()
    assert found["converged"].all()
    check_against(found, {k: np.array([v]) for k, v in INDEPENDENT.items()})


def test_points_over_the_domain_match_the_independent_solver() -> None:
    inputs = np.array([p[0] for p in STEADY_POINTS]).T
    outputs = np.array([p[1] for p in STEADY_POINTS]).T
    found = steady_columns(dict(zip(STEADY_INPUTS, inputs, strict=True)), title="")
    assert found["converged"].all()
    check_against(found, dict(zip(OUTPUTS, outputs, strict=True)))


def test_head_share_of_the_paper_s_measured_robot() -> None:
    motion = steady(PRESETS["paper-measured"].groups())
    share = float(motion.omega_h[0] / (motion.omega_h[0] - motion.omega_t[0]))
    assert share == pytest.approx(INDEPENDENT_HEAD_SHARE, abs=2e-3)
    assert abs(share - MEASURED_HEAD_SHARE) < 0.05  # the paper's own fit misses its point by 0.04


def test_reversing_the_motor_mirrors_the_motion(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """By both routes; stepping says on a terminal how far it is."""
    monkeypatch.setattr("sys.stderr.isatty", lambda: True)
    monkeypatch.setattr(sim.motion.settling, "_SILENT", 0.0)
    for solve in (steady, settle):
        forward, backward = solve(control(N=3)), solve(control(N=3, omega_bar=-10.0))
        for name, sign in (("omega_t", -1), ("omega_h", -1), ("omega_yr", -1), ("v_x", -1), ("v_z", 1)):
            assert getattr(backward, name) == pytest.approx(sign * getattr(forward, name), rel=1e-7)
    assert "stepping in time at ω̄ = 10: 0." in capsys.readouterr().err


@pytest.mark.slow
def test_time_stepping_from_rest_reaches_the_same_motion() -> None:
    """Over the sweep's domain; the tolerance is the error of stepping on 24 edges."""
    points = sweep_points(8)
    found = steady_columns(points, title="")
    stepped = stepped_columns(points, finer=2, title="")
    assert (found["method"] == DIRECT).all()
    assert found["converged"].all()
    assert stepped["converged"].all()
    speed = np.hypot(stepped["v_x"], stepped["v_z"])
    for name in ("omega_t_bar", "omega_h_bar", "omega_yr_bar"):
        assert np.abs(found[name] / stepped[name] - 1).max() < 4e-3, name
    for name in ("v_x", "v_z"):
        assert (np.abs(found[name] - stepped[name]) / speed).max() < 4e-3, name
    assert np.abs(found["tail_gap"] / stepped["tail_gap"] - 1).max() < 0.05


def test_a_row_without_an_orbit_is_stepped_and_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    groups = control(2, omega_bar=[10.0, 14.0])
    plain = steady(groups)

    def lose_the_first(rows: np.ndarray, tails: int, phases: int) -> list[OrbitOnMeshes]:
        first, *others = refined_orbits(rows, tails, phases)
        return [first._replace(status=LOST, means=np.full(5, np.nan)), *others]

    refined_orbits = sim.motion.steady.refined_orbits
    monkeypatch.setattr(sim.motion.steady, "refined_orbits", lose_the_first)
    assert orbits(groups).failed.tolist() == [True, False]
    motion = steady(groups)
    assert motion.method.tolist() == [STEPPING, DIRECT]
    assert motion.note.tolist() == [REASONS[LOST], ""]
    assert motion.converged.all()
    assert motion.omega_yr == pytest.approx(plain.omega_yr, rel=5e-3)
    assert 0 < motion.error[0] < 0.01


def test_a_quick_turn_is_followed_from_rest() -> None:
    """The robot turns fast beside its disc; straight tails take it to another motion."""
    size = {"l_over_R": 3.82, "L_over_R": 4.24, "l_over_r0": 16.2, "omega_bar": 117.0}
    groups = control(1, N=6, C_t=0.55, C_r=0.54, C_yr=4.1, **size)
    alike = orbits(groups)
    assert alike.converged.all()
    assert (np.abs(alike.omega_yr) > QUICK * np.abs(alike.omega_t)).all()
    motion = steady(groups)
    assert motion.method.tolist() == [STEPPING]
    assert motion.converged.all()
    assert "another motion" in motion.note[0]
    assert abs(motion.v_z[0] / alike.v_z[0] - 1) > 0.1


@pytest.mark.rest
def test_tails_in_contact_that_leave_the_orbit_are_stepped_and_say_so(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where differences between tails grow, and stepping reaches another motion, that one is the answer."""
    groups = control(1, N=4, omega_bar=30.0, tail_contact=1.0)
    plain = steady(groups)
    assert plain.method.tolist() == [DIRECT]
    monkeypatch.setattr(sim.motion.steady, "growths", lambda rows, *_: np.full(len(rows), 0.1))
    assert steady(groups).method.tolist() == [DIRECT]  # stepping reaches the same motion
    monkeypatch.setattr(sim.motion.steady, "SAME", 0.0)
    other = steady(groups)
    assert other.method.tolist() == [STEPPING]
    assert "another motion" in other.note[0]
    assert other.omega_yr == pytest.approx(plain.omega_yr, rel=0.01)


ROBOT = PRESETS["paper-control"]


def motion_of(robot: Robot = ROBOT) -> dict[str, np.ndarray]:
    return steady_columns({name: np.array([value]) for name, value in robot.group_values().items()}, title="")


def test_a_motion_by_hand() -> None:
    """A tail of 10 cm and a time unit of 2 s: numbers that can be checked in the head."""
    motion = {
        "omega_t_bar": np.array([math.pi]), "omega_h_bar": np.array([-2 * math.pi]),
        "omega_yr_bar": np.array([0.1]), "v_x": np.array([0.03]), "v_z": np.array([0.04]),
        "R_yr_over_l": np.array([0.5]), "theta_deg": np.array([30.0]),
    }  # fmt: skip
    lab = lab_columns(motion, 10.0, 2.0)
    assert tuple(lab) == LAB_COLUMNS
    wanted = {"omega_t_rpm": 15.0, "omega_h_rpm": -30.0, "omega_yr_rad_s": 0.05, "R_yr_cm": 5.0, "theta_deg": 30.0,
              "v_cm_s": 0.25, "circle_s": 40 * math.pi}  # fmt: skip
    assert {name: values.item() for name, values in lab.items()} == pytest.approx(wanted)
    at_rest = {name: np.array([0.0]) for name in motion}
    assert lab_columns(at_rest, 10.0, 2.0)["circle_s"] == math.inf


def test_lab_units_agree_with_each_other() -> None:
    """The motor's speed is the difference of the spins; a circle is 2 π R_yr long; slow motors in thick fluids."""
    robots = [ROBOT, replace(ROBOT, viscosity=2 * ROBOT.viscosity, motor_speed=ROBOT.motor_speed / 2)]
    motions = [motion_of(robot) for robot in robots]
    lab = lab_motion(robots, {name: np.concatenate([m[name] for m in motions]) for name in motions[0]})
    rpm = [robot.motor_speed * 30 / math.pi for robot in robots]
    assert lab["omega_t_rpm"] - lab["omega_h_rpm"] == pytest.approx(rpm, rel=1e-9)
    assert lab["v_cm_s"] * lab["circle_s"] == pytest.approx(2 * math.pi * lab["R_yr_cm"], rel=1e-9)
    assert lab["omega_yr_rad_s"] * lab["circle_s"] == pytest.approx([2 * math.pi] * 2)
    for name, ratio in (("R_yr_cm", 1.0), ("circle_s", 2.0), ("v_cm_s", 0.5)):
        assert lab[name][1] == pytest.approx(ratio * lab[name][0])


def test_numbers_with_a_large_error_are_not_written_like_others() -> None:
    motion = {**motion_of(), "error": np.array([0.35])}
    lines = describe_motion(ROBOT, motion).splitlines()
    assert lines[3] == "  yaw rate                0.02 rad/s ± 35 % (0.05 EI/(μ0 l⁴))"
    assert all("± 35 %" in line for line in lines[1:8])
    assert lines[-1].endswith("35 %: do not rely on these numbers")
    assert _counts({}, motion).endswith("; do not rely on the 1 whose error is above 20 %")
    assert "rely" not in _counts({}, motion_of())


def test_the_command_prints_the_motion_of_a_robot(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    save_robot(ROBOT, "robot.toml")
    assert run_command(main, ["steady", "robot.toml", "--out", "motion.csv"]) == 0
    assert capsys.readouterr().out.startswith(describe_motion(ROBOT, motion_of()))
    table = pd.read_csv("motion.csv")
    assert table["robot"].tolist() == ["paper-control"]
    assert list(table)[1 : 1 + len(LAB_COLUMNS)] == list(LAB_COLUMNS)
    assert table["omega_yr_bar"].item() == pytest.approx(motion_of()["omega_yr_bar"].item(), rel=1e-7)


def test_what_the_command_says_without_a_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert run_command(main, ["steady", "paper-measured"]) == 0
    assert "tails touch" in capsys.readouterr().out
    Path("points.csv").write_text("N\n2\n")
    for words, refusal in (
        ("points.csv", "name the file of their motion with --out"), ("paper", "no robot 'paper'"),
        ("robot.tml", "robot.tml: no such file"), (".", ". is a folder"),
    ):  # fmt: skip
        assert run_command(main, ["steady", words]) == 2
        assert refusal in capsys.readouterr().err


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ("motor.speed_rpm=6e4", "may reach another motion.*is so fast that time stepping.*are all units right"),
        ("fluid.viscosity_Pa_s=1e99", "did not converge from straight tails; .*are all units right"),
        ("fluid.viscosity_Pa_s=1e-300", "the tails do not complete a revolution"),
        ("tails.youngs_modulus_Pa=1e-9", "are all units right"),
    ],
)
def test_a_robot_without_a_steady_motion_is_refused_in_seconds(changes: str, reason: str) -> None:
    began = perf_counter()
    key, value = changes.split("=")
    for words in (["--set", changes], ["--vary", f"{key}={value},{2 * float(value)}"]):
        with pytest.raises(InputError, match=f"no steady motion was found: .*{reason}"):
            main(["steady", "paper-control", *words])
    assert perf_counter() - began < 20
