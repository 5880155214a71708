"""Run the whole pipeline on the paper's robots, ending with one page (`softflagella demo`).

Every step is a command that a user would type; it is printed and run. Independent steps (replays, simulations)
run side by side, one process for each core.

1. Simulate the robot: the shape of its tails, circles for both motor directions.
2. Plan circle, square (N = 2) and triangle (N = 4) from the look-up table alone, and replay them in the simulator.
3. Simulate a small sweep, and train a look-up table on it.
4. Calibrate with two synthetic tables from a finer mesh: one has an effect that the model lacks, one has none.
"""

from __future__ import annotations

import json
import math
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from tqdm import tqdm

from calibration.report.corrected_robot import corrected_robot, corrected_toml
from calibration.report.figures import draw_residuals
from calibration.swimmer.head_correction import learn_head_correction
from calibration.swimmer.measured_table import Measurements, read_measurements
from calibration.swimmer.swimmer import SwimmerModel
from calibration.swimmer.synthetic_table import make_table
from calibration.verdict.calibrate import calibrate
from calibration.verdict.verdict import Verdict
from calibration.verdict.verdict_json import verdict_record
from dataset.report.figures import draw_responses, draw_trends, plain_logarithms
from dataset.report.report import usable_rows
from dataset.storage.data_set import read
from planner.files.plan_json import load_plan
from planner.files.tracking_error import TrackingError, draw_overlay, tracking_error
from planner.paths.path import polygon
from sim.io.files import whole_file, write_csv, write_text
from sim.io.pages import Page
from sim.io.provenance import code_version
from sim.model.groups import GROUP_COLUMNS, OPTIONAL_COLUMNS
from sim.model.presets import PRESETS
from sim.model.robot import Robot
from sim.model.robot_toml import robot_toml
from sim.motion.batches import available_jobs
from sim.motion.shapes import tails_over_a_revolution
from sim.motion.steady import steady
from sim.motion.steady_motion import Steady
from sim.motion.warm import compile_once
from softflagella.replanning import Steered, draw_steered, gap_closed, steer
from surrogate.table.errors import error_scale
from surrogate.table.lookup import NeuralTable
from surrogate.table.model_file import load


@dataclass(frozen=True)
class Case:
    name: str
    robot: str
    path: str


CASES = (
    Case("circle", "paper-control", "circle:1.5"),
    Case("square", "paper-control", "square:3"),
    Case("triangle", "paper-triangle", "triangle:4"),
)
# The robot behind the two tables; calibration starts from the paper's coefficients.
HIDDEN = {"C_t": 3.1, "C_r": 2.4, "C_yr": 4.4}
HIDDEN_EFFECT = {"end_over_end_drag": 5.0}
SWEEP_TOML = Path(__file__).with_name("demo.toml")
_LENGTHS_CM = (6.0, 7.5, 9.0)


def run_demo(out: str | Path) -> None:
    """Run the pipeline; intermediate files go to a folder beside the page."""
    began = time.perf_counter()
    page_path = Path(out)
    folder = page_path.parent / "demo"
    folder.mkdir(parents=True, exist_ok=True)
    compile_once()
    print("1/4 the robot at constant motor speed")
    _command("sim", "check")
    robot, motions = _look(folder)
    print("2/4 plan circle, square and triangle without simulating, and replay them")
    errors = _plan_and_replay(folder)
    print("3/4 a small sweep and a look-up table trained on it")
    data, model = folder / "sweep", folder / "model.safetensors"
    shutil.rmtree(data, ignore_errors=True)  # an earlier demo's rows, perhaps of another version
    _command("sweep", "--config", str(SWEEP_TOML), "--out", str(data))
    _command("train", str(data), "--out", str(model), "--epochs", "60")
    print("4/4 calibrate with two measured tables")
    loops = {name: _calibrate(folder, name) for name in ("hidden effect", "nothing hidden")}
    steered = _steer(loops["hidden effect"][0])
    seconds = time.perf_counter() - began
    _write_page(page_path, robot, motions, read(data), load(model), errors, loops, steered, seconds)
    print(f"done in {seconds:.0f} s -> {page_path}")


def _command(*words: str, quiet: bool = False) -> None:
    """Print and run a command of softflagella."""
    if not quiet:
        print("  softflagella", " ".join(words), flush=True)
    output = subprocess.DEVNULL if quiet else None
    subprocess.run([sys.executable, "-m", "softflagella", *words], check=True, stdout=output, stderr=output)


