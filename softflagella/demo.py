"""Run the whole pipeline on the paper's robots, ending with one page (`softflagella demo`).

Every step is a command that a user would type; it is printed and run. Independent steps (replays, simulations,
training and calibration) run side by side, one process for each core.

1. Simulate the robot: the shape of its tails, circles for both motor directions.
2. Plan circle, square (N = 2) and triangle (N = 4) from the look-up table alone, and replay them in the simulator.
3. Simulate a small sweep, and train a look-up table on it.
4. Calibrate with two synthetic tables from a finer mesh: one has an effect that the model lacks, one has none.
"""

from __future__ import annotations

import os
import shlex
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path

from tqdm import tqdm

from calibration.robot.corrected_robot import corrected_robot
from calibration.robot.robot_verdict import RobotVerdict
from calibration.swimmer.measured_table import Measurements, read_measurements
from calibration.swimmer.swimmer import SwimmerModel
from calibration.swimmer.synthetic_table import make_table
from calibration.verdict.calibrate import calibrate
from calibration.verdict.verdict import Verdict
from common.files import whole_file, write_csv, write_text
from dataset.data_set import read
from planner.files.saved_plan import load_plan
from planner.jobs.plan import plan
from planner.paths.path import Path2D, polygon
from sim.model.presets import PRESETS
from sim.model.robot import Robot
from sim.model.robot_toml import robot_toml
from sim.motion.replay import replay
from sim.motion.response import responses
from sim.motion.steady import steady
from sim.motion.steady_motion import Steady
from sim.motion.warm import compile_once
from sim.threads import available_jobs
from softflagella.demo_figures import draw_plans
from softflagella.demo_page import ROBOT_PAGE, Results, Swum, write_page
from surrogate.table_file import load
from surrogate.tabulate import tabulate
from tracking.tracks import check

CASES = {  # name of the path -> robot, path
    "circle": ("paper-control", "circle:1.5l"),
    "square": ("paper-control", "square:3l"),
    "triangle": ("paper-triangle", "triangle:4l"),
}
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
    plans = _plan_and_replay(folder)
    paths = [word for _, path in CASES.values() for word in ("--path", path)]
    _command("page", *paths, "--out", str(page_path.parent / ROBOT_PAGE))
    print("3/4 a small sweep and a look-up table trained on it")
    data, model = folder / "sweep", folder / "model.safetensors"
    shutil.rmtree(data, ignore_errors=True)  # an earlier demo's rows, perhaps of another version
    _command("sweep", "--config", str(SWEEP_TOML), "--out", str(data))
    with _beside("train", str(data), "--out", str(model), "--epochs", "60"):
        print("4/4 calibrate with two measured tables, while the look-up table is trained")
        loops = {name: _calibrate(folder, name) for name in ("hidden effect", "nothing hidden")}
        steered = _steer(loops["hidden effect"][0])
    found = Results(
        robot=robot,
        motions=motions,
        net_speed=responses(robot.groups(), motions[0]).net_speed[0],
        plans=plans,
        rows=read(data),
        small=load(model),
        loops=loops,
        steered=steered,
        seconds=time.perf_counter() - began,
    )
    write_page(page_path, found)
    print(f"done in {time.perf_counter() - began:.0f} s -> {page_path}")


def _command(*words: str, quiet: bool = False) -> None:
    """Print and run a command of softflagella."""
    if not quiet:
        print("  softflagella", shlex.join(words), flush=True)
    output = subprocess.DEVNULL if quiet else None
    subprocess.run([sys.executable, "-m", "softflagella", *words], check=True, stdout=output, stderr=output)


@contextmanager
def _beside(*words: str) -> Iterator[None]:
    """Print and start a command of softflagella; at the end of the block, wait for it and print its output."""
    print("  softflagella", shlex.join(words), flush=True)
    command = [sys.executable, "-m", "softflagella", *words]
    with tempfile.TemporaryFile("w+") as output:
        process = subprocess.Popen(command, stdout=output, stderr=subprocess.STDOUT)
        try:
            yield
            status = process.wait()
        finally:
            process.kill()
            process.wait()
        output.seek(0)
        print(output.read(), end="", flush=True)
    if status:
        raise subprocess.CalledProcessError(status, command)


