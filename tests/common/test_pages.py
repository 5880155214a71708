"""Pages and what a notebook shows: text is escaped, figures follow the colours and share no names."""

from __future__ import annotations

import base64
import re
from pathlib import Path

import numpy as np
from matplotlib import pyplot
from matplotlib.figure import Figure

from common.notebook import as_html
from common.pages import BLUE, INK, Page, figure_markup
from tests.page_text import PageText


def line(points: int = 3, colour: str = BLUE) -> Figure:
    figure = Figure(figsize=(3, 2))
    axes = figure.add_subplot()
    axes.plot(np.arange(points), np.random.default_rng(0).random(points), ".-", color=colour, label="a line")
    axes.text(0, 0, "ink", color=INK)
    axes.set_title("yaw rate")
    return figure


def written(page: Page, folder: Path) -> tuple[str, PageText]:
    page.write(folder / "page.html", "code 1")
    return (folder / "page.html").read_text(), PageText(folder / "page.html")


def test_text_is_escaped_and_words_between_backticks_are_code(tmp_path: Path) -> None:
    page = Page("A <b>", "lead & more")
    page.text("`--own <x>` and <script>")
    page.commands(["a < b", "c"])
    page.links([("plans/a b&c.h", "schedule.h", "the `schedule`")])
    html, seen = written(page, tmp_path)
    assert "<code>--own &lt;x&gt;</code> and &lt;script&gt;" in html
    assert "a < b\nc" in "".join(seen.words)
    assert "A <b>" in seen.text
    assert seen.links == ["plans/a%20b%26c.h"]  # whatever the name of the file


def test_figures_follow_the_colours_of_the_page(tmp_path: Path) -> None:
    """Nothing is painted in a colour of its own; the words of a figure can be found and read aloud."""
    page = Page("t", "l")
    page.figure(line(), "a curve & more")
    html, seen = written(page, tmp_path)
    drawn = html.split("</style>")[1]
    assert {"var(--blue)", "var(--ink)"} <= set(re.findall(r"var\(--\w+\)", drawn))
    assert not any(colour in drawn for colour in ("#ffffff", "#000000", BLUE, INK))
    assert 'aria-label="a curve &amp; more"' in drawn
    assert "yaw rate" in seen.text


def test_two_figures_share_no_names(tmp_path: Path) -> None:
    """A clip path of the first figure would cut the second one."""
    page = Page("t", "l")
    page.figures([(line(), "first", "one"), (line(), "second", "two")])
    html, _ = written(page, tmp_path)
    names = re.findall(r'\bid="([^"]+)"', html)
    assert len(names) == len(set(names)) > 2
    used = re.findall(r'(?:url\(|href=")#([^")]+)', html)
    assert used
    assert set(used) <= set(names)


def test_a_figure_of_many_points_is_a_picture() -> None:
    """As SVG it would be megabytes."""
    assert len(figure_markup(line(20_000), "many & more", number=1)) < 400_000


def test_a_notebook_shows_escaped_text_and_the_picture_below_it() -> None:
    others = pyplot.get_fignums()
    page = as_html('<script>\n  "a" & b')
    assert "&lt;script&gt;\n  &quot;a&quot; &amp; b</pre>" in page
    assert "<img" not in page
    page = as_html("a plan", rows=[("<b>error</b>", "2 mm & more")])
    assert "<tr><td>&lt;b&gt;error&lt;/b&gt;</td><td>2 mm &amp; more</td></tr></table>" in page
    page = as_html('Plan of "x"\nmore', lambda axes: axes.plot([0, 1]))
    match = re.search(r'<img alt="([^"]*)" src="data:image/png;base64,([^"]+)">$', page)
    assert match
    assert match[1] == "Plan of &quot;x&quot;"
    assert base64.b64decode(match[2]).startswith(b"\x89PNG")
    assert pyplot.get_fignums() == others
