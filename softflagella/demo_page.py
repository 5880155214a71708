"""Write the demo's page: what was simulated, learned, planned and calibrated, in the units of a lab.

The page is one file; it links to the files of the demo's folder beside it, and to the documentation where there is
a checkout of the repository.
"""

from __future__ import annotations

import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from calibration.report.figures import draw_summary
from calibration.swimmer.measured_table import Measurements
from calibration.verdict.verdict import Verdict
from calibration.words.quantities import plain
from common.arrays import Floats
from common.pages import Page
from common.provenance import code_version
from common.units import format_length, format_time
from dataset.report import usable_rows
from sim.model.groups import GROUP_COLUMNS, OPTIONAL_COLUMNS
from sim.model.presets import INDEPENDENT
from sim.model.robot import Robot
from sim.motion.steady_motion import RPM, Steady, lab_motion
from softflagella.demo_figures import (
    draw_circles,
    draw_net_speed,
    draw_parity,
    draw_path,
    draw_robot,
    draw_schedule,
    draw_sweep,
    in_lab_units,
)
from surrogate.table import NeuralTable
from surrogate.table_file import load
from tracking.tracks import TrackingError

_DOCS = Path(__file__).parents[1] / "docs"
_PAGES = (  # of the documentation: name without suffix, title, what it is
    ("tutorial/schedule", "From a robot to a schedule", "the first tutorial, ten minutes"),
    ("tutorial/calibration", "Calibrating the model", "the second tutorial"),
    ("howto/tank", "Calibrate your tank", "which runs to make"),
    ("reference/signs", "Signs and frames", "which way +1 turns, and a check on the bench"),
    ("howto/tracker", "Keep a robot on its path with a camera", "a schedule with feedback"),
)
ROBOT_PAGE = "robot.html"  # the page that plans, beside the demo's page
ROBOT_PICTURE = _DOCS / "page.png"  # of it; there is none without a checkout
PLAN_FILES = {
    "schedule.h": "the schedule for a microcontroller",
    "plan.csv": "dwells and poses as a table",
    "plan.json": "everything about the plan",
    "plan.svg": "a drawing of it",
    "track.csv": "the replayed track",
}
_ERRORS = {  # column of a look-up table -> what it is called
    "omega_t_bar": "tail spin",
    "omega_yr_bar": "yaw rate",
    "R_yr_over_l": "turn radius",
    "theta_deg": "slip angle",
    "v_z": "forward speed",
}


Swum = tuple[dict[str, Any], TrackingError]  # a plan.json, and how a robot swam it


@dataclass(frozen=True)
class Results:
    """What the demo found, in the order of its steps."""

    robot: Robot
    motions: Sequence[Steady]  # for both directions of the motor
    net_speed: Floats  # (D,) of equal dwells, see `sim.model.response`
    plans: dict[str, Swum]  # by the name of the path
    rows: pd.DataFrame  # of the sweep
    small: NeuralTable  # trained on them
    loops: Mapping[str, tuple[Verdict, Measurements]]  # calibrations by name; the folder's name has dashes
    steered: dict[str, Swum]  # by the name of the model
    seconds: float


def write_page(out: Path, results: Results) -> None:
    """Write the page; the demo's files are in the folder `demo` beside it."""
    page = Page(
        "A soft flagellated robot, from a robot.toml to a schedule, in simulation",
        "A motor in a cylindrical head turns straight elastic tails just below the surface of a viscous fluid. "
        "Its only control input is the direction of the motor. On this page the robot is simulated, its motion "
        "learned, three paths are planned without simulating and replayed in the simulator, and the model is "
        "corrected from measurements.",
    )
    _add_robot(page, results)
    _add_motion(page, results)
    _add_plans(page, results)
    _add_schedule(page, results, out.parent / "demo")
    _add_sweep(page, results)
    _add_table(page, results)
    for name in results.loops:
        _add_calibration(page, results, name)
    _add_steered(page, results.steered)
    _add_own_robot(page, out.parent)
    page.write(out, f"code {code_version()}, made in {format_time(results.seconds)}")