def _look(folder: Path) -> tuple[Robot, list[Steady]]:
    """Write the robot's file and simulate its motion for both motor directions."""
    robot = PRESETS["paper-control"]
    write_text(folder / "robot.toml", robot_toml(robot))
    groups = robot.groups()
    return robot, [steady(replace(groups, omega_bar=s * groups.omega_bar)) for s in (1.0, -1.0)]


def _plan_and_replay(folder: Path) -> dict[str, Swum]:
    """Plan and replay all paths; return each plan with its tracking error."""
    for name, (robot, path) in CASES.items():
        _command("plan", path, "--robot", robot, "--out", str(folder / name))
    os.environ.update({name: "1" for name in ("OMP_NUM_THREADS", "MKL_NUM_THREADS")})

    def replay_one(name: str) -> None:
        plan, track = folder / name / "plan.json", folder / name / "track.csv"
        _command("replay", str(plan), "--out", str(track), "--no-error", quiet=True)

    for name in CASES:
        print(f"  softflagella replay {shlex.quote(str(folder / name / 'plan.json'))} --out …/track.csv")
    with (
        ThreadPoolExecutor(min(available_jobs(), len(CASES))) as pool,
        tqdm(total=len(CASES), desc="replay", unit="plan", disable=None) as bar,
    ):
        for _ in pool.map(replay_one, reversed(CASES)):
            bar.update()
    result = {}
    for name in CASES:
        planned = load_plan(folder / name / "plan.json")
        result[name] = planned, check(planned, folder / name / "track.csv")
        print(f"  {name}: {result[name][1].line}")
    with whole_file(folder / "plans.png") as part:  # of the README
        draw_plans(result).savefig(part, format="png", dpi=90, bbox_inches="tight")
    return result


def _steer(verdict: Verdict) -> dict[str, Swum]:
    """Plan a square with the calibrated, the corrected and the true model, and run the plans on the true robot."""
    start = replace(PRESETS["paper-measured"], tails=2).with_motor(10.0)
    truth = replace(start, **HIDDEN, effects=HIDDEN_EFFECT)  # type: ignore[arg-type]
    models = {
        "calibrated": corrected_robot(start, verdict.base.parameters),
        "corrected": corrected_robot(start, verdict.final_refit.parameters),
        "truth known": truth,
    }
    steered = steer(models, truth, polygon(4, 3.0))
    for label, (_, error) in steered.items():
        mm = 1000 * start.tail_length * error.rms
        print(f"  square planned with the model {label}: {mm:.1f} mm rms on the true robot")
    return steered


def steer(models: Mapping[str, Robot], truth: Robot, path: Path2D) -> dict[str, Swum]:
    """Plan a path with each of several models of a robot, and run the schedules on the true robot, open loop.

    With a wrong yaw rate the robot drifts from the path with every dwell. So errors of a few percent in the model
    can lead to errors as large as the path.

    Args:
        models: by label; the same robot with other coefficients, numbers and effects.
        truth: the robot that swims.
        path: to be planned.
    """
    runs = {}
    for label, model in models.items():
        planned = plan(path, model, lookup=tabulate(model))
        track = replay(planned.schedule(truth))
        track[["x_over_l", "y_over_l"]] *= truth.tail_length / model.tail_length
        runs[label] = (planned.to_dict(), check(planned, track))
    return runs


def _calibrate(folder: Path, name: str) -> tuple[RobotVerdict, Measurements]:
    start = PRESETS["paper-measured"]
    effects = HIDDEN_EFFECT if name == "hidden effect" else {}
    truth = replace(start, **HIDDEN, effects=effects)  # type: ignore[arg-type]
    seed = 3 if effects else 4
    table = make_table(truth, seed=seed, lengths_cm=_LENGTHS_CM, title=f"table, {name}")
    case = folder / name.replace(" ", "-")
    case.mkdir(exist_ok=True)
    write_csv(table, case / "table.csv", digits=6)
    data = read_measurements(case / "table.csv")
    of_robot = partial(RobotVerdict, robot=start, table=f"table with {name}")
    verdict = calibrate(SwimmerModel(start, data), verdict=of_robot)
    verdict.save(case)
    print(f"  {name}: {verdict.sentence}")
    return verdict, data
