"""Compare robots, plans, tracks or verdicts: a table of what differs, and a picture.

A file is read into quantities: words, or numbers with their intervals. Differences are from the first file: in per
cent or, where both numbers were fitted, in standard deviations of the difference,

    (x₂ − x₁) / √(σ₁² + σ₂²),   σ = width of the 95 % interval / 3.92,   of logarithms where these were fitted.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from common.arrays import Floats
from common.errors import InputError, naming
from common.reading import expecting, read_json

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from pandas import DataFrame

    from sim.knowledge import CalibrationKnowledge
    from sim.model.robot import Robot

_IN_FOLDER = ("plan.json", "verdict.json")
_HALF = 1.96  # standard deviations in half a 95 % interval
_LOGARITHM = "logarithm"  # the scale on which a number was fitted, as verdict.json says it
_MOTION = ("v_cm_s", "omega_yr_rad_s", "R_yr_cm", "theta_deg", "omega_h_rpm", "circle_s")
_IN_TAILS = ("time_bar", "x_over_l", "y_over_l", "heading_rad")  # of a replay
_ERRORS = {
    "stated error [mm]": "stated_error_over_l",
    "stated error, other coefficients [mm]": "stated_error_unmeasured_over_l",
    "error with feedback [mm]": "feedback_error_over_l",
    "predicted error, rms [mm]": "predicted_rms_over_l",
    "predicted error, at most [mm]": "predicted_max_over_l",
    "predicted error from the drawn path, rms [mm]": "drawn_rms_over_l",
}


class Bounded(NamedTuple):
    """A number with its interval, where it has one."""

    value: float
    low: float = math.nan
    high: float = math.nan
    scale: str = ""  # on which it was fitted, with a 95 % interval; empty: it was not

    def __str__(self) -> str:
        return f"{self.value:.4g}" + (f" ({self.low:.4g} to {self.high:.4g})" if self.low < self.high else "")

    @staticmethod
    def around(value: float, half: float, scale: str = "") -> Bounded:
        """Return a number with an interval, given half its width, on the scale on which it was fitted."""
        if scale == _LOGARITHM:
            return Bounded(value, value * math.exp(-half), value * math.exp(half), scale)
        return Bounded(value, value - half, value + half, scale)

    def minus(self, first: object) -> str:
        """Write the difference from the first file's number; nothing where there is none."""
        if not isinstance(first, Bounded) or self.value == first.value:
            return ""
        if self.scale and first.scale:
            a, b = np.array([first[:3], self[:3]])
            a, b = (np.log(a), np.log(b)) if self.scale == _LOGARITHM else (a, b)
            return f"{2 * _HALF * (b[0] - a[0]) / np.hypot(a[2] - a[1], b[2] - b[1]):+.1f} σ"
        return f"{100 * (self.value / first.value - 1):+.3g} %" if first.value else ""


Cells = dict[str, Bounded | str]  # title of a quantity -> what a file says of it


class Comparison(NamedTuple):
    """What several files say, and a picture of it."""

    files: dict[str, Cells]
    figure: Figure
    note: str = ""  # what the intervals are

    def lines(self) -> list[str]:
        """Write a table of what differs, and how many quantities are equal."""
        rows = [["", *self.files, "difference"]]
        titles = dict.fromkeys(title for cells in self.files.values() for title in cells)
        for title in titles:
            first, *others = (cells.get(title, "-") for cells in self.files.values())
            if any(str(each) != str(first) for each in others):
                apart = [each.minus(first) if isinstance(each, Bounded) else "" for each in others]
                rows.append([title, *map(str, (first, *others)), ", ".join(apart).strip(", ")])
        widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
        table = ["  ".join(map(str.ljust, row, widths)).rstrip() for row in rows]
        equal = f"{len(titles) - len(rows) + 1} of {len(titles)} quantities are equal"
        return [*(table if len(rows) > 1 else []), *filter(None, [self.note]), equal]


