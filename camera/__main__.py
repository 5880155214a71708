"""Command line of the camera: `view`."""

from __future__ import annotations

from sim.io.commands import Program

program = Program("camera", "From films of a tank to tracks.")
main = program.main


@program.command("view")
def _view(*, out: str) -> None:
    """Write a view.toml to edit: scale, lens, region of the tank, markers.

    Args:
        out: TOML.
    """
    from camera.view import EXAMPLE
    from sim.io.files import whole_file

    with whole_file(out) as part:
        part.write_text(EXAMPLE)
    print(f"-> {out}")


if __name__ == "__main__":
    program.exit()