def _add_robot(page: Page, results: Results) -> None:
    robot = results.robot
    page.section("The robot")
    page.text(
        'The control robot of Du, Miller and Jawed, "Simple flagellated soft robot for locomotion near '
        'air-fluid interface" (arXiv 2103.05712). The tails hang on a disc behind the head. They turn one way, '
        "the head the other way. The head is partly out of the fluid, so its spin pushes it sideways, and the "
        "robot turns on a circle. A motor at +1 turns the tails clockwise, seen from behind, and the robot to "
        "the left. A motor at −1 mirrors the motion."
    )
    page.figures(draw_robot(robot))
    page.table(
        ("quantity", "value"),
        [
            ("tails", f"N = {robot.tails}"),
            ("tail length l", format_length(robot.tail_length)),
            ("radius of a tail's section", format_length(robot.tail_radius)),
            ("Young's modulus of the tails", f"{robot.youngs_modulus / 1e6:.3g} MPa"),
            ("head radius, length", f"{format_length(robot.head_radius)}, {format_length(robot.head_length)}"),
            ("motor speed, tails relative to the head", f"{robot.motor_speed / RPM:.3g} rpm"),
            ("viscosity of the fluid", f"{robot.viscosity:.3g} Pa s"),
            (
                "head's coefficients of drag, spin drag and side force, C_t, C_r and C_yr",
                f"{robot.C_t:g}, {robot.C_r:g}, {robot.C_yr:g}",
            ),
        ],
    )
    page.text(
        f"Inside the package lengths are in tail lengths l ({format_length(robot.tail_length)} here) and times in "
        f"μ0 l⁴/EI ({robot.time_scale:.3g} s here), the time in which the fluid lets a bent tail relax."
    )
    page.links([("demo/robot.toml", "robot.toml", "this robot as a file, to be edited")])


def _add_motion(page: Page, results: Results) -> None:
    robot, motion = results.robot, results.motions[0]
    page.section("Its motion")
    page.text(
        "At constant motor speed the head's centre goes round a circle. To get ahead, the motor is reversed "
        "again and again: left and right turns cancel, and a net motion remains. It is slow if the tails have "
        "no time to turn over between two flips."
    )
    page.figures(
        [
            (draw_circles(robot, results.motions), "circles of the head's centre for both directions of the motor",
             "Circles of the head's centre, from the same start."),
            (draw_net_speed(robot, results.net_speed), "net speed against the time between flips",
             "Net speed when the motor flips at equal times."),
        ]
    )  # fmt: skip
    page.table(
        ("motor at +1", "simulated", "independent solver"),
        [
            (row[0], row[1], other[1])
            for row, other in zip(
                _motion_in_words(robot, motion.columns()), _motion_in_words(robot, INDEPENDENT), strict=True
            )
        ],
    )
    page.text("The independent solver is another program for the same equations.")


def _motion_in_words(robot: Robot, motion: Mapping[str, Any]) -> list[tuple[str, str]]:
    """List the quantities of a motion with their values."""
    motion = {name: np.atleast_1d(values) for name, values in motion.items()}
    lab = {name: float(values[0]) for name, values in lab_motion([robot], motion).items()}
    return [
        (f"spin of the tails, {_sense(lab['omega_t_rpm'])} from behind", f"{abs(lab['omega_t_rpm']):.3g} rpm"),
        (f"spin of the head, {_sense(lab['omega_h_rpm'])} from behind", f"{abs(lab['omega_h_rpm']):.3g} rpm"),
        (
            f"yaw rate, to the {'left' if lab['omega_yr_rad_s'] > 0 else 'right'}",
            f"{abs(lab['omega_yr_rad_s']):.3g} rad/s",
        ),
        ("turn radius", f"{lab['R_yr_cm']:.3g} cm"),
        ("slip angle, between axis and path", f"{lab['theta_deg']:.3g}°"),
        ("speed along the circle", f"{lab['v_cm_s']:.3g} cm/s"),
        ("time of a circle", format_time(lab["circle_s"])),
    ]


def _sense(spin: float) -> str:
    return "clockwise" if spin > 0 else "counter-clockwise"


