"""The public face: names with examples that run, words of the command `softflagella`, and what they load."""

from __future__ import annotations

import doctest
import subprocess
import sys
from importlib import import_module
from inspect import isfunction
from pathlib import Path

import pytest

import softflagella as sf
from common.errors import run_command
from common.keywords import keywords_of
from softflagella.__main__ import WORDS, command, further, main, packages, program_of
from softflagella.shadowing import COMMANDED
from tests.processes import LIMIT, ROOT

LONG = {"Orbit", "Swim", "TrackingError", "Trip", "hold", "load_goal", "tabulate"}
NAMES = [name for name in sf.__all__ if not name.startswith("_")]


def test_every_name_is_what_its_module_has_and_is_listed_once() -> None:
    for name in sf.__all__:
        module, attribute = sf._HOMES[name]
        assert getattr(sf, name) is getattr(import_module(module), attribute)
    assert dir(sf) == sf.__all__
    assert len(sf.__all__) == len(set(sf.__all__)) > 30
    assert {"plan", "effects", "__version__", "Robot"} <= set(sf.__all__)
    with pytest.raises(AttributeError, match="no attribute 'swims'"):
        sf.swims  # noqa: B018


@pytest.mark.slow
def test_a_wrong_keyword_is_refused_with_a_proposal() -> None:
    functions = [thing for name in NAMES if isfunction(thing := getattr(sf, name))]
    assert len(functions) > 30
    for function in functions:
        *_, known = keywords_of(function)
        with pytest.raises(sf.InputError, match=rf"{function.__name__} .*'{known}x'; is it {known}\?"):
            function(**{f"{known}x": 1})
    with pytest.raises(sf.InputError, match="plan has no keyword 'colour'; there are path, robot, "):
        sf.plan(sf.circle(2.0), "paper-control", colour="red")  # type: ignore[call-arg]


@pytest.mark.parametrize("name", [pytest.param(n, marks=pytest.mark.rest) if n in LONG else n for n in NAMES])
def test_every_name_has_an_example_that_runs(name: str) -> None:
    thing = getattr(sf, name)
    examples = doctest.DocTestFinder(recurse=False).find(thing, name)
    assert examples[0].examples, f"{name} has no example"
    results = [doctest.DocTestRunner(optionflags=doctest.NORMALIZE_WHITESPACE).run(test) for test in examples]
    assert sum(result.failed for result in results) == 0


def test_one_command_has_those_of_all_packages(capsys: pytest.CaptureFixture[str]) -> None:
    for package in packages():
        with pytest.raises(SystemExit) as ended:
            main([package, "--help"])
        assert ended.value.code == 0
        said = capsys.readouterr().out
        assert f"usage: softflagella {package}" in said
        assert all(name in said for name in further(package).commands)
    commands = [name for package in COMMANDED for name in program_of(package).commands]
    named = [*WORDS, *(name for package in packages() for name in further(package).commands)]
    # each has one name; calibrate, compare, model and demo are of no package
    assert len(named) == len(commands) + 4


def test_words_are_commands_of_packages(capsys: pytest.CaptureFixture[str]) -> None:
    main([])
    listed = capsys.readouterr().out
    for word, (package, name) in WORDS.items():
        packaged = program_of(package).commands[name]
        assert command(word) is packaged
        assert f"\n  {word} " in listed
        with pytest.raises(SystemExit) as ended:
            main([word, "--help"])
        assert ended.value.code == 0
        assert f"usage: softflagella {word} " in capsys.readouterr().out


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (["report"], "no command 'report'; it is softflagella dataset report"),
        (["calibrat"], "no command 'calibrat'; is it calibrate?"),
        (["qqq"], "no command 'qqq'; there are robot, steady"),
        (["tracking"], "no command 'tracking'; its commands are softflagella track, softflagella replay"),
        (["plan", "square:3l"], "required: --robot, --out; softflagella plan --help"),
        (["plan", "square:3l", "--robt", "x"], "no option --robt; is it --robot?"),
        (["planner", "goal"], "no command 'planner goal'; it is softflagella goal"),
        (["planner", "replay", "--out", "x"], "no command 'planner replay'; it is softflagella replay"),
        (["calibration", "calibrate"], "no command 'calibration calibrate'; it is softflagella calibrate"),
        (["dataset", "build"], "no command 'dataset build'; it is softflagella sweep"),
        (["dataset", "fly"], "invalid choice: 'fly'"),
        (["sim"], "required: COMMAND; softflagella sim --help"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_wrong_words_end_in_one_line(words: list[str], expected: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        raise SystemExit(run_command(main, words))
    assert ended.value.code == 2
    captured = capsys.readouterr()
    (line,) = captured.err.splitlines()
    assert line.startswith("error: ")
    assert expected in line
    assert captured.out == ""


def test_effects_are_listed_with_a_sentence_each_and_the_version(capsys: pytest.CaptureFixture[str]) -> None:
    main(["--version"])
    assert capsys.readouterr().out == f"softflagella {sf.__version__}\n"
    main(["effects"])
    lines = capsys.readouterr().out.splitlines()
    effects = [line for line in lines[1:] if not line.startswith(" ")]
    assert [line.split()[0] for line in effects] == list(sf.effects())
    assert all(len(line.split()) > 5 and line.endswith(".") for line in effects)


SLOW = ("torch", "scipy.stats", "scipy.integrate", "matplotlib", "joblib")
CODE = f"""
import sys
def check(*slow):
    assert not set(slow) & set(sys.modules), set(slow) & set(sys.modules)
import softflagella as sf
check("numpy", "torch", "numba", "pandas", "matplotlib", "scipy", "pyarrow", "sim")
from common.errors import run_command
from softflagella.__main__ import main
folder = sys.argv[1]
main(["query", "paper-control"])
main(["steady", "paper-control"])
plan = sf.plan("circle:1l", "paper-control", objective="flips")
import json
with open(folder + "/plan.json", "w") as file:
    json.dump(plan.to_dict(), file)
check(*{SLOW!r}, "pandas", "pyarrow")
main(["replay", folder + "/plan.json", "--out", folder + "/track.csv"])
check(*{SLOW!r})
assert run_command(main, ["train", folder, "--out", folder + "/m"]) == 2
import numpy as np
robot = sf.load_robot("paper-control")
columns = {{name: np.array([value]) for name, value in robot.group_values().items()}}
table = sf.load_table()
table.query(columns | {{"dwell_bar": np.array([1.0])}}, intervals=True)
table.response(columns)
table.derivatives(columns, ["C_t", "disc_drag"])
sf.Tracker(sf.restore_plan(folder + "/plan.json")).update(0.0)
check(*{SLOW!r})
main(["plan", "circle:1l", "--robot", "paper-control", "--objective", "flips", "--out", folder + "/plan"])
check("torch", "scipy.stats", "scipy.integrate", "joblib")
"""


def test_commands_and_answers_from_python_load_what_they_need(tmp_path: Path) -> None:
    """A replay writes a table; training looks at its files before it loads torch."""
    done = subprocess.run(
        [sys.executable, "-c", CODE, str(tmp_path)],
        capture_output=True, text=True, timeout=LIMIT, cwd=ROOT,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "track.csv").exists()
