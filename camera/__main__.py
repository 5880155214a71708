"""Command line of the camera: `view`, `lens`, `tracks`."""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from pathlib import Path

from common.changes import RobotSource
from common.commands import Program
from common.errors import InputError

program = Program("camera", "track robots in films")
main = program.main
_TURNS = {1: ", turning left as with the motor at +1", -1: ", turning right as with the motor at −1", 0: ""}


@program.command("view")
def _view(*, out: str) -> None:
    """Write a view.toml to edit: scale, lens, region of the tank, markers.

    Args:
        out: TOML.
    """
    from camera.view import EXAMPLE
    from common.files import whole_file

    with whole_file(out) as part:
        part.write_text(EXAMPLE)
    print(f"-> {out}")


@program.command("lens")
def _lens(pictures: Sequence[str], *, squares: str = "10x7") -> None:
    """Print the lens lines of a view.toml from pictures of a chessboard in several poses.

    Args:
        pictures: PNG or JPEG, three or more of one camera; ten, tilted and near the edges, are good.
        squares: COLUMNSxROWS, squares of the board.
    """
    from camera.lens import calibrate_lens

    fit = calibrate_lens(pictures, squares=squares)
    for note in fit.notes:
        print(note, file=sys.stderr)
    print(fit.lines(), end="")


@program.command("tracks")
def _tracks(
    film: str,
    *,
    robot: RobotSource,
    view: str,
    out: str,
    check: str | None = None,
    start: float = 0.0,
    end: float = math.inf,
) -> None:
    """Track the robots of a film: poses with errors, dots that come and go, frames lost and why.

    Args:
        film: mp4, avi, mkv or what else OpenCV reads.
        view: TOML, scale, lens and markers; softflagella camera view writes one to edit.
        out: CSV; of several robots, one for each, with its name.
        check: PNG, draw tracks and fitted circles over a frame.
        start: SECONDS, in the film, of time 0.
        end: SECONDS, in the film (default: its end).
    """
    from camera.tracks import track_film, turn_sense, write_check
    from camera.view import read_setup
    from common.files import whole_file, write_csv
    from sim.inputs import load_robot

    setup, known = read_setup(view), load_robot(robot)
    for path in (out, check or "check.png"):  # before a film is tracked, which takes a while
        if Path(path).is_dir():
            raise InputError(f"{path} is a folder; give the name of a file")

    def tell(done: int, count: int) -> None:
        if sys.stderr.isatty():
            print(f"\r{100 * done // count} %", end="", file=sys.stderr)

    tracked = track_film(
        film,
        setup,
        head_length=known.head_length,
        motor_speed=abs(known.motor_speed),
        start=start,
        end=end,
        progress=tell,
    )
    for note in tracked.notes:
        print(note, file=sys.stderr)
    written = []
    for name, table in tracked.tables.items():
        file = Path(out)
        if len(tracked.tables) > 1:
            file = file.with_stem(f"{file.stem}-{name}")
        write_csv(table, file, digits=7)
        written.append(f"{len(table)} poses{_TURNS[turn_sense(table)]} -> {file}")
    if check:
        with whole_file(check) as part:
            write_check(part, tracked)
        written.append(f"picture -> {check}")
    print(", ".join(written))


if __name__ == "__main__":
    program.exit()