def _add_plans(page: Page, results: Results) -> None:
    page.section("Three paths, planned without simulating")
    page.text(
        "The planner asks the look-up table only. The schedule is then replayed in the simulator, open loop: "
        "nothing corrects the robot on its way. The robot cannot turn on the spot, so the plan declares the "
        "nearest path that it can follow, and states in advance how far the robot may be from it."
    )
    page.figures(
        [
            (draw_path(plan, error), f"{name}: planned path with the replayed track",
             f"{name.capitalize()}, {int(plan['robot']['groups']['N'])} tails, "
             f"{format_time(sum(plan['dwell_s']))}.")
            for name, (plan, error) in results.plans.items()
        ]
    )  # fmt: skip
    rows = []
    for name, (plan, error) in results.plans.items():
        mm = 1000 * plan["robot"]["tail_length_m"]
        rows.append(
            (
                name,
                str(len(plan["dwell_s"]) - 1),
                format_time(sum(plan["dwell_s"])),
                f"{plan['minimum_dwell_bar'] * plan['robot']['time_scale_s']:.2g} s",
                f"{mm * error.stated:.1f} mm",
                f"{mm * error.largest:.1f} mm",
                f"{mm * error.rms:.1f} mm",
                f"{mm * error.raw_rms:.1f} mm",
            )
        )
    page.table(
        ("path", "flips", "duration", "shortest dwell allowed", "stated error", "largest error", "rms error",
         "rms from the path as given"),
        rows,
    )  # fmt: skip
    page.text("Errors are distances from the declared path; the last column is from the path as given.")
    files = "; ".join(f"`{file}`, {words}" for file, words in PLAN_FILES.items())
    page.text(f"Files of each plan: {files}.")
    for name in results.plans:
        page.link_line(name.capitalize(), [(f"demo/{name}/{file}", file) for file in PLAN_FILES])


def _add_schedule(page: Page, results: Results, folder: Path) -> None:
    name = "square"
    plan = results.plans[name][0]
    page.section("The schedule itself")
    page.text(
        f"This is all that the motor needs to know for the {name}: which way to turn, and when to flip. Blue: "
        "+1, the robot turns left. Orange: −1, it turns right. The shaded interval of the whole schedule is "
        "magnified below it, with the heading of the replayed robot. A dwell is the time between two flips. "
        "Longer dwells at +1 turn the robot to the left on average."
    )
    track = pd.read_csv(folder / name / "track.csv")
    page.figures(
        [(draw_schedule(plan, track), "motor direction over time, a magnified interval, and the heading", "")]
    )  # fmt: skip
    page.text("The same for a microcontroller, from `schedule.h` (milliseconds between flips):")
    page.commands(header_excerpt((folder / name / "schedule.h").read_text()))
    page.links([(ROBOT_PAGE, "Plan in your browser", "draw a path, see what the robot will do, save its schedule; "
                 "the three paths are there, and their `track.csv` can be dropped on them")])  # fmt: skip
    if ROBOT_PICTURE.is_file():
        page.picture(ROBOT_PICTURE.read_bytes(), "the page that plans: a square, its zigzag, the robot to scale")


def _add_sweep(page: Page, results: Results) -> None:
    page.section("A small sweep")
    page.text(
        f"{len(results.rows)} robots of the demo's small sweep, each as if it had this robot's head, fluid and "
        "silicone. The shipped look-up table learned from a full sweep."
    )
    page.figures(draw_sweep(in_lab_units(good := usable_rows(results.rows), good, results.robot)))


def _add_table(page: Page, results: Results) -> None:
    page.section("Look-up table against simulator")
    shipped, good = load(), usable_rows(results.rows)
    inputs = {name: good[name].to_numpy(float) for name in (*GROUP_COLUMNS, *OPTIONAL_COLUMNS)}
    predicted = shipped.query(inputs, flag=True)
    page.text("The shipped look-up table predicts the robots of this sweep, which it has not seen.")
    page.figures(
        draw_parity(in_lab_units(good, good, results.robot), in_lab_units(good, predicted, results.robot))
    )
    page.text("Relative rms error on held-out robots (of the slip angle in degrees):")
    tables = (("shipped", shipped), (f"trained in this demo on {len(results.rows)} robots", results.small))
    page.table(
        ("look-up table", *_ERRORS.values()),
        [(label, *(_error(name, table.errors[name]["rms"]) for name in _ERRORS)) for label, table in tables],
    )
    page.links([("demo/model.md", "model.md", "the card of the table that was trained here")])


def _error(name: str, rms: float) -> str:
    return f"{plain(rms, 1)}°" if name == "theta_deg" else f"{plain(100 * rms, 1)} %"


