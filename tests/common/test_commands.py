"""A function's signature and docstring are its command's parser."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

import pytest

from common.commands import Call, Program
from common.errors import InputError, InputWarning
from softflagella.__main__ import main as softflagella
from softflagella.__main__ import program as top
from softflagella.__main__ import program_of
from softflagella.shadowing import COMMANDED

Capsys = pytest.CaptureFixture[str]
Shape = Literal["round", "square"]
Colour = Shape | None


def paint(
    where: Sequence[str],
    tin: str | Mapping[str, float],
    *,
    coats: int = 2,
    shape: Colour = "round",
    dry: bool = True,
    spots: Sequence[tuple[str, str]] = (),
    told: Callable[[str], object] | None = None,
    sizes: Mapping[str, float] | None = None,
) -> None:
    """Paint a wall.

    Args:
        where: walls. In Python also bricks.
        tin: of `paint`.
        coats: how many, 100 % of the
            wall each.
        shape: of the brush.
        dry: wait until it is dry.
        spots: X Y, of a spot.

    Returns:
        Nothing.
    """


program = Program("house", "keep a house")
called: list[dict[str, Any]] = []


@program.command("paint", of="tests.common.test_commands:paint", tin="--tin", spots="spot")
def _paint(paint: Call, where: str, *, tin: str, wet: bool = False, length: float | None = None) -> None:
    """Paint walls. Or floors.

    Args:
        where: rooms.
        wet: on wet walls.
        length: LENGTH, of the brush.
    """
    called.append({"where": where, "tin": tin, "wet": wet, "length": length, **paint.given})


def test_the_function_is_called_with_what_was_written() -> None:
    program.main(["paint", "hall", "--tin", "red"])
    assert called.pop() == {"where": "hall", "tin": "red", "wet": False, "length": None}
    words = "paint hall --tin red --no-dry --wet --spot 1 2 --spot -3cm 4 --coats 3 --length -1e3 --shape square"
    program.main(words.split())
    assert called.pop() == {
        "where": "hall", "tin": "red", "wet": True, "length": -1000.0, "dry": False, "coats": 3,
        "spots": [["1", "2"], ["-3cm", "4"]], "shape": "square",
    }  # fmt: skip


def leave_out(rooms: int) -> None:
    """Sweep some rooms.

    Args:
        rooms: how many. In Python also all.
    """
    warnings.warn(f"{rooms} rooms left out", InputWarning, stacklevel=2)
    warnings.warn("a slow library", RuntimeWarning, stacklevel=2)


@program.command("sweep", of="tests.common.test_commands:leave_out")
def _sweep(leave_out: Call) -> None:
    for rooms in (2, 3, 2):
        leave_out(rooms=rooms)


def test_a_command_says_what_is_left_out_and_has_the_sentence_of_its_function(capsys: Capsys) -> None:
    with pytest.warns(RuntimeWarning, match="a slow library"):  # as Python shows it
        program.main(["sweep", "2"])
    assert capsys.readouterr().err == "2 rooms left out\n3 rooms left out\n"
    assert program.commands["sweep"].help == "sweep some rooms"
    assert "how many\n" in program.commands["sweep"].parser("sweep").format_help()


def test_help_is_the_docstring() -> None:
    assert program.commands["paint"].help == "paint walls. Or floors"
    said = " ".join(program.commands["paint"].parser("house paint").format_help().split())
    for words in ("Paint walls. Or floors.", "WHERE rooms", "--tin TIN of paint", "--no-dry do not wait until",
                  "--coats COATS how many, 100 % of the wall each (default: 2)", "--length LENGTH of the brush",
                  "--shape {round,square} of the brush (default: round)", "--spot X Y of a spot; may be given",
                  ):  # fmt: skip
        assert words in said
    assert "told" not in said
    assert "sizes" not in said


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        ("paint --tin red", "arguments are required: WHERE; softflagella house paint --help lists"),
        ("paint hall", "arguments are required: --tin"),
        ("paint hall --tin red --coats two", "argument --coats: invalid int value: 'two'"),
        ("paint hall --tin red --shape long", "invalid choice: 'long' (choose from 'round', 'square')"),
        ("paint hall --tin red --spot 1", "--spot: expected 2 arguments"),
        ("paint hall --tin red --told x", "no option --told"),
        ("mop", "invalid choice: 'mop'"),
        ("mop --dry", "invalid choice: 'mop'"),
    ],
)
def test_wrong_words_are_refused(words: str, expected: str) -> None:
    with pytest.raises(InputError) as refusal:
        program.main(words.split())
    assert expected in str(refusal.value)


PROGRAMS = {name: program_of(name) for name in COMMANDED} | {"softflagella": top}
COMMANDS = [(package, name) for package, each in PROGRAMS.items() for name in each.commands]


@pytest.mark.parametrize(("package", "name"), COMMANDS, ids=map(" ".join, COMMANDS))
def test_every_option_of_every_command_says_what_it_is(package: str, name: str) -> None:
    command = PROGRAMS[package].commands[name]
    assert command.help[0].islower() or not command.help[1].islower()
    for action in command.parser(name)._actions:
        assert action.help, action.dest


def test_an_output_that_is_an_input_or_another_output_is_refused(tmp_path: Path) -> None:
    """A link to it, too; nothing is written."""
    table, link = tmp_path / "table.csv", tmp_path / "link.csv"
    table.write_text("x,y\n")
    link.symlink_to(table)
    for words in (["plan", str(table), "--robot", "paper-control", "--out", str(link)],
                  ["tracks", "f.mp4", "--robot", "r", "--view", str(table), "--out", str(table)],
                  ["replay", "p.json", "--out", "new.csv", "--shapes", "./new.csv"]):  # fmt: skip
        with pytest.raises(InputError, match="is the same file as"):
            softflagella(words)
    assert table.read_text() == "x,y\n"


def test_an_input_in_the_folder_of_the_outputs_is_not_written_over(tmp_path: Path) -> None:
    path = tmp_path / "plan.csv"
    path.write_text("x_cm,y_cm\n0,0\n30,0\n")
    words = ["plan", str(path), "--robot", "paper-control", "--out"]
    with pytest.raises(InputError, match=r"plan.csv is an input and would be written over"):
        softflagella([*words, str(tmp_path)])
    assert [*tmp_path.iterdir()] == [path]
    robot = tmp_path / "corrected.toml"
    robot.write_text("")
    with pytest.raises(InputError, match=r"corrected.toml is an input"):
        softflagella(["calibrate", str(path), "--robot", str(robot), "--out", str(tmp_path)])
