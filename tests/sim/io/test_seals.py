"""A text with a digest: cut short it is refused, edited it is read with a warning, without a digest it is read."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from sim.inputs import load_robot
from sim.io.errors import InputError
from sim.io.seals import check_seal, sealed
from sim.model.presets import PRESETS
from sim.model.robot_toml import robot_toml

TEXT = robot_toml(PRESETS["paper-control"])
SEALED = sealed(TEXT)


def test_a_text_that_was_cut_is_refused_wherever_it_was_cut() -> None:
    """A corrected.toml without its end used to be read, and the stated error fell."""
    for end in range(len(SEALED) - len(TEXT), len(SEALED) - 1):
        with pytest.raises(InputError, match="cut short"):
            check_seal(SEALED[:end], "corrected.toml")


@pytest.mark.parametrize(
    ("edit", "warnings"),
    [
        (lambda text: text, 0),
        (lambda text: text.replace("\n", " \r\n") + "\r\n", 0),
        (lambda _: TEXT, 0),
        (lambda text: text.replace("C_t = 3.", "C_t = 4."), 1),
        (lambda text: text + "[effects]\ndisc_drag = 1.0\n", 1),
        (lambda text: text.partition("\n")[2], 1),
    ],
)
def test_an_edited_text_is_read_and_says_so_once(
    edit: Callable[[str], str], warnings: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "robot.toml").write_text(edit(SEALED))
    for _ in range(2):
        load_robot(tmp_path / "robot.toml")
    assert capsys.readouterr().err.count("was edited or damaged") == warnings
