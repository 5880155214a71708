"""One command over all packages: `softflagella plan PATH`, `softflagella camera view FILM`.

The most important commands of the packages have words of their own, all others stand behind the package's name.
"""

from __future__ import annotations

import difflib
import sys
from collections.abc import Sequence
from importlib import import_module

from common.changes import RobotSource
from common.commands import Call, Program, Subcommand, to_stderr
from common.errors import InputError, run_command
from common.reading import refuse_missing
from softflagella.shadowing import COMMANDED

_IMPORTANT = (
    ("planner", "robot"),
    ("sim", "steady effects"),
    ("planner", "plan goal tour hold"),
    ("tracking", "track"),
    ("planner", "page"),
    ("dataset", "sweep"),
    ("surrogate", "train"),
    ("camera", "tracks"),
    ("softflagella", "calibrate model"),
    ("tracking", "replay check"),
    ("sim", "film"),
    ("surrogate", "query"),
    ("softflagella", "compare"),
    ("softflagella", "demo"),
)
WORDS = {  # the most important commands -> package and command
    word: (package, "build" if word == "sweep" else word)
    for package, words in _IMPORTANT
    for word in words.split()
}
_WORD_OF = {place: word for word, place in WORDS.items()}
_MOST_LINES = 8  # about a verdict
program = Program("softflagella", "soft flagellated robots near a surface")


@program.command("demo")
def _demo(*, out: str = "reports/demo.html") -> None:
    """Run the whole pipeline on the paper's robots.

    Args:
        out: page.
    """
    from softflagella.demo import run_demo

    run_demo(out)


@program.command(
    "calibrate", of="softflagella.closed_loop:calibrate", paths="path", progress="", written_by="from"
)
def _calibrate(
    calibrate: Call,
    table: str = "",
    *,
    robot: RobotSource | None = None,
    model: str | None = None,
    out: str,
    films: str | None = None,
    view: str | None = None,
    paths: Sequence[str] | None = None,
    no_path: bool = False,
) -> None:
    """Fit a table or a track, find what the model lacks, correct the robot.

    Args:
        table: CSV or Parquet of measured runs, or the track of a swim; or --films and --view.
        robot: robot.toml or the name of a preset; or --model.
        model: PY, a file with a model of your own (softflagella model writes one).
        films: TABLE, of runs with their films, in a column film; the measured table goes into the folder.
        view: TOML, scale, lens and markers of the films.
        paths: a path, as for softflagella plan, on which the error is stated before and after (default:
            square:3l).
        no_path: state no error on a path, which takes some seconds, up to two minutes where the parts of the robot
            move in each other's flow or touch.
    """
    if bool(table) == bool(films) or bool(films) != bool(view):
        raise InputError("give a table of runs, or --films runs.csv with --view view.toml")
    if bool(robot) == bool(model) or (model and films):
        raise InputError("give --robot, or, for a table, --model with a model of your own")
    if no_path and paths:
        raise InputError("--path and --no-path exclude each other")
    refuse_missing(*filter(None, (table, model)))
    from calibration.verdict.verdict import FILES  # loads SciPy
    from common.files import refuse_kept, refuse_unwritable

    refuse_unwritable(out)
    refuse_kept(out, ["table.csv", *FILES] if films else FILES)  # before hours of work
    if films and view and robot:
        table = _filmed(films, view, robot, out)
    from calibration.own_model.model_file import load_model
    from calibration.statistics.budget import stopped_by_interrupt
    from calibration.table.excluded import summary_of_excluded
    from softflagella.path_error import DEFAULT_PATHS

    given, measured = load_model(model, table) if model else (robot, table)
    stated = paths or () if no_path or model else paths or DEFAULT_PATHS
    with stopped_by_interrupt():
        result = calibrate(table=measured, robot=given, paths=stated, tell=to_stderr)
    files = result.save(out)
    beside = [error.sentence for error in result.paths]
    beside += [f"the conclusion is weaker: {limit}" for limit in result.caveats]
    beside += [f"excluded: {line}" for line in summary_of_excluded(result.split.outliers, result.rows)]
    room = _MOST_LINES - 1 - len(result.in_brief)
    if len(beside) > room:
        beside[room - 1 :] = [f"{len(beside) - room + 1} more lines are in the report"]
    print(*result.in_brief, *beside, sep="\n")
    print(f"-> {', '.join(map(str, files))}")