def compare(words: Sequence[str], plan: str | None = None) -> Comparison:
    """Compare two files or more of one kind.

    Args:
        words: robot.toml, presets; plan.json, verdict.json, their folders; or tracks.
        plan: plan.json of tracks.

    Raises:
        InputError: there is one file, they are of different kinds, or one cannot be read.
    """
    if len(words) < 2:
        raise InputError("give two files or more to compare")
    kinds, contents = zip(*map(_read, words), strict=True)
    for word, kind in zip(words, kinds, strict=True):
        if kind != kinds[0]:
            beside = ", a plan of tracks with --with" if {kind, kinds[0]} == {"plan", "track"} else ""
            raise InputError(f"{words[0]} is a {kinds[0]} and {word} a {kind}; give files of one kind{beside}")
    if plan is not None and kinds[0] != "track":
        raise InputError(f"--with {plan} is the plan of tracks; leave it out for a {kinds[0]}")
    whole = [Path(word).resolve() for word in words]
    short = [(path.parent if path.name in _IN_FOLDER else path).stem for path in whole]
    numbered = [f"{k} {word}" for k, word in enumerate(words, 1)]
    names = next(each for each in (short, words, numbered) if len({*each}) == len(words))
    given = dict(zip(names, contents, strict=True))
    by_kind: dict[str, Callable[..., Comparison]] = {"robot": _robots, "plan": _plans, "verdict": _verdicts}
    return _tracks(given, plan) if kinds[0] == "track" else by_kind[kinds[0]](given)


def _read(word: str) -> tuple[str, Any]:
    """Tell what a file is, and return its content."""
    from planner.files.saved_plan import load_plan, plan_json
    from sim.inputs import load_robot, names_robot
    from sim.knowledge import read_knowledge
    from tracking.tracks import read_track

    if names_robot(word):
        return "robot", (load_robot(word), read_knowledge(word))
    path = next((path for name in _IN_FOLDER if (path := Path(word, name)).is_file()), Path(word))
    if path.suffix == ".json":
        content = read_json(path)
        return ("verdict", content) if "verdict" in content else ("plan", load_plan(plan_json(path)))
    return "track", read_track(path)


def _robots(robots: Mapping[str, tuple[Robot, CalibrationKnowledge]]) -> Comparison:
    from sim.motion.batches import steady_columns
    from sim.motion.steady_motion import lab_title
    from sim.robot_rows import robot_rows
    from surrogate.answers import answer_rows
    from surrogate.table_file import load_table

    files, titles = dict[str, Cells](), {column: lab_title(column) for column in _MOTION}
    for name, (robot, known) in robots.items():
        rows = robot_rows(robot)
        try:
            motion, source = answer_rows(rows, load_table(None)), "look-up table, 90 %"
        except InputError:  # the table does not know it
            motion, source = steady_columns(rows.columns, title=""), "simulated, estimated errors"
        row = rows.frame(motion).iloc[0]
        moves = {title: Bounded.around(row[c], abs(row[c]) * row["error"]) for c, title in titles.items()}
        files[name] = {**_inputs(robot, known), **moves, "source of the motion": source}
    return Comparison(files, _dots(files, [*titles.values()][:4]), "intervals: of inputs 95 %, of the motion 90 %")


def _inputs(robot: Robot, known: CalibrationKnowledge) -> Cells:
    """Return the numbers of a robot.toml with the intervals of a calibration, or those that the file states."""
    from sim.model.entries import ENTRIES

    half = dict(zip(known.names, _HALF * np.sqrt(np.diag(known.covariance)), strict=True))
    cells = Cells()
    for entry in ENTRIES:
        size = robot.number(entry.field)
        stated = robot.sigmas[entry.field].of(size) if entry.field in robot.sigmas else 0.0
        fitted = (half[entry.field], _LOGARITHM) if entry.field in half else (_HALF * entry.written(stated), "")
        cells[f"{entry.table}.{entry.key}"] = Bounded.around(entry.written(size), *fitted)
    for name, size in robot.effects.items():
        cells[f"effects.{name}"] = Bounded.around(size, half.get(name, 0.0), "as it is" if name in half else "")
    return cells


