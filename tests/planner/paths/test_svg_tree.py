"""What moves, scales or hides in a drawing is honoured, or refused by its name."""

from __future__ import annotations

from pathlib import Path

import pytest

from planner.paths.svg_drawing import METRES_PER_PIXEL, read_svg
from sim.io.errors import InputError
from tests.planner.page.page_core import check_near
from tests.planner.paths.svg_cases import ALIKE, REFUSED, svg


@pytest.mark.parametrize(("text", "reference"), ALIKE)
def test_drawings_that_show_the_same_are_read_alike(text: str, reference: str, tmp_path: Path) -> None:
    read = []
    for name, content in (("a.svg", text), ("b.svg", reference)):
        (tmp_path / name).write_text(content)
        read.append(read_svg(tmp_path / name, None, None))
    (path, unit), (wanted, wanted_unit) = read
    assert (unit, path.closed) == (wanted_unit, wanted.closed)
    check_near(path.points, wanted.points)


@pytest.mark.parametrize(("text", "words"), REFUSED)
def test_what_is_not_read_is_refused_by_name(text: str, words: str, tmp_path: Path) -> None:
    (tmp_path / "a.svg").write_text(text)
    with pytest.raises(InputError) as refusal:
        read_svg(tmp_path / "a.svg", None, None)
    assert words in str(refusal.value)


def test_a_drawing_of_known_width_has_its_size(tmp_path: Path) -> None:
    (tmp_path / "a.svg").write_text(svg('<path d="M 0 0 h 600 v 300"/>', 'width="1200mm" viewBox="0 0 1200 600"'))
    path, unit = read_svg(tmp_path / "a.svg", None, None)
    assert unit == METRES_PER_PIXEL
    check_near(path.points * METRES_PER_PIXEL, [[0, 0], [0.6, 0], [0.6, -0.3]])
