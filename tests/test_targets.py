"""Each test is run by exactly one of `make test`, `make test-rest` and `make test-rates`."""

from __future__ import annotations

import re
from itertools import product
from pathlib import Path

MAKEFILE = Path(__file__).parents[1] / "Makefile"


def test_each_test_belongs_to_one_target() -> None:
    selections = re.findall(
        r'^test\S*:.*\n\t\$\(RUN\) \$\(PYTEST\) -m "?([^"\n]+)"?$', MAKEFILE.read_text(), re.MULTILINE
    )
    assert len(selections) == 3
    for rest, rates in product((False, True), repeat=2):
        marks = {"rest": rest, "rates": rates}
        assert sum(eval(selection, marks) for selection in selections) == 1
