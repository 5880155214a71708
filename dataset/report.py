"""Report a sweep on one page: what was swept, what depends on what, where model or solver reach their limits."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import chain
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
from scipy.stats import qmc

from common.arrays import Floats
from common.pages import Page
from dataset.data_set import read, read_manifest
from dataset.figures import RESPONSES, draw_collapse, draw_indices, draw_responses, draw_trends, draw_where
from dataset.schema import COST, INPUTS, Column, schema, shown_outputs
from dataset.statistics import exponents, linear_rows, rows_for_exponents, sobol_indices

_FEW = 40  # usable rows below which nothing is fitted
_SIZE = r" by [-+.0-9e]+ a revolution"  # of a reason: left out when reasons are counted
_SMALL = 0.1  # exponents below it are not listed


def write_report(folder: str, out: str | Path) -> None:
    """Write the page of a finished data set."""
    manifest = read_manifest(folder)
    rows = read(folder, _columns(manifest["effects"]))
    page = Page("Sweep report", _lead(rows))
    add_sections(page, rows)
    page.write(out, f"configuration {manifest['config_hash']}, code {manifest['code_version']}")


def _columns(effects: list[str]) -> list[str]:
    """List the columns that the page needs: every column of single numbers, and a few of the long lists."""
    single = [field.name for field in schema(effects) if not pa.types.is_fixed_size_list(field.type)]
    return [*single, *RESPONSES]


def _lead(rows: pd.DataFrame) -> str:
    usable = usable_rows(rows)
    return (
        f"{len(rows)} robots, each simulated to its steady motion and through flips of its motor. {len(usable)} "
        "of them converged with tails that do not touch."
    )


def usable_rows(rows: pd.DataFrame) -> pd.DataFrame:
    """Select rows that converged and whose tails do not touch."""
    return rows[rows["converged"] & ~rows["failed"] & ~rows["touching"]]


def add_sections(page: Page, rows: pd.DataFrame) -> None:
    """Add all sections of the report."""
    usable = usable_rows(rows)
    inputs = {c.name: rows[c.name].to_numpy(float) for c in INPUTS if np.ptp(rows[c.name].to_numpy(float)) > 0}
    _add_inputs(page, rows, inputs)
    if len(usable) < _FEW:
        page.section("Too few usable rows")
        page.text(f"{len(usable)} rows are usable; the analysis needs {_FEW} or more.", tone="bad")
    else:
        _add_dependence(page, usable, list(inputs))
        _add_linear_theory(page, usable, list(inputs))
        page.section("Response to a flip of the motor")
        page.text(
            "After a flip the robot lags behind its new circle until the tails have turned over. Lags are divided "
            "by the speed in their direction, so they are times. Lines: medians; bands: the middle half of rows."
        )
        page.figure(draw_responses(usable), "lags and net speed over the dwell, for slow, medium and fast motors")
    _add_limits(page, rows)


def _add_inputs(page: Page, rows: pd.DataFrame, inputs: dict[str, Floats]) -> None:
    page.section("What was swept")
    ranks = np.stack([_ranks(values) for values in inputs.values()], 1)[:2048]
    random = np.random.default_rng(0).random(ranks.shape)
    page.text(
        f"{len(inputs)} inputs varied. Discrepancy of the design (0: perfectly even) "
        f"{qmc.discrepancy(ranks):.2g}, of as many random points {qmc.discrepancy(random):.2g}."
    )
    ranges = [
        (c.name, f"{rows[c.name].min():.4g}", f"{rows[c.name].median():.4g}", f"{rows[c.name].max():.4g}", c.unit)
        for c in INPUTS
    ]
    page.table(("input", "smallest", "median", "largest", "unit"), ranges)


def _ranks(values: Floats) -> Floats:
    """Return the ranks of values, evenly between 0 and 1; ties are spread."""
    order = np.argsort(values + 1e-12 * np.arange(len(values)), kind="stable")
    ranks = np.empty(len(values))
    ranks[order] = (np.arange(len(values)) + 0.5) / len(values)
    return ranks


def _add_dependence(page: Page, usable: pd.DataFrame, names: list[str]) -> None:
    page.section("What depends on what")
    inputs = {name: usable[name].to_numpy(float) for name in names}
    outputs = shown_outputs()
    indices = {}
    for output in outputs:
        values = np.abs(usable[output.name].to_numpy(float))
        indices[output.name] = sobol_indices(inputs, np.log(values) if output.logarithmic else values)
    page.text(
        "Sobol indices: the share of an output's variance over the sweep that an input explains alone (first "
        "order) and together with all others (total). Logarithms are taken of "
        f"{', '.join(output.words for output in outputs if output.logarithmic)}."
    )
    page.figure(draw_indices(indices), "Sobol indices of the outputs in all inputs, with 95 % intervals")
    worst = min(outputs, key=lambda output: indices[output.name].explained)
    page.text(
        f"The polynomials behind the indices explain {100 * indices[worst.name].explained:.1f} % of the variance "
        f"or more (least: {worst.words})."
    )
    for output in outputs:
        page.figure(
            draw_trends(usable, output.name, [name for name in names if name != "N"]),
            f"{output.words} against each input, by number of tails",
        )
    page.text(
        "Lines: medians by number of tails. Bands: the middle half of the rows, of all tails if N has many "
        "values. Points: the rows of a number of tails that has too few for a line."
    )


def _add_linear_theory(page: Page, usable: pd.DataFrame, names: list[str]) -> None:
    base = [c.name for c in INPUTS]
    rows, linear = linear_rows({name: usable[name].to_numpy(float) for name in base})
    sample = usable.iloc[rows]
    inputs = {name: sample[name].to_numpy(float) for name in names}
    page.section("Scaling laws")
    if len(sample) < rows_for_exponents(len(inputs)):
        page.text(
            f"{len(sample)} usable rows are too few for exponents of {len(inputs)} inputs: they need "
            f"{rows_for_exponents(len(inputs))} or more.",
            tone="bad",
        )
    else:
        lines = (_exponent_lines(output, sample, inputs, linear) for output in shown_outputs())
        _add_exponents(page, list(chain.from_iterable(lines)))
    page.section("Against linear theory")
    page.text(
        "Each point is a robot. S is the drag number of a tail: viscous against elastic forces. For small S the "
        "tails stay nearly straight and the ratio tends to what linear theory leaves out."
    )
    outputs = [output.name for output in shown_outputs() if output.name in linear]
    page.figure(draw_collapse(sample, linear, outputs), "outputs over linear theory against the drag number")


def _add_exponents(page: Page, table: list[tuple[str, ...]]) -> None:
    page.text(
        "Exponents: by how many per cent an output grows when an input grows by one per cent and all others are "
        "held, in the lower, middle and upper third of the input. Where the three agree to 0.1, a power law holds "
        "over the sweep. The last three columns are those of linear theory, for the same robots. Inputs that "
        f"change an output by less than the power {_SMALL:g} are left out."
    )
    thirds = ("lower", "middle", "upper")
    page.table(("output", "input", *thirds, "", *(f"linear: {third}" for third in thirds)), table)


def _exponent_lines(
    output: Column, sample: pd.DataFrame, inputs: dict[str, Floats], linear: Mapping[str, Floats]
) -> Iterator[tuple[str, ...]]:
    """Yield a line for each input that matters; outputs that linear theory does not have get no numbers of it."""
    simulated = exponents(inputs, output.name, np.abs(sample[output.name].to_numpy(float)))
    known = output.name in linear
    theory = exponents(inputs, output.name, linear[output.name]) if known else [None] * len(simulated)
    for law, linear_law in zip(simulated, theory, strict=True):
        if np.abs(law.value).max(initial=0.0, where=np.isfinite(law.value)) > _SMALL:
            thirds = map(_number, law.value, law.half_width)
            linear_thirds = map(_number, linear_law.value) if linear_law else ("–",) * 3
            yield output.words, law.input, *thirds, "power law" if law.holds else "changes", *linear_thirds


def _number(value: float, half_width: float | None = None) -> str:
    if not np.isfinite(value):
        return "–"
    return f"{value:.2f}" if half_width is None else f"{value:.2f} ± {half_width:.2f}"


def _add_limits(page: Page, rows: pd.DataFrame) -> None:
    page.section("Where tails touch, and where the solver had difficulties")
    stepped = rows["reason"].astype(str) != ""
    page.figure(
        draw_where(rows.assign(hard=rows["failed"] | stepped)), "share of rows that touch, and that failed, over ω̄"
    )
    page.text(
        f"In {int(rows['touching'].sum())} of {len(rows)} rows tails touch: their numbers come from a model "
        f"without contact. {int(rows['failed'].sum())} rows failed."
    )
    reasons = rows.loc[stepped, "reason"].astype(str).str.replace(_SIZE, "", regex=True).value_counts()
    if len(reasons):
        page.table(("reason", "rows"), [(str(reason), int(count)) for reason, count in reasons.items()])
    page.section("Cost")
    cost = rows[COST].to_numpy(float) * 1e3
    page.text(f"{cost.sum() / 6e4:.1f} minutes of processor time, {cost.mean():.1f} ms a row on average.")
    page.table(
        ("N", "rows", "mean [ms]"),
        [(str(n), len(part), f"{1e3 * part[COST].mean():.1f}") for n, part in rows.groupby("N")],
    )