def _look(folder: Path) -> tuple[Robot, list[Steady]]:
    """Write the robot's file and simulate its motion for both motor directions."""
    robot = PRESETS["paper-control"]
    write_text(folder / "robot.toml", robot_toml(robot))
    groups = robot.groups()
    return robot, [steady(replace(groups, omega_bar=s * groups.omega_bar)) for s in (1.0, -1.0)]


def _plan_and_replay(folder: Path) -> dict[str, tuple[dict[str, Any], TrackingError]]:
    """Plan and replay all paths; return each plan with its tracking error."""
    for case in CASES:
        _command("plan", case.path, "--robot", case.robot, "--out", str(folder / case.name))
    threads = {name: "1" for name in ("OMP_NUM_THREADS", "MKL_NUM_THREADS")}
    os.environ.update(threads)

    def replay_one(case: Case) -> None:
        plan, track = folder / case.name / "plan.json", folder / case.name / "track.csv"
        _command("replay", str(plan), "--out", str(track), quiet=True)

    for case in CASES:
        print(f"  softflagella replay {folder / case.name / 'plan.json'} --out …/track.csv")
    with (
        ThreadPoolExecutor(min(available_jobs(), len(CASES))) as pool,
        tqdm(total=len(CASES), desc="replay", unit="plan") as bar,
    ):
        for _ in pool.map(replay_one, reversed(CASES)):
            bar.update()
    result = {}
    for case in CASES:
        plan = load_plan(folder / case.name / "plan.json")
        error = tracking_error(plan, pd.read_csv(folder / case.name / "track.csv"))
        print(f"  {case.name}: {error.line}")
        result[case.name] = (plan, error)
    return result


def _steer(verdict: Verdict) -> dict[str, Steered]:
    """Plan a square with the calibrated, the corrected and the true model, and run the plans on the true robot."""
    start = replace(PRESETS["paper-measured"], tails=2).with_motor(10.0)
    truth = replace(start, **HIDDEN, effects=HIDDEN_EFFECT)  # type: ignore[arg-type]
    models = {
        "calibrated": corrected_robot(start, verdict.base.parameters),
        "corrected": corrected_robot(start, verdict.fits.final_refit.parameters),
        "truth known": truth,
    }
    steered = steer(models, truth, polygon(4, 3.0))
    for label, run in steered.items():
        print(f"  square planned with the model {label}: {run.error.rms:.4f} l rms on the true robot")
    return steered


def _calibrate(folder: Path, name: str) -> tuple[Verdict, Measurements]:
    start = PRESETS["paper-measured"]
    effects = HIDDEN_EFFECT if name == "hidden effect" else {}
    truth = replace(start, **HIDDEN, effects=effects)  # type: ignore[arg-type]
    seed = 3 if effects else 4
    table = make_table(truth, seed=seed, lengths_cm=_LENGTHS_CM, title=f"table, {name}")
    case = folder / name.replace(" ", "-")
    case.mkdir(exist_ok=True)
    write_csv(table, case / "table.csv", digits=6)
    data = read_measurements(case / "table.csv")
    verdict = calibrate(SwimmerModel(start, data), correction=learn_head_correction)
    record = verdict_record(verdict, table="table.csv")
    write_text(case / "verdict.json", json.dumps(record, indent=1) + "\n")
    write_text(
        case / "corrected.toml", corrected_toml(start, verdict.fits.final_refit, verdict.corrections.learnt)
    )
    print(f"  {name}: {verdict.sentence}")
    return verdict, data