def _plans(plans: Mapping[str, dict[str, Any]]) -> Comparison:
    from planner.paths.path import arc_length
    from sim.model.schedule import PLAN_FILE

    files = dict[str, Cells]()
    figure, (axes,) = _plane(1)
    for k, (name, plan) in enumerate(plans.items()):
        with expecting(PLAN_FILE, name, "plan again"):
            robot, seconds = plan["robot"], np.array(plan["dwell_s"])
            cm = 100 * robot["tail_length_m"]
            declared, drawn = (cm * np.array(plan[key]) for key in ("reference", "raw_path"))
            files[name] = {
                "robot": robot["name"],
                "tail length [cm]": Bounded(cm),
                **{group: Bounded(value) for group, value in robot.get("groups", {}).items()},
                **{key: str(plan.get(key, "-")) for key in ("point", "objective", "model")},
                "duration [s]": Bounded(seconds.sum()),
                "flips": Bounded(len(seconds) - 1),
                "shortest dwell [s]": Bounded(seconds.min()),
                "declared path [cm]": Bounded(arc_length(declared)[-1]),
                "path as drawn [cm]": Bounded(arc_length(drawn)[-1]),
                **{
                    title: Bounded(10 * cm * plan[key])
                    for title, key in _ERRORS.items()
                    if plan.get(key) is not None
                },
            }
        axes.plot(*drawn.T, color=f"C{k}", lw=0.8, ls=":")
        axes.plot(*declared.T, color=f"C{k}", lw=1.4, label=name)
    axes.set_title("declared paths; dotted: as drawn", fontsize=10)
    axes.legend(fontsize=8, frameon=False)
    return Comparison(files, figure)


def _tracks(tracks: Mapping[str, DataFrame], plan: str | None) -> Comparison:
    from planner.files.saved_plan import load_plan, plan_json
    from planner.paths.distance import distance_to
    from planner.paths.path import arc_length
    from tracking.tracks import poses_of, tracking_error

    content = None if plan is None else load_plan(plan_json(plan))
    files, read = dict[str, Cells](), list[tuple[Floats, Floats]]()
    figure, (axes, apart) = _plane(2)
    for k, (name, table) in enumerate(tracks.items()):
        # Tail lengths of different robots differ, so tracks are compared in cm.
        with naming(name):
            in_cm = {"tail_length_m": 0.01, "time_scale_s": 1.0}
            times, poses = poses_of(table.drop(columns=[*_IN_TAILS], errors="ignore"), in_cm)
            error = tracking_error(content, table) if content else None
        read.append((times, poses[:, :2]))
        x, y, heading = poses[-1]
        cells: Cells = {
            "duration [s]": Bounded(np.ptp(times)),
            "length [cm]": Bounded(arc_length(poses[:, :2])[-1]),
            "last pose [cm, degrees]": f"{x:.2f}, {y:.2f}, {math.degrees(heading):.1f}",
        }
        if error is not None:
            mm = 1000 * error.tail_length
            for key in ("rms", "largest"):
                cells[f"tracking error, {key} [mm]"] = Bounded(mm * getattr(error, key))
        if k:
            # The first track is what the others are compared with.
            gaps = {"from its path": 10 * distance_to(read[0][1], poses[:, :2])}
            begin, end = max(times[0], read[0][0][0]), min(times[-1], read[0][0][-1])
            if begin < end:
                both = np.linspace(begin, end, 2000)
                here, there = ([np.interp(both, t, xy) for xy in places.T] for t, places in (read[k], read[0]))
                gaps["at equal times"] = 10 * np.hypot(*np.subtract(here, there))
                apart.plot(both, gaps["at equal times"], color=f"C{k}")
            for words, gap in gaps.items():
                cells[f"off the first {words}, rms [mm]"] = Bounded(math.sqrt((gap**2).mean()))
                cells[f"off the first {words}, largest [mm]"] = Bounded(gap.max())
        files[name] = cells
        axes.plot(*poses[:, :2].T, color=f"C{k}", lw=1.2, label=name)
        axes.plot(x, y, "o", color=f"C{k}", ms=5)
    if content:
        cm = 100 * content["robot"]["tail_length_m"]
        axes.plot(*(cm * np.array(content["reference"]).T), color="black", lw=0.8, label="declared path")
    apart.set(xlabel="time [s]", ylabel=f"distance from {next(iter(files))} at equal times [mm]")
    axes.legend(fontsize=8, frameon=False)
    return Comparison(files, figure)


