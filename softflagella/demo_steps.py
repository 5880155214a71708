"""The steps of the demo: what each is for, its commands, and what these write.

Steps that build on each other are a chain. The commands run in the demo's folder.
"""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

SWEEP_TOML = Path(__file__).with_name("demo.toml")
_TWO_TAILS = "--set tails.count=2 --set motor.speed_rpm=43.26"
_PLAN_FILES = {
    "plan.svg": "a drawing of the plan",
    "schedule.h": "the schedule for a microcontroller",
    "plan.csv": "dwells and poses as a table",
    "plan.json": "everything about the plan",
    "track.csv": "the replayed track",
}


class Step(NamedTuple):
    """A step of the demo: what it is for, its commands, and what they write."""

    title: str
    words: str
    commands: tuple[str, ...]  # words behind softflagella
    files: Mapping[str, str]  # path in the demo's folder -> what it is
    picture: str = ""  # PNG
    filmed: str = ""  # a simulated track, which a camera sees beforehand, as film.csv beside it


class Done(NamedTuple):
    """A step that has been run, and what each of its commands has printed."""

    step: Step
    printed: Sequence[str]

    def lines(self) -> list[str]:
        """Return the commands as a user would type them, each with what it prints."""
        pairs = zip(self.step.commands, self.printed, strict=True)
        return [line for words, text in pairs for line in (f"$ softflagella {words}", *text.splitlines())]


def _path(path: str, robot: str, words: str) -> Step:
    """Plan a path, and replay the plan."""
    name = path.partition(":")[0]
    return Step(
        f"A {name}, planned without simulating",
        words,
        (
            f"plan {path} --robot {robot} --out {name}",
            f"replay {name}/plan.json --out {name}/track.csv --no-error",
            f"check {name}/plan.json {name}/track.csv --out {name}/track.png",
        ),
        {f"{name}/{file}": what for file, what in _PLAN_FILES.items()},
        f"{name}/track.png",
    )


def _calibration(name: str, about: str) -> Step:
    """Calibrate a robot with a table of runs."""
    return Step(
        f"The bench, a second way: a table of runs, {name.replace('-', ' ')}",
        f"Synthetic runs from a finer mesh, with noise, as a lab would measure them. {about}",
        (f"calibrate {name}/runs.csv --robot given.toml --out {name}",),
        {
            f"{name}/report.html": "the whole report: what to do next, fit, residuals, evidence",
            f"{name}/corrected.toml": "the corrected robot, to plan with from then on",
            f"{name}/runs.csv": "the runs",
            f"{name}/verdict.json": "the results as numbers",
        },
    )


def _swum(plan: str, track: str) -> str:
    """Let the true robot carry a plan out."""
    return f"replay {plan}/plan.json --robot truth.toml --out swim/{track}.csv --no-error"


_TRACKS = [f"swim/{track}.csv" for track in ("truth", "corrected", "given")]
CHAINS = (
    (
        Step(
            "The robot and its motion",
            'The control robot of Du, Miller and Jawed, "Simple flagellated soft robot for locomotion near '
            'air-fluid interface" (arXiv 2103.05712). The tails hang on a disc behind the head. They turn one '
            "way, the head the other way. The head is partly out of the fluid, so its spin pushes it sideways, "
            "and the robot turns on a circle: to the left with a motor at +1. A motor at −1 mirrors the motion.",
            (
                "robot paper-control --out robot.toml",
                f"robot paper-measured {_TWO_TAILS} --out given.toml",
                "steady robot.toml",
                "sim check",
            ),
            {"robot.toml": "this robot as a file, to be edited: its numbers, each with its unit"},
        ),
    ),
    (
        Step(
            "Its motion with another motor, or with other tails",
            "At constant motor speed the head's centre goes round a circle. To get ahead, the motor is reversed "
            "again and again: left and right turns cancel, and a net motion remains.",
            ("steady robot.toml --vary motor.speed_rpm=20:120:11 --vary tails.count=2,3,4,5 --plot motion.png",),
            {"motion.csv": "the same as a table"},
            "motion.png",
        ),
    ),
    (
        _path(
            "circle:1.5l",
            "robot.toml",
            "The planner asks the look-up table only, and states in advance how far the robot may be from the "
            "path. The schedule is then replayed in the simulator, open loop: nothing corrects the robot.",
        ),
    ),
    (
        _path(
            "square:3l",
            "robot.toml",
            "The robot cannot turn on the spot, so the plan declares the nearest path that it can follow. The "
            "motor needs the times in `schedule.h`, in milliseconds between flips, and nothing else.",
        ),
        Step(
            "The true robot swims the square",
            "No robot is as given. This one, `truth.toml`, turns better to the left than to the right (left-right "
            "bias of size 0.05), and its coefficients are 3 % off. It misses the square.",
            (_swum("square", "given"),),
            {"truth.toml": "the true robot"},
        ),
        Step(
            "From one swim to a corrected robot",
            "A camera has seen the swim twice a second, with errors of 0.4 mm and 0.7°, half of them slow. Its "
            "track tells what the model lacks. The square is planned again, with the corrected robot and, for "
            "comparison, with the true one, and the true robot swims both plans.",
            (
                "calibrate swim/film.csv --robot robot.toml --plan square/plan.json --no-path --out swim",
                "plan square:3l --robot swim/corrected.toml --out swim/again",
                "plan square:3l --robot truth.toml --out swim/known",
                _swum("swim/again", "corrected"),
                _swum("swim/known", "truth"),
                f"compare {' '.join(_TRACKS)} --plot swim/tracks.png",
            ),
            {
                "swim/film.csv": "what the camera saw",
                "swim/report.html": "the whole report",
                "swim/corrected.toml": "the corrected robot",
                **dict.fromkeys(_TRACKS, "a track"),
            },
            "swim/tracks.png",
            filmed="swim/given.csv",
        ),
    ),
    (_path("triangle:4l", "paper-triangle", "A robot with four tails."),),
    (
        Step(
            "The page that plans",
            "Draw a path in the browser, see what the robot will do, and save its schedule. The three paths are "
            "there; their `track.csv` can be dropped on them.",
            ("page --robot robot.toml --path circle:1.5l --path square:3l --path triangle:4l --out page.html",),
            {"page.html": "plan in your browser: robot, schedule and heading in time"},
        ),
    ),
    (
        Step(
            "A small sweep, and a look-up table of it",
            "The shipped look-up table learned from a full sweep; this one is too small to plan with.",
            (
                f"sweep --config {shlex.quote(str(SWEEP_TOML))} --out sweep",
                "dataset report sweep --out sweep.html",
                "train sweep --out model.safetensors --epochs 40",
                "surrogate errors",
            ),
            {
                "sweep.html": "the sweep at a glance: what depends on what, scaling laws, response to a flip",
                "sweep/card.md": "the card of the data",
                "model.md": "the card of the table that was trained here",
            },
        ),
    ),
    (
        _calibration(
            "hidden-effect",
            "The robot behind them has an effect that the model lacks, end-over-end drag of the head of size 5 in "
            "units of 8π μ0 R³. The calibration is not told.",
        ),
    ),
    (_calibration("nothing-hidden", "The robot behind them differs from the model in its coefficients only."),),
)
