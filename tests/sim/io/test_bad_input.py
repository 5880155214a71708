"""What cannot be simulated is refused in one line with exit status 2, and nothing is written."""

from __future__ import annotations

from pathlib import Path

import pytest

from sim.__main__ import main
from sim.io.errors import run_command
from tests.sim.robots import CONTROL_VALUES


def table(**changes: object) -> str:
    values = {**CONTROL_VALUES, **changes}
    return ",".join(values) + "\n" + ",".join(str(v) for v in values.values()) + "\n"


BAD_TABLES = {
    "negative length": (table(l_over_R=-3), "l_over_R = -3"),
    "disc without radius": (table(a_over_R=0), "a_over_R = 0 in row 1; it must be above 0"),
    "no tails": (table(N=0), "N = 0"),
    "half a tail": (table(N=2.5), "N = 2.5"),
    "nan": (table(C_t="nan"), "C_t = nan"),
    "text": (table(C_t="three"), "C_t"),
    "integer beyond floats": (table(C_t="1" * 400), "C_t = inf in row 1"),
    "stout tail": (table(l_over_r0=1.2), "l/r0 = 1.2"),
    "motor at rest": (table(omega_bar=0), "omega_bar = 0"),
    "unknown column": (table(colour=3), "unknown column 'colour'"),
    "effect out of bounds": (table(end_over_end_drag=-1), "end_over_end_drag = -1"),
    "missing column": ("C_t,C_r\n1,2\n", "missing column"),
    "no rows": (",".join(CONTROL_VALUES) + "\n", "no rows"),
    "empty": ("", "is empty"),
}


@pytest.mark.parametrize("case", list(BAD_TABLES))
def test_steady_refuses(case: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text, expected = BAD_TABLES[case]
    points, out = tmp_path / "points.csv", tmp_path / "out.csv"
    points.write_text(text)
    assert run_command(main, ["steady", str(points), "--out", str(out)]) == 2
    error = capsys.readouterr().err
    assert expected in error
    assert "points.csv" in error
    assert error.startswith("error: ")
    assert len(error.splitlines()) == 1
    assert [p.name for p in tmp_path.iterdir()] == ["points.csv"]
