"""Text and pictures for a notebook."""

from __future__ import annotations

import base64
import re

from matplotlib import pyplot
from matplotlib.figure import Figure

from sim.io.notebook import as_html, given_axes


def test_text_is_escaped_and_keeps_its_lines() -> None:
    page = as_html('<script>\n  "a" & b')
    assert "&lt;script&gt;\n  &quot;a&quot; &amp; b</pre>" in page
    assert "<img" not in page


def test_a_picture_is_drawn_below_the_text_and_described() -> None:
    page = as_html('Plan of "x"\nmore', lambda axes: axes.plot([0, 1]), width=2.0)
    match = re.search(r'<img alt="([^"]*)" src="data:image/png;base64,([^"]+)">$', page)
    assert match
    assert match[1] == "Plan of &quot;x&quot;"
    assert base64.b64decode(match[2]).startswith(b"\x89PNG")
    assert pyplot.get_fignums() == []


def test_axes_are_those_that_are_given_or_new_ones() -> None:
    axes = Figure().add_subplot()
    assert given_axes(axes) is axes
    new = given_axes(None)
    assert new.figure.number in pyplot.get_fignums()
    pyplot.close(new.figure)