@program.command("model")
def _model(*, out: str | None = None, trace: bool = False) -> None:
    """Write a model to start from, for softflagella calibrate --model.

    Args:
        out: PY, default falls.py, with --trace cups.py.
        trace: of time series: cups that cool.
    """
    from calibration.own_model.model_file import write_example

    file, command = write_example(out, traces=trace)
    print(f"-> {file}; python {file} makes a table for it, {command.split()[2]}. Then:")
    print(command)


@program.command("compare", plan="with")
def _compare(files: Sequence[str], *, plan: str | None = None, plot: str | None = None) -> None:
    """Say what differs between robots, plans, tracks or verdicts.

    Args:
        files: two or more of one kind: robot.toml, presets; plan.json, verdict.json, or their folders; tracks.
        plan: plan.json, the plan of tracks.
        plot: SVG, PNG or PDF, a picture of them.
    """
    from common.figure_files import check_figure_name, write_figure
    from softflagella.compare import compare

    if plot is not None:
        check_figure_name(plot)
    comparison = compare(files, plan)
    print(*comparison.lines(), sep="\n")
    if plot is not None:
        write_figure(comparison.figure, plot)
        print(f"-> {plot}")


def _filmed(films: str, view: str, robot: RobotSource, out: str) -> str:
    """Measure films; write table.csv and return its path."""
    from camera.measured_films import measure_films
    from common.files import make_folder, write_csv
    from sim.inputs import load_robot

    measured = measure_films(films, view, load_robot(robot), tell=to_stderr)
    for line in (*measured.converted, *(f"excluded: {line}" for line in measured.excluded)):
        to_stderr(line)
    make_folder(out)
    table = f"{out}/table.csv"
    write_csv(measured.table, table, digits=6)
    return table


def program_of(package: str) -> Program:
    """Return the commands of a package."""
    packaged: Program = import_module(f"{package}.__main__").program
    return packaged


def command(word: str) -> Subcommand:
    """Return the command that a word stands for."""
    package, name = WORDS[word]
    return program_of(package).commands[name]


def further(package: str) -> Program:
    """Return the commands of a package that have no word of their own."""
    packaged = program_of(package)
    rest = Program(package, packaged.about)
    rest.commands = {name: each for name, each in packaged.commands.items() if (package, name) not in _WORD_OF}
    return rest


def packages() -> list[str]:
    """List the packages that have further commands."""
    return [package for package in COMMANDED if further(package).commands]


def _overview() -> str:
    lines = ["usage: softflagella COMMAND …", "", "commands:"]
    lines += [f"  {word:12} {command(word).help}" for word in WORDS]
    lines += ["", "further commands, by package (softflagella PACKAGE COMMAND …):"]
    lines += [f"  {name:12} {program_of(name).about}" for name in packages()]
    lines += ["", "--help after a command or a package tells more; --version prints the version."]
    return "\n".join(lines)


def _suggestion(word: str) -> str:
    """Suggest a command for a word that is none: one of a package, one that is spelt nearly so, or all."""
    for package in COMMANDED:
        if word in program_of(package).commands:
            return f"it is softflagella {_WORD_OF.get((package, word), f'{package} {word}')}"
    if own := [name for name, (package, _) in WORDS.items() if package == word]:
        return f"its commands are {', '.join(f'softflagella {name}' for name in own)}"
    known = (*WORDS, *packages())
    near = difflib.get_close_matches(word, known, 1)
    return f"is it {near[0]}?" if near else f"there are {', '.join(known)}"


def _short_form(words: list[str]) -> str | None:
    """Return the word for a command that was looked for in a package: that of the package, or of another one."""
    package, name = [*words, ""][:2]
    elsewhere = name in WORDS and name not in further(package).commands
    return _WORD_OF.get((package, name)) or (name if elsewhere else None)


def main(argv: list[str] | None = None) -> None:
    """Run the command that the words name."""
    words = sys.argv[1:] if argv is None else argv
    if not words or words[0] in ("-h", "--help", "help"):
        print(_overview())
    elif words[0] in ("--version", "-V"):
        from common.provenance import __version__

        print(f"softflagella {__version__}")
    elif words[0] in WORDS:
        command(words[0]).main(f"softflagella {words[0]}", words[1:])
    elif words[0] in COMMANDED and (word := _short_form(words)):
        raise InputError(f"no command {' '.join(words[:2])!r}; it is softflagella {word}")
    elif words[0] in packages():
        further(words[0]).main(words[1:])
    else:
        raise InputError(f"no command {words[0]!r}; {_suggestion(words[0])}")


def run() -> None:
    """Run as the command `softflagella`."""
    sys.exit(run_command(main))


if __name__ == "__main__":
    run()
