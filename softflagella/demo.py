"""Run the whole pipeline on the paper's robots with the commands that a user would type (`softflagella demo`).

The chains of `softflagella.demo_steps` run side by side, one for each core, in the folder `demo` beside the page.
"""

from __future__ import annotations

import os
import shlex
import shutil
import sys
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import chdir, redirect_stderr, redirect_stdout
from dataclasses import replace
from io import StringIO
from multiprocessing import get_context
from pathlib import Path
from runpy import run_module

import numpy as np

from calibration.swim.pose_noise import PoseNoise, Sizes
from calibration.swimmer.synthetic_table import make_table
from common.errors import InputError
from common.files import write_csv
from common.progress import progress_bar
from common.tables import read_table
from sim.inputs import save_robot
from sim.model.presets import PRESETS
from sim.motion.warm import compile_once
from sim.threads import available_jobs
from softflagella.demo_page import write_page
from softflagella.demo_steps import CHAINS, Done, Step
from tracking.tracks import LAB

# The robot behind the tables of runs; calibration starts from the paper's coefficients.
_HIDDEN = {"C_t": 3.1, "C_r": 2.4, "C_yr": 4.4}
_LENGTHS_CM = (6.0, 7.5, 9.0)
_BIAS = 0.05  # of the robot that swims, otherwise the paper's control robot, with coefficients that are off
_OFF = {"C_t": 1.03, "C_r": 0.97, "C_yr": 1.03}
# Of the camera: time between pictures [s]; errors of places [cm] and headings [°], white and again as slow ones;
# memory of these [s].
_EVERY, _ERRORS, _MEMORY = 0.5, np.array([0.03, 0.5]), 10.0


def run_demo(out: str | Path) -> None:
    """Run the pipeline; its files go to a folder beside the page."""
    began, page = time.perf_counter(), Path(out)
    folder = page.parent / "demo"
    folder.mkdir(parents=True, exist_ok=True)
    compile_once()
    shutil.rmtree(folder / "sweep", ignore_errors=True)  # an earlier demo's rows, perhaps of another version
    write_page(page, run_steps(CHAINS, folder, _write_hidden), time.perf_counter() - began)
    print(f"done in {time.perf_counter() - began:.0f} s -> {page}")


def _write_hidden(folder: Path) -> None:
    """Write the robot that swims, a table of runs with an effect that is hidden, and one without."""
    given = PRESETS["paper-control"]
    off = {name: factor * getattr(given, name) for name, factor in _OFF.items()}
    save_robot(replace(given, **off, effects={"left_right_bias": _BIAS}), folder / "truth.toml")
    for name, seed, effects in (("hidden-effect", 3, {"end_over_end_drag": 5.0}), ("nothing-hidden", 4, {})):
        truth = replace(PRESETS["paper-measured"], **_HIDDEN, effects=effects)  # type: ignore[arg-type]
        write_csv(make_table(truth, seed=seed, lengths_cm=_LENGTHS_CM), folder / name / "runs.csv", digits=6)


def _film(track: Path) -> None:
    """Write what a camera sees of a simulated track, with its errors, as film.csv beside it."""
    swim = read_table(track)
    time = np.arange(0.0, swim["time_s"].iloc[-1], _EVERY)
    poses = [swim[name] for name in LAB[1:3]] + [np.unwrap(swim[LAB[3]], period=360)]
    still = np.zeros(len(time), dtype=int)
    sizes = Sizes(_ERRORS, _ERRORS, 0 * _ERRORS, _MEMORY)
    noise = PoseNoise(still, time, still, np.zeros((len(time), 2)), sizes)
    exact = np.stack([np.interp(time, swim["time_s"], values) for values in poses], 1)
    seen = exact + noise.colour(np.random.default_rng(5).standard_normal((len(time), 3)))
    write_csv(dict(zip(LAB, (time, *seen.T), strict=True)), track.with_name("film.csv"), digits=6)


def run_steps(
    chains: Sequence[Sequence[Step]], folder: Path, prepare: Callable[[Path], None] | None = None
) -> list[Done]:
    """Run the first chain, then all others side by side; print their commands with what these print.

    Args:
        chains: of steps.
        folder: where the commands run.
        prepare: makes what the others need, of the folder, beside the first chain.

    Raises:
        InputError: a command fails.
    """
    os.environ.setdefault("OMP_NUM_THREADS", "1")  # in each process
    first, *others = chains
    longest_first = sorted(range(len(others)), key=lambda i: -sum(len(step.commands) for step in others[i]))
    done = list[Done]()
    # A process runs one command after another, so it imports once.
    with (
        progress_bar("demo", total=sum(map(len, chains)), unit="step") as shown,
        ProcessPoolExecutor(available_jobs(), get_context("forkserver")) as pool,
    ):
        try:
            running = {0: pool.submit(_run_chain, first, folder)}
            if prepare:
                pool.submit(prepare, folder).result()
            running[0].result()
            running |= {1 + i: pool.submit(_run_chain, others[i], folder) for i in longest_first}
            for place in range(len(chains)):
                steps = running[place].result()
                done += steps
                shown.update(len(steps))
                shown.write("\n".join(line for step in steps for line in step.lines()))
        except BrokenProcessPool:
            raise InputError("a process of the demo was killed; perhaps the machine ran out of memory") from None
        finally:
            pool.shutdown(cancel_futures=True)
    return done


def _run_chain(steps: Sequence[Step], folder: Path) -> list[Done]:
    return [_run_step(step, folder) for step in steps]


def _run_step(step: Step, folder: Path) -> Done:
    if step.filmed:
        _film(folder / step.filmed)
    return Done(step, [_run(words, folder) for words in step.commands])


def _run(words: str, folder: Path) -> str:
    """Run a command as `python -m softflagella` does, in a folder, and return what it prints."""
    printed, complaint = StringIO(), StringIO()
    with chdir(folder), redirect_stdout(printed), redirect_stderr(complaint):
        given, sys.argv = sys.argv, ["softflagella", *shlex.split(words)]
        try:
            run_module("softflagella", run_name="__main__")
        except SystemExit as end:
            if end.code:
                refusal = complaint.getvalue().strip().rpartition("error: ")[2] or end.code
                raise InputError(f"softflagella {words}: {refusal}") from None
        finally:
            sys.argv = given
    return printed.getvalue()
