"""The report of a calibration: the template report.j2 over the content of verdict.json, with its figures."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from markupsafe import Markup

from calibration.attribution.rules import IMITABLE, SURE
from calibration.findings.findings import Findings
from calibration.findings.next_runs import STOP
from calibration.report.figures import Drawn, draw_all
from calibration.statistics.fit import WRONG
from calibration.words.render import badges, headline, next_in_short, rendered
from common.pages import Page, figures_markup, inline
from common.provenance import code_version


def write_report(result: Findings, record: Mapping[str, Any], out: str | Path) -> None:
    """Write report.html from a verdict and its record."""
    page = Page(headline(record), f"{record['table']}: {record['number_of_runs']} {record['row']}s", folded=True)
    page.add(sections(record, draw_all(result)))
    page.write(out, f"code {code_version()}")


def sections(record: Mapping[str, Any], figures: Mapping[str, Sequence[Drawn]]) -> str:
    """Write the sections of a report; a stored verdict.json has no figures."""
    markup: dict[str, str] = {}
    for name, drawn in figures.items():
        first = 1 + sum(len(figures[before]) for before in markup)
        markup[name] = Markup(figures_markup(drawn, first))
    constants = {"stop": STOP, "beyond": f"{WRONG:g}", "imitable_above": IMITABLE, "sure": SURE}
    texts = {"badges": badges(record), "next_in_short": next_in_short(record)}
    functions: dict[str, Any] = {"inline": lambda words: Markup(inline(words)), "counted": _counted}
    return rendered("report.j2", {**record, **constants, **texts, **functions, "figures": markup})


def _counted(runs: Iterable[Mapping[str, Any]]) -> list[tuple[tuple[Any, ...], int]]:
    """List the distinct settings of runs, each with how often it is there."""
    return list(Counter(tuple(run.values()) for run in runs).items())