def _write_page(
    out: Path,
    robot: Robot,
    motions: Sequence[Steady],
    rows: pd.DataFrame,
    small: NeuralTable,
    tracks: dict[str, tuple[dict[str, Any], TrackingError]],
    loops: dict[str, tuple[Verdict, Measurements]],
    steered: dict[str, Steered],
    seconds: float,
) -> None:
    page = Page(
        "A soft flagellated robot, from simulation to a schedule that works",
        "Simulated, learned, planned without simulating, replayed, and corrected from measurements.",
    )
    page.section("The robot and its circles")
    page.text(
        "Two straight tails on a disc behind the head bend as they turn. The head spins the other way, is pushed "
        "sideways by the surface, and the robot swims on a circle; a reversed motor mirrors it."
    )
    page.figure(_draw_robot(robot, motions), "tail shapes, and circles for both motor directions")
    motion = motions[0]
    page.text(
        f"Yaw rate {float(motion.omega_yr[0]):.4f}, turn radius {float(motion.turn_radius[0]):.3f} l, slip angle "
        f"{math.degrees(motion.slip_angle[0]):.1f} degrees (independent solver: 0.0490, 0.9415, 67.1)."
    )
    page.section("Three paths, planned without simulating")
    page.text(
        "The planner uses the look-up table only. The schedule is then replayed, open loop, in the simulator. "
        "Errors are distances from the declared path: the feasible path nearest to the given one. The robot "
        "cannot turn on the spot."
    )
    plans = _draw_plans(tracks)
    with whole_file(out.parent / "demo" / "plans.png") as part:
        plans.savefig(part, format="png", dpi=90, bbox_inches="tight")
    page.figure(plans, "three planned paths with the replayed tracks")
    header = (
        "path",
        "dwells",
        "minutes",
        "rms / l",
        "max / l",
        "stated error / l",
        "rms / l, raw",
        "max / l, raw",
    )
    page.table(
        header,
        [
            (name, len(plan["dwell_bar"]), f"{sum(plan['dwell_s']) / 60:.1f}", f"{e.rms:.4f}", f"{e.largest:.4f}",
             f"{e.stated:.3f}", f"{e.raw_rms:.3f}", f"{e.raw_largest:.3f}")
            for name, (plan, e) in tracks.items()
        ],
    )  # fmt: skip
    page.section("The sweep at a glance")
    page.text(f"{len(rows)} robots of the demo's small sweep; the shipped table learned from a full one.")
    good = usable_rows(rows)
    page.figure(
        draw_trends(good, "omega_yr_bar", ("omega_bar", "C_yr", "l_over_R", "C_t")), "yaw rate over inputs"
    )
    page.text("After a flip the tails turn over, and the robot lags behind its new circle:")
    page.figure(draw_responses(good), "lags and net speed over the dwell")
    page.section("Look-up table against simulator")
    page.figure(_draw_parity(rows), "shipped look-up table against simulated rows")
    shipped = load()
    page.text("Relative rms error on held-out rows (slip angle in degrees):")
    shown = ("omega_t_bar", "omega_yr_bar", "R_yr_over_l", "theta_deg", "v_z")
    page.table(
        ("look-up table", *shown),
        [
            (label, *(_figure(name, table.errors[name]["rms"]) for name in shown))
            for label, table in (("shipped", shipped), (f"trained in this demo on {len(rows)} rows", small))
        ],
    )
    for name, (verdict, data) in loops.items():
        page.section(f"Calibration with a table: {name}")
        page.text(verdict.sentence, tone="good" if verdict.verdict in ("effect", "none") else "bad")
        if verdict.verdict == "effect":
            page.figures(
                [(figure, f"residuals, {model}", model) for figure, model in draw_residuals(verdict, data)]
            )
        errors = [
            ("coefficients before calibration", verdict.error_uncalibrated),
            ("calibrated", verdict.error_before),
            ("calibrated, with the effect", verdict.error_after),
            ("noise of one run, from repeats", verdict.noise_ceiling),
        ]
        shown_errors = [e for e in errors if verdict.effects or "effect" not in e[0]]
        page.table(
            ("error on the held-out session", "relative rms"),
            [(label, f"{100 * value:.2f} %") for label, value in shown_errors],
        )
    page.section("Planning again: the square, on the robot with the hidden effect")
    rms = [run.error.rms for run in steered.values()]
    page.text(
        "Planned without simulating, with three models, run open loop on the true robot: "
        f"{rms[0]:.3f} l rms with the calibrated model, {rms[1]:.3f} l with the corrected one, {rms[2]:.3f} l "
        f"with the truth known. The correction closes {100 * gap_closed(*rms):.0f} % of the gap."
    )
    page.figure(draw_steered(steered), "tracks of the true robot under three plans")
    page.write(out, f"code {code_version()}, made in {seconds:.0f} s")


def _figure(name: str, rms: float) -> str:
    return f"{rms:.1g} deg" if name == "theta_deg" else f"{100 * rms:.1g} %"