def _add_calibration(page: Page, results: Results, name: str) -> None:
    verdict, data = results.loops[name]
    folder = f"demo/{name.replace(' ', '-')}"
    page.section(f"Calibration with a table of runs: {name}")
    page.text(
        f"{len(data)} synthetic runs from a finer mesh, with noise, as a lab would measure them. "
        + (
            "The robot behind them has an effect that the model lacks, end-over-end drag of the head of size 5 "
            "in units of 8π μ0 R³. The calibration is not told."
            if name.startswith("hidden")
            else "The robot behind them differs from the model in its coefficients only."
        )
    )
    confirmed = verdict.verdict == "none" or (verdict.verdict == "effect" and verdict.held_out_error_falls)
    page.text(verdict.sentence, tone="good" if confirmed else "bad")
    errors = [
        ("coefficients before calibration", verdict.error_uncalibrated),
        ("calibrated", verdict.error_before),
        *([("calibrated, with the effect", verdict.error_after)] if verdict.effects else []),
        ("noise of one run, from repeats", verdict.noise_ceiling),
    ]
    page.table(
        (f"error on the held-out session ({verdict.split.names})", "relative rms"),
        [(label, f"{100 * value:.2f} %") for label, value in errors],
    )
    page.figures([(draw_summary(verdict), "residual of each output over the noise of a run",
                   "Residuals of the runs that were fitted.")])  # fmt: skip
    page.links(
        [
            (
                f"{folder}/report.html",
                "report.html",
                "the whole report: what to do next, fit, residuals, evidence",
            ),
            (f"{folder}/corrected.toml", "corrected.toml", "the corrected robot, to plan with from then on"),
            (f"{folder}/table.csv", "table.csv", "the runs"),
            (f"{folder}/verdict.json", "verdict.json", "the results as numbers"),
        ]
    )


def _add_steered(page: Page, steered: Mapping[str, Swum]) -> None:
    page.section("Planning again: what the correction is worth")
    before, after, best = (error.rms for _, error in steered.values())
    page.text(
        "A square, planned without simulating with three models of the robot with the hidden effect, and swum "
        f"open loop by that robot. The correction closes {100 * (before - after) / (before - best):.0f} % of the "
        "gap between the calibrated model and the truth."
    )
    figures = []
    for label, (plan, error) in steered.items():
        rms = f"{label}: {1000 * plan['robot']['tail_length_m'] * error.rms:.1f} mm rms"
        figures.append((draw_path(plan, error, "swum"), f"track under the plan with the model {label}", rms))
    page.figures(figures)


def _add_own_robot(page: Page, folder: Path) -> None:
    page.section("With your own robot: three commands")
    page.commands(
        [
            "softflagella robot paper-control --out robot.toml",
            "softflagella plan square:30cm --robot robot.toml --out plan",
            "softflagella replay plan/plan.json --out track.csv",
        ]
    )
    page.steps(
        numbered=True,
        steps=[
            "The first command writes an example: put in the numbers of your robot and of your fluid.",
            "The second plans a square with sides of 30 cm. A path can be a circle, a polygon, a table of "
            "points or an SVG drawing. The folder `plan` has schedule.h for the motor.",
            "The third simulates the schedule.",
            "With a table of runs of your own, `softflagella calibrate runs.csv --robot robot.toml --out "
            "calibrated` says what the model lacks, and corrects it.",
        ],
    )
    links = documentation(folder)
    if links:
        page.text("Documentation:")
        page.links(links)
    else:
        page.text("The documentation is in the folder docs of the repository.")


def header_excerpt(header: str) -> list[str]:
    """Return the numbers that a schedule.h defines, and the first line of its dwells."""
    lines = header.splitlines()
    defined = [line for line in lines if re.match(r"#define SCHEDULE_\w+ [-(\d]", line)]
    dwells = next(place for place, line in enumerate(lines) if line.strip()[:1].isdigit())
    return [*defined, *lines[dwells - 1 : dwells + 1], "    …"]


def documentation(folder: Path) -> list[tuple[str, str, str]]:
    """List pages of the documentation, relative to a folder: HTML if it was built; none without a checkout."""
    built = _DOCS / "_build" / "html"
    root, suffix = (built, ".html") if (built / "index.html").is_file() else (_DOCS, ".md")
    return [
        (os.path.relpath(path, folder), title, words)
        for name, title, words in _PAGES
        if (path := root / f"{name}{suffix}").is_file()
    ]