def _verdicts(verdicts: Mapping[str, dict[str, Any]]) -> Comparison:
    files = dict[str, Cells]()
    for name, record in verdicts.items():
        with expecting("a verdict.json of this version", name, "calibrate the table again"):
            cells = files[name] = {key: str(record[key]) for key in ("verdict", "advice", "table")}
            cells["effects"] = ", ".join(record["effects"]) or "none"
            cells["runs"] = Bounded(record["number_of_runs"])
            for model, ends in (("uncalibrated", []), ("before", []), ("after", record["error_after_interval"])):
                if (error := record[f"error_{model}"]) is not None:
                    cells[f"error {model} [%]"] = Bounded(*(100 * each for each in (error, *ends)))
            for number in record["parameters"].values():
                title = f"{number['title']} [{number['unit']}]".removesuffix(" [1]").removesuffix(" []")
                value, low, high = (number["shown"] * each for each in (number["value"], *number["interval"]))
                cells[title] = Bounded(value, low, high, number["scale"])
            for output, scatter in record["scatter_of_a_run"].items():
                scale, unit = record["output_scales"][output]
                cells[f"noise, {record['output_titles'][output]} [{unit}]"] = Bounded(scale * scatter)
    counts = Counter(t for cells in files.values() for t, cell in cells.items() if isinstance(cell, Bounded))
    shared = [title for title, count in counts.items() if count > 1 and title != "runs"]
    return Comparison(files, _dots(files, shared), "intervals: 95 %")


def _plane(count: int) -> tuple[Figure, Sequence[Axes]]:
    """Make a figure with `count` axes, the first of which is for paths in cm."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(5.5 * count, 5), layout="constrained")
    panels = figure.subplots(1, count, squeeze=False)[0]
    panels[0].set_aspect("equal", adjustable="datalim")
    panels[0].set(xlabel="x [cm]", ylabel="y [cm]")
    return figure, panels


def _dots(files: Mapping[str, Cells], titles: Sequence[str]) -> Figure:
    """Draw numbers with their intervals, a panel for each quantity and a row for each file."""
    from matplotlib.figure import Figure

    rows = max(1, -(-len(titles) // 2))
    figure = Figure(figsize=(7.5, (0.7 + 0.25 * len(files)) * rows), layout="constrained")
    for number, title in enumerate(titles, 1):
        axes = figure.add_subplot(rows, 2, number)
        for k, cells in enumerate(files.values()):
            if isinstance(cell := cells.get(title), Bounded):
                axes.plot(cell.value, k, "o", color=f"C{k}", ms=5)
                axes.plot([cell.low, cell.high], [k, k], color=f"C{k}", lw=1.5)
        names = [*files] if number % 2 else [""] * len(files)
        axes.set_yticks(range(len(files)), names, fontsize=8, parse_math=False)
        axes.set_ylim(len(files) - 0.5, -0.5)
        axes.set_xlabel(title, fontsize=9)
        axes.tick_params(labelsize=8)
        axes.grid(alpha=0.25)
    return figure
