"""Pages and what a notebook shows: text is escaped, figures follow the colours, narrow screens get lists."""

from __future__ import annotations

import base64
import re
from pathlib import Path

import numpy as np
from matplotlib import pyplot
from matplotlib.figure import Figure

from common.notebook import as_html
from common.pages import BLUE, INK, PALETTE, Page, figure_markup
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
    page.steps(["one `two`"], numbered=True)
    page.commands(["a < b", "c"])
    page.links([("plans/a b&c.h", "schedule.h", "the `schedule`")])
    html, seen = written(page, tmp_path)
    assert "<code>--own &lt;x&gt;</code> and &lt;script&gt;" in html
    assert "<li>one <code>two</code></li>" in html
    assert "a < b\nc" in "".join(seen.words)
    assert "A <b>" in seen.text
    assert seen.links == ["plans/a%20b%26c.h"]  # whatever the name of the file
    assert "schedule.h" in seen.text
    assert "<code>schedule</code>" in html


def test_figures_follow_the_colours_of_the_page(tmp_path: Path) -> None:
    """Each colour of the palette is a variable that both schemes define; nothing is painted white."""
    page = Page("t", "l")
    page.figure(line(), "a curve & more")
    html, seen = written(page, tmp_path)
    style, drawn = html.split("</style>")
    assert "prefers-color-scheme: dark" in style
    for name, light, dark in PALETTE.values():
        assert f"--{name}: {light};" in style.split("prefers-color-scheme")[0]
        assert f"--{name}: {dark};" in style.split("prefers-color-scheme")[1]
    assert "var(--blue)" in drawn
    assert "var(--ink)" in drawn
    assert not any(colour in drawn for colour in ("#ffffff", "#000000", BLUE, INK))
    assert 'aria-label="a curve &amp; more"' in drawn
    assert "yaw rate" in seen.text  # it can be found and read aloud


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


def test_a_figure_gives_the_same_markup_again_and_one_of_many_points_is_a_picture() -> None:
    """As SVG it would be megabytes."""
    assert figure_markup(line(), "d", number=1) == figure_markup(line(), "d", number=1)
    markup = figure_markup(line(20_000), "many & more", number=1)
    assert markup.startswith('<img alt="many &amp; more" src="data:image/png;base64,')
    assert len(markup) < 400_000


def test_a_wide_table_becomes_a_list_on_a_narrow_screen(tmp_path: Path) -> None:
    page = Page("t", "l")
    page.table(("N", "l [cm]"), [(2, 9.0)])
    page.table(("effect", "judgement"), [("drag on the disc", "does not predict left-out sessions better")])
    html, _ = written(page, tmp_path)
    assert html.count('<table class="cards">') == 1
    assert '<td data-column="judgement">does not' in html
    assert "<table><tr><th>N</th>" in html


def test_a_long_page_begins_with_its_sections(tmp_path: Path) -> None:
    page = Page("t", "l")
    for n in range(6):
        page.section(f"Part {n}")
    html, seen = written(page, tmp_path)
    assert seen.links == [f"#section-{n}" for n in range(1, 7)]
    assert all(f'id="{link[1:]}"' in html for link in seen.links)
    assert seen.headings == [f"Part {n}" for n in range(6)]


def test_a_notebook_shows_escaped_text_and_the_picture_below_it() -> None:
    page = as_html('<script>\n  "a" & b')
    assert "&lt;script&gt;\n  &quot;a&quot; &amp; b</pre>" in page
    assert "<img" not in page
    page = as_html('Plan of "x"\nmore', lambda axes: axes.plot([0, 1]))
    match = re.search(r'<img alt="([^"]*)" src="data:image/png;base64,([^"]+)">$', page)
    assert match
    assert match[1] == "Plan of &quot;x&quot;"
    assert base64.b64decode(match[2]).startswith(b"\x89PNG")
    assert pyplot.get_fignums() == []
