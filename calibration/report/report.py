"""The report of a calibration: the template report.j2 over the content of verdict.json, with its figures."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from markupsafe import Markup
from matplotlib.figure import Figure

from calibration.attribution.refits import IMITABLE, SURE
from calibration.laws.group_factors import group_factors
from calibration.laws.law_model import LEVER
from calibration.laws.laws import FittedLaw
from calibration.report.figures import (
    draw_corner,
    draw_evidence,
    draw_factors,
    draw_maps,
    draw_paths,
    draw_place,
    draw_residuals,
    draw_sizes,
    draw_summary,
)
from calibration.report.path_error import PathError
from calibration.statistics.fit import WRONG
from calibration.verdict.next_runs import STOP
from calibration.verdict.verdict import Verdict
from calibration.words.render import rendered
from common.arrays import Flags
from common.pages import Page, figures_markup, inline
from common.provenance import code_version

_LAW = (
    "On what it depends. Line and band: the law. Points: the factor that the runs at this input ask for, "
    "everything else fitted anew, with one standard error."
)

Drawn = tuple[Figure, str, str]  # with a description and a caption


def write_report(
    result: Verdict, record: Mapping[str, Any], out: str | Path, *, paths: Sequence[PathError] = ()
) -> None:
    """Write report.html from a verdict and its record, with the figures of the errors on `paths`."""
    page = Page(f"Calibration: {record['table']}", record["sentence"])
    page.add(sections(record, _figures(result, paths)))
    page.write(out, f"code {code_version()}; fixed before the data was looked at: {record['fixed_before']}")


def sections(record: Mapping[str, Any], figures: Mapping[str, Sequence[Drawn]]) -> str:
    """Write the sections of a report; a stored verdict.json has no figures."""
    markup: dict[str, str] = {}
    for name, drawn in figures.items():
        first = 1 + sum(len(figures[before]) for before in markup)
        markup[name] = Markup(figures_markup(drawn, first))
    constants = {"stop": STOP, "beyond": f"{WRONG:g}", "imitable_above": IMITABLE, "sure": SURE}
    functions: dict[str, Any] = {"inline": lambda words: Markup(inline(words)), "counted": _counted}
    return rendered("report.j2", {**record, **constants, **functions, "figures": markup})


def _counted(runs: Iterable[Mapping[str, Any]]) -> list[tuple[tuple[Any, ...], int]]:
    """List the distinct settings of runs, each with how often it is there."""
    return list(Counter(tuple(run.values()) for run in runs).items())


def _figures(result: Verdict, paths: Sequence[PathError]) -> dict[str, list[Drawn]]:
    """Draw the figures of a report, by their names in the template."""
    kind, drawn = result.runs.drawn[1][0], [error for error in paths if error.carried_out]
    figures: dict[str, list[Drawn]] = {
        "summary": [(draw_summary(result), "residual of each output over the noise, for each model",
                     "The same on the runs that were fitted, for each output.")],
        "residuals": [(figure, f"residuals by output and {kind}, {model}", model)
                      for figure, model in draw_residuals(result)],
        "maps": [(figure, f"map of the residual over the runs' inputs, {model}", model)
                 for figure, model in draw_maps(result)],
    }  # fmt: skip
    if result.found.candidates:
        figures["evidence"] = [(draw_evidence(result), "score of each effect against what a claim needs", "")]
    if corner := draw_corner(result):
        figures["corner"] = [(corner, "samples of the fitted numbers and effects in pairs, by form", "")]
    if drawn:
        words = "the wanted path, and the tracks of both schedules on the corrected robot"
        figures["paths"] = [(draw_paths(drawn), words, "")]
    if result.nearest and result.nearest.sizes:
        words = f"size of {result.nearest.effect.title} for each specimen"
        figures["sizes"] = [(draw_sizes(result.nearest), words, "")]
    if result.law and result.law.kept:
        figures["law"] = _figures_of_law(result.law.kept[0], result.split.fitted)
    return figures


def _figures_of_law(law: FittedLaw, used: Flags) -> list[Drawn]:
    """Draw where a law acts, and on what it depends in the runs `used` (n,)."""
    place = draw_place(law.model.robot, law.place, law.fit.parameters.get(LEVER, 0.0))
    drawn = [(place, f"where it acts: {law.place.words}", "Where it acts (red).")]
    if inputs := group_factors(law.model, law.fit, used):
        drawn.append((draw_factors(inputs), "the factor of the load against each input", _LAW))
    return drawn