def _draw_robot(robot: Robot, motions: Sequence[Steady]) -> Figure:
    figure = Figure(figsize=(11, 4.2))
    shape = figure.add_subplot(1, 2, 1, projection="3d")
    radius, length = robot.head_radius / robot.tail_length, robot.head_length / robot.tail_length
    angle, z = np.meshgrid(np.linspace(0, 2 * np.pi, 40), np.linspace(0, length, 2))
    shape.plot_surface(z, radius * np.cos(angle), radius * np.sin(angle), color="#c9d3dc", alpha=0.6)
    _, tails = tails_over_a_revolution(robot, 1)
    for x, y, z in tails[0].transpose(0, 2, 1):
        shape.plot(z, x, y, color="#c8452f", lw=3)
    shape.set_box_aspect((1.6, 0.6, 0.6))
    shape.set_title("steady shape at $\\bar\\omega$ = 10", fontsize=10)
    shape.set_xlabel("z / l", fontsize=8)
    shape.tick_params(labelsize=6)
    shape.set_yticks([-0.1, 0.1])
    shape.set_zticks([-0.1, 0.1])
    plane = figure.add_subplot(1, 2, 2)
    for motion, label, colour in zip(
        motions, ("$\\omega$ > 0", "$\\omega$ < 0"), ("#2a7fba", "#e08a1e"), strict=True
    ):
        turn, sway, surge = float(motion.omega_yr[0]), float(motion.v_x[0]), float(motion.v_z[0])
        time = np.linspace(0, 2 * np.pi / abs(turn), 300)
        heading = turn * time
        x = (surge * np.sin(heading) - sway * (1 - np.cos(heading))) / turn
        y = (surge * (1 - np.cos(heading)) + sway * np.sin(heading)) / turn
        plane.plot(x, y, color=colour, label=label)
    plane.plot(0, 0, "o", color="#1c2733", ms=4)
    plane.annotate("", (0.45, 0), (0, 0), arrowprops={"arrowstyle": "->", "color": "#1c2733"})
    plane.set_xlim(-2.05, 0.6)
    plane.set_aspect("equal")
    plane.set_xlabel("x / l (starting heading)")
    plane.set_ylabel("y / l")
    plane.set_title("circle of the head's centre", fontsize=10)
    plane.legend(frameon=False, fontsize=9)
    return figure


def _draw_plans(errors: dict[str, tuple[dict[str, Any], TrackingError]]) -> Figure:
    figure = Figure(figsize=(13, 4.6))
    for panel, (name, (plan, error)) in enumerate(errors.items()):
        axes = figure.add_subplot(1, len(errors), panel + 1)
        draw_overlay(axes, plan, error, f"{name}, N = {int(plan['robot']['groups']['N'])}")
    figure.axes[0].legend(fontsize=7, frameon=False, loc="center")
    figure.tight_layout()
    return figure


def _draw_parity(rows: pd.DataFrame) -> Figure:
    names = (("omega_yr_bar", "yaw rate"), ("v_z", "surge"), ("R_yr_over_l", "turn radius / l"),
             ("theta_deg", "slip angle [deg]"))  # fmt: skip
    good = usable_rows(rows)
    predicted = load().query({n: good[n].to_numpy(float) for n in (*GROUP_COLUMNS, *OPTIONAL_COLUMNS)}, flag=True)
    truth = {name: good[name].to_numpy(float) for name in ("v_x", *(name for name, _ in names))}
    figure = Figure(figsize=(12, 3.4))
    for panel, (name, label) in enumerate(names):
        axes = figure.add_subplot(1, 4, panel + 1)
        axes.plot(truth[name], predicted[name], ".", ms=4, color="#2a7fba", alpha=0.7)
        ends = [np.nanmin(truth[name]), np.nanmax(truth[name])]
        axes.plot(ends, ends, color="#1c2733", lw=0.7)
        error = np.nanmedian(np.abs(predicted[name] - truth[name]) / error_scale(name, truth))
        text = f"{error:.1g} deg" if name == "theta_deg" else f"{100 * error:.1g} %"
        axes.set_title(f"{label}: median error {text}", fontsize=9)
        axes.set_xlabel("simulated", fontsize=8)
        axes.tick_params(labelsize=7)
        if name in ("omega_yr_bar", "v_z"):
            axes.set_xscale("log")
            axes.set_yscale("log")
            plain_logarithms(axes.xaxis)
            plain_logarithms(axes.yaxis)
    figure.axes[0].set_ylabel("look-up table", fontsize=8)
    figure.tight_layout()
    return figure
