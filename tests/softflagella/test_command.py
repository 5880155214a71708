"""The command `softflagella`: words, packages, version."""

from __future__ import annotations

from pathlib import Path

import pytest

import softflagella as sf
from sim.io.errors import run_command
from softflagella.__main__ import WORDS, command, main, program_of
from softflagella.shadowing import PACKAGES


def test_one_command_has_those_of_all_packages(capsys: pytest.CaptureFixture[str]) -> None:
    for package in PACKAGES:
        with pytest.raises(SystemExit) as ended:
            main([package, "--help"])
        assert ended.value.code == 0
        said = capsys.readouterr().out
        assert f"usage: softflagella {package}" in said
        assert all(name in said for name in program_of(package).commands)


def test_words_are_commands_of_packages_and_stand_first(capsys: pytest.CaptureFixture[str]) -> None:
    assert {"steady", "plan", "sweep", "train", "calibrate", "replay", "query"} <= set(WORDS)
    main([])
    lines = capsys.readouterr().out.splitlines()
    places = [next(i for i, line in enumerate(lines) if line.startswith(f"  {word} ")) for word in WORDS]
    assert places == sorted(places)
    assert max(places) < lines.index("further commands, by package (softflagella PACKAGE COMMAND …):")
    for word, (package, name) in WORDS.items():
        packaged = program_of(package).commands[name]
        assert command(word) is packaged
        with pytest.raises(SystemExit) as ended:
            main([word, "--help"])
        assert ended.value.code == 0
        assert f"usage: softflagella {word} " in capsys.readouterr().out


def test_a_word_runs_its_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run_command(main, ["plan", "no-such-path.csv", "--robot", "paper-control", "--out", str(tmp_path)]) == 2
    assert "no-such-path.csv" in capsys.readouterr().err
    assert run_command(main, ["sweep", "--config", "none.toml", "--out", str(tmp_path / "out")]) == 2
    assert "none.toml" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (["export"], "no command 'export'; it is softflagella surrogate export"),
        (["report"], "no command 'report'; it is softflagella dataset report"),
        (["calibrat"], "no command 'calibrat'; is it calibrate?"),
        (["qqq"], "no command 'qqq'; there are robot, steady"),
        (["plan", "square:3l"], "required: --robot/--vehicle, --out; softflagella plan --help"),
        (["plan", "square:3l", "--robot", "r", "--out", "o", "--objective", "speed"], "invalid choice: 'speed'"),
        (["planner", "goal", "--goal", "3", "0"], "expected 3 arguments; softflagella planner goal --help"),
        (["planner", "fly"], "invalid choice: 'fly'"),
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
    assert [line.split()[0] for line in lines] == list(sf.effects())
    assert all(len(line.split()) > 3 and line.endswith(".") for line in lines)
