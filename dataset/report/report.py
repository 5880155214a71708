"""A sweep as one page: what was swept, what depends on what, where model or solver meet their limits."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
from scipy.stats import qmc

from dataset.report.figures import (
    LABELS,
    SHOWN,
    draw_collapse,
    draw_indices,
    draw_responses,
    draw_trends,
    draw_where,
)
from dataset.report.power_laws import Exponents, exponents, linear_rows
from dataset.report.sobol_indices import sobol_indices
from dataset.rows.schema import COST, INPUTS, schema
from dataset.storage.data_set import read, read_manifest
from sim.arrays import Floats
from sim.io.pages import Page

OUTPUTS = ("omega_yr_bar", "v_z", "R_yr_over_l", "theta_deg")
_FEW = 40  # usable rows below which nothing is fitted
_SIZE = r" by [-+.0-9e]+ a revolution"  # in a reason: counted without
_SMALL = 0.1  # exponents below it are not listed


def write_report(folder: str, out: str | Path) -> None:
    """Write the page of a finished data set."""
    manifest = read_manifest(folder)
    rows = read(folder, _columns(manifest["effects"]))
    page = Page("Sweep report", _lead(rows))
    if manifest.get("chosen") is not None:
        page.text(
            "These robots were chosen where a look-up table was unsure. Shares, medians and indices below are of "
            "the chosen robots, not of the whole sweep."
        )
    add_sections(page, rows)
    page.write(out, f"configuration {manifest['config_hash']}, code {manifest['code_version']}")


def _columns(effects: list[str]) -> list[str]:
    """Columns that the page shows: every column of single numbers, and few of the long lists."""
    plain = [field.name for field in schema(effects) if not pa.types.is_fixed_size_list(field.type)]
    return [*plain, *SHOWN]


def _lead(rows: pd.DataFrame) -> str:
    usable = usable_rows(rows)
    return (
        f"{len(rows)} robots, each simulated to its steady motion and through flips of its motor. {len(usable)} "
        "of them converged with tails that do not touch."
    )


def usable_rows(rows: pd.DataFrame) -> pd.DataFrame:
    """Rows that converged and whose tails do not touch."""
    return rows[rows["converged"] & ~rows["failed"] & ~rows["touching"]]


def add_sections(page: Page, rows: pd.DataFrame) -> None:
    """All sections of the report."""
    usable = usable_rows(rows)
    inputs = {c.name: rows[c.name].to_numpy(float) for c in INPUTS if np.ptp(rows[c.name].to_numpy(float)) > 0}
    _add_inputs(page, rows, inputs)
    if len(usable) < _FEW:
        page.section("Too few usable rows")
        page.text(f"{len(usable)} rows are usable; what depends on what needs {_FEW} or more.", tone="bad")
    else:
        _add_dependence(page, usable, list(inputs))
        _add_linear_theory(page, usable, list(inputs))
        page.section("Response to a flip of the motor")
        page.text(
            "After a flip the robot lags its new circle until the tails have turned over. Lags are divided by the "
            "speed that they cost, so they are times. Lines: medians; bands: the middle half of the rows."
        )
        page.figure(
            draw_responses(usable), "lags and net speed over the dwell, for slow, middling and fast motors"
        )
    _add_limits(page, rows)


def _add_inputs(page: Page, rows: pd.DataFrame, inputs: dict[str, Floats]) -> None:
    page.section("What was swept")
    table = np.stack([_ranks(values) for values in inputs.values()], 1)
    some = table[:2048]
    random = np.random.default_rng(0).random(some.shape)
    page.text(
        f"{len(inputs)} inputs varied. Discrepancy of the design (0: perfectly even) "
        f"{qmc.discrepancy(some):.2g}, of as many random points {qmc.discrepancy(random):.2g}."
    )
    found = [
        (c.name, f"{rows[c.name].min():.4g}", f"{rows[c.name].median():.4g}", f"{rows[c.name].max():.4g}", c.unit)
        for c in INPUTS
    ]
    page.table(("input", "smallest", "median", "largest", "unit"), found)


def _ranks(values: Floats) -> Floats:
    """Values as even ranks between 0 and 1; equal values are spread."""
    order = np.argsort(values + 1e-12 * np.arange(len(values)), kind="stable")
    ranks = np.empty(len(values))
    ranks[order] = (np.arange(len(values)) + 0.5) / len(values)
    return ranks


def _add_dependence(page: Page, usable: pd.DataFrame, names: list[str]) -> None:
    page.section("What depends on what")
    inputs = {name: usable[name].to_numpy(float) for name in names}
    found = {}
    for output in OUTPUTS:
        values = np.abs(usable[output].to_numpy(float))
        found[output] = sobol_indices(inputs, values if output == "theta_deg" else np.log(values))
    page.text(
        "Sobol indices: the share of an output's variance over the sweep that an input explains alone (first "
        "order) and with all others together (total). Yaw rate, surge and radius are taken as logarithms."
    )
    page.figure(draw_indices(found), "Sobol indices of four outputs in all inputs, with 95 % intervals")
    worst = min(found, key=lambda output: found[output].explained)
    page.text(
        f"The polynomials behind the indices explain {100 * found[worst].explained:.1f} % of the variance or more "
        f"(least: {_plain(worst)})."
    )
    for output in OUTPUTS:
        page.figure(
            draw_trends(usable, output, [name for name in names if name != "N"]),
            f"{_plain(output)} against each input, by number of tails",
        )
    page.text(
        "Lines: medians by number of tails. Bands: the middle half of the rows, of all tails if N has many values."
    )


def _add_linear_theory(page: Page, usable: pd.DataFrame, names: list[str]) -> None:
    base = [c.name for c in INPUTS]
    rows, linear = linear_rows({name: usable[name].to_numpy(float) for name in base})
    some = usable.iloc[rows]
    inputs = {name: some[name].to_numpy(float) for name in names}
    page.section("Scaling laws")
    page.text(
        "Exponents: by how many per cent an output grows when an input grows by one per cent and all others are "
        "held, in the lower, middle and upper third of the input. Where the three agree to 0.1, a power law holds "
        "over the sweep. The last three columns are those of linear theory, for the same robots. Inputs that "
        f"change an output by less than the power {_SMALL:g} are left out."
    )
    table = []
    for output in OUTPUTS:
        simulated = exponents(inputs, output, np.abs(some[output].to_numpy(float)))
        theory = exponents(inputs, output, linear[output])
        for one, other in zip(simulated, theory, strict=True):
            if np.nanmax(np.abs(one.value)) > _SMALL:
                verdict = "power law" if one.holds else "changes"
                table.append((_plain(output), one.input, *_cells(one), verdict, *_plain_cells(other)))
    thirds = ("lower", "middle", "upper")
    page.table(("output", "input", *thirds, "", *(f"linear: {third}" for third in thirds)), table)
    page.section("Against linear theory")
    page.text(
        "Each point is a robot. S is the drag number of a tail: viscous against elastic forces. For small S the "
        "tails stay nearly straight and the ratio tends to what linear theory leaves out."
    )
    page.figure(draw_collapse(some, linear, OUTPUTS), "outputs over linear theory against the drag number")


def _cells(one: Exponents) -> list[str]:
    return [f"{v:.2f} ± {w:.2f}" for v, w in zip(one.value, one.half_width, strict=True)]


def _plain_cells(one: Exponents) -> list[str]:
    return [f"{v:.2f}" for v in one.value]


def _add_limits(page: Page, rows: pd.DataFrame) -> None:
    page.section("Where tails touch, where the solver struggled")
    stepped = rows["reason"].astype(str) != ""
    page.figure(
        draw_where(rows.assign(hard=rows["failed"] | stepped)), "share of rows that touch, and that failed, over ω̄"
    )
    page.text(
        f"In {int(rows['touching'].sum())} of {len(rows)} rows tails touch: their numbers are of a model without "
        f"contact. {int(rows['failed'].sum())} rows failed."
    )
    reasons = rows.loc[stepped, "reason"].astype(str).str.replace(_SIZE, "", regex=True).value_counts()
    if len(reasons):
        page.table(("reason", "rows"), [(str(reason), int(count)) for reason, count in reasons.items()])
    page.section("Cost")
    cost = rows[COST].to_numpy(float) * 1e3
    page.text(f"{cost.sum() / 6e4:.1f} minutes of processor time, {cost.mean():.1f} ms a row on average.")
    page.table(
        ("N", "rows", "median [ms]", "mean [ms]", "slowest [ms]"),
        [
            (
                str(n),
                len(part),
                *(f"{f(1e3 * part[COST].to_numpy(float)):.1f}" for f in (np.median, np.mean, np.max)),
            )
            for n, part in rows.groupby("N")
        ],
    )


def _plain(name: str) -> str:
    """A label without formulas."""
    return LABELS.get(name, name).split(" $")[0]
