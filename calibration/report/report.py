"""The report of a calibration: data, fit, evidence, residuals before and after, errors compared with the noise."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from calibration.attribution.refits import IMITABLE, SURE, UNSEEN, Candidate
from calibration.statistics.fit import WRONG, least_determined
from calibration.swimmer.measured_table import Measurements
from calibration.verdict.next_runs import STOP, Batch
from calibration.verdict.verdict import Verdict
from sim.arrays import Floats
from sim.io.pages import Page
from sim.io.provenance import code_version

_LABELS = {
    "omega_h": "ω_h, head spin",
    "omega_t": "ω_t, tail spin",
    "omega_yr": "ω_yr, yaw rate",
    "R_yr": "R_yr, turn radius",
    "theta": "θ, slip angle [rad]",
    "v": "v, speed",
}
_MODELS = {
    "uncalibrated": "as given",
    "before": "calibrated",
    "after": "calibrated, with effects",
    "generic": "calibrated, generic correction",
    "predictive": "correction in corrected.toml, simulated",
}
_SETTINGS = {"l_cm": "l [cm]", "omega_rpm": "ω [rpm]"}
_DISAGREES = 0.01  # p of the held-out runs below which the report says so
_TESTS = {"lack": "lack of fit", "kernel": "smooth structure", "shape": "shapes", "score": "effects"}


def write_report(result: Verdict, data: Measurements, out: str | Path, *, title: str) -> None:
    """Write report.html."""
    page = Page(f"Calibration: {title}", result.sentence)
    page.figure(draw_summary(result, data), "residual of each output before and after, beside the noise")
    add_sections(page, result, data)
    page.write(out, f"code {code_version()}; fixed before the data was looked at: {result.conditions.hash}")


def add_sections(page: Page, result: Verdict, data: Measurements) -> None:
    """Add the sections of the report."""
    _add_numbers(page, result)
    _add_data(page, result, data)
    _add_fit(page, result)
    page.section("Residuals on the runs that were fitted, before and after")
    page.figure(draw_residuals(result, data), "residuals by output and number of tails, before and after")
    page.text(
        "Where the residual is large: each output along each input, square and product, in standard deviations, "
        "after the fit."
    )
    page.figure(draw_map(result, data), "map of the residual over the runs' inputs, before and after")
    _add_evidence(page, result)
    _add_test(page, result, data)
    if result.next_runs:
        page.section("Runs to make next")
        page.text(
            "These runs would tell the explanations apart. Separation is for the two that they tell apart least; "
            "the last column says how often they would. Settings are those that `--own` named, or the table's."
        )
        settings = list(result.next_runs[0].settings)
        page.table(
            (*(_SETTINGS.get(s, s) for s in settings), "repeats", "separation", "decides"),
            [
                (*map(str, r.settings.values()), str(r.repeats), f"{r.separation:.1f}", f"{100 * r.decides:.0f} %")
                for r in result.next_runs
            ],
        )
        if result.next.batch is not None:
            _add_batch(page, result.next.batch)


def _add_batch(page: Page, batch: Batch) -> None:
    decides = f"{100 * batch.decides:.0f} %"
    wrong = f"{100 / STOP:.0f} %"
    page.text(
        f"Or these {len(batch.settings)} runs together. They would decide in {decides} of cases. "
        'Add them to the table with a session of their own. Then "calibration decide" says which explanation they '
        f"speak for. An explanation is given up when the best one is {STOP:.0f} times as likely. So the right one "
        f"is given up in about {wrong} of cases at most, however often you look."
    )
    page.table(
        [_SETTINGS.get(s, s) for s in batch.settings[0]], [tuple(map(str, s.values())) for s in batch.settings]
    )


def _add_numbers(page: Page, result: Verdict) -> None:
    if not result.fits.pulls:
        return
    page.section("Nuisance parameters")
    wrong = [" or ".join(p.parameter.title for p in alike) for alike in result.wrong_numbers]
    said = "; ".join(wrong) if wrong else "none is"
    page.text(
        "What was given is known to a tolerance only. So these parameters are fitted, too, each with the "
        "tolerance that was stated for it. The pull is how far the runs move a parameter, in standard deviations "
        f"of what chance would do. Beyond {WRONG:g} the stated value is taken to be wrong: {said}.",
        tone="bad" if wrong else "good",
    )
    rows = []
    for p in result.fits.pulls:
        nuisance = p.parameter
        assert nuisance.sigma is not None
        scale, unit = (100.0, "%") if nuisance.logarithmic else (nuisance.shown, nuisance.unit)
        runs = f"{p.off(p.alone)}, ± {scale * p.alone_error:.2g} {unit}" if p.learnt else "nothing"
        rows.append(
            (
                nuisance.title,
                f"{nuisance.start:.4g}"
                if nuisance.unit != nuisance.title and nuisance.start not in (0.0, 1.0)
                else "",
                f"± {scale * nuisance.sigma:.2g} {unit}",
                f"{p.off(p.change)}, ± {scale * p.error:.2g} {unit}",
                runs,
                f"{p.z:+.1f}" if p.learnt else "",
            )
        )
    page.table(("parameter", "given [SI]", "tolerance (σ)", "fitted", "what the runs alone say", "pull"), rows)


def _add_data(page: Page, result: Verdict, data: Measurements) -> None:
    page.section("Data")
    page.text(
        f"{len(data)} usable runs in {len(data.session_names)} session(s); held out for the test: "
        f"{result.conditions.split.names}. Excluded: "
        + ("; ".join(result.conditions.excluded) if result.conditions.excluded else "nothing")
        + "."
    )
    scatter = np.sqrt(np.diag(result.base.noise.run))
    noise = ", ".join(f"{_LABELS[o]} {100 * s:.1f} %" for o, s in zip(data.outputs, scatter, strict=True))
    share = f"{100 * math.sqrt(result.final.noise.share):.0f} % of that"
    shift = f"A session shifts all its runs by {share}."
    if len(data.session_names) == 1:
        shift = f"With one session its shift cannot be measured; {share} is assumed."
    page.text(f"Scatter of one run, from the repeats: {noise}. {shift}")
    for limit in result.conditions.caveats:
        page.text(f"The conclusion is weaker: {limit}.", tone="bad")


def _add_fit(page: Page, result: Verdict) -> None:
    page.section("Fit")
    given = {p.parameter.name for p in result.fits.pulls}
    rows = []
    for fitted, intervals, name in (
        (result.base, result.fits.base_intervals, "without effects"),
        (result.final, result.fits.final_intervals, "with the verdict's effects"),
    ):
        for parameter in (p.name for p in fitted.fitted if p.name not in given):
            low, high = intervals[parameter]
            rows.append(
                (f"{parameter}, {name}", f"{fitted.parameters[parameter]:.4g}", f"{low:.4g} to {high:.4g}")
            )
        if result.final is result.base:
            break
    page.table(("parameter", "value", "95 % interval, by profile deviance"), rows)
    combination, error = least_determined(result.final)
    final = result.fits.final_refit.parameters
    page.text(
        f"The runs determine {combination} worst: {100 * error:.1f} %. corrected.toml has the model fitted once "
        "more to all runs, with the held-out ones: "
        + ", ".join(f"{name} {final[name]:.4g}" for name in result.final.names if name not in given)
        + "."
    )


def _add_evidence(page: Page, result: Verdict) -> None:
    page.section("Evidence for each effect of the catalogue")
    misfit = result.evidence.misfit
    each = ", ".join(f"{_TESTS[name]} {p:.2g}" for name, p in misfit.p.items())
    page.text(
        f"Is there more than noise? p = {misfit.p_value:.2g} by all tests together ({each}). Below: score of each "
        "effect, without the part that the coefficients and the nuisance parameters can absorb; claims need more "
        f"than {misfit.critical_z:.2f}. The smallest detectable size is found half of the time. The column beside "
        "it is that size if every nuisance parameter were exact. A dash means that the effect changes nothing in "
        "these runs."
    )
    page.figure(draw_evidence(result), "score of each effect against what a claim needs")
    page.table(
        ("effect", "score z", "survived share", "smallest detectable size", "numbers exact", "judgement"),
        [
            (
                c.effect.title,
                f"{c.z:+.1f}",
                f"{c.survived:.2f}",
                _size(c.detectable),
                _size(c.detectable_exact),
                c.verdict,
            )
            for c in result.evidence.candidates
        ],
    )
    for c in result.explaining:
        page.text(
            f"{c.title}: {100 * c.imitable:.0f} % of the departures from outside the catalogue that were drawn "
            f"for comparison would have passed for it; above {100 * IMITABLE:.0f} % the verdict says so. "
            + _carried(c)
        )
    if result.evidence.untestable:
        page.text(
            "Not tested, because data are missing: "
            + "; ".join(f"{t} ({why})" for t, why in result.evidence.untestable.items())
        )


def _carried(claim: Candidate) -> str:
    if claim.transfer == 1.0:
        return ""
    words = "predicts" if claim.transfer >= SURE else "does not predict"
    return f"Fitted to short tails and few of them, it {words} the other runs (p = {claim.transfer:.3f})."


def _add_test(page: Page, result: Verdict, data: Measurements) -> None:
    page.section("Error on the held-out runs")
    errors = result.errors
    low, high = errors.after_interval
    page.table(
        ("model", "relative rms", *(_LABELS[o] for o in data.outputs)),
        [
            (_MODELS[name], f"{100 * rms:.2f} %", *(f"{100 * v:.1f} %" for v in errors.by_output[name].values()))
            for name, rms in errors.rms.items()
        ],
    )
    learnt = result.corrections.learnt
    if learnt is not None:
        page.text(
            "So that the robot can be steered although nothing explains the residual, corrected.toml has a "
            f"correction of the head's load in {', '.join(learnt.terms)}. It holds between these runs "
            f"only: N from {data.tails.min():.0f} to {data.tails.max():.0f}, l from "
            f"{100 * data.length.min():.3g} to {100 * data.length.max():.3g} cm, ω from {_rpm(data).min():.3g} "
            f"to {_rpm(data).max():.3g} rpm. A robot outside is refused. The response to a flip is simulated with "
            "the same load."
        )
    features = ", ".join(result.corrections.regression.features) or "no feature"
    agree = errors.p_value >= _DISAGREES
    page.text(
        f"95 % interval with effects: {100 * low:.2f} to {100 * high:.2f} %. "
        f"Noise of one run from the repeats: {100 * errors.noise:.2f} %. The held-out runs "
        f"{'agree' if agree else 'do not agree'} with the final model (p = {errors.p_value:.2g}). "
        f"Generic correction: {features} (it describes the residual and does not explain it).",
        tone="good" if agree else "bad",
    )


def _rpm(data: Measurements) -> Floats:
    return np.asarray(np.abs(data.omega) * 30 / math.pi)


def draw_summary(result: Verdict, data: Measurements) -> Figure:
    """Draw the residual of each output before and after, as rms over the fitted runs, and the noise of a run."""
    bars = [
        ("calibrated, without effects", result.base.prediction, "#e08a1e"),
        ("final model", result.final.prediction, "#3d9a5f"),
    ]
    noise = 100 * np.sqrt(np.diag(result.base.noise.run))
    figure = Figure(figsize=(9, 2.6))
    axes = figure.add_subplot()
    place = np.arange(len(data.outputs))
    for i, (label, prediction, colour) in enumerate(bars):
        rms = 100 * np.sqrt(((data.y - prediction)[result.conditions.split.fitted] ** 2).mean(0))
        axes.bar(place + 0.32 * (i - 0.5), rms, width=0.3, color=colour, label=label)
    for i, height in enumerate(noise.tolist()):
        said = "noise of a run" if i == 0 else None
        axes.plot([i - 0.38, i + 0.38], [height] * 2, color="#1c2733", lw=1.6, label=said)
    axes.set_xticks(place, [_LABELS[o] for o in data.outputs], fontsize=8)
    axes.set_ylabel("measured − model, rms [%]", fontsize=8)
    axes.tick_params(axis="y", labelsize=8)
    axes.legend(fontsize=7, frameon=False)
    figure.tight_layout()
    return figure


def draw_map(result: Verdict, data: Measurements) -> Figure:
    """Draw z of every output along every feature of the inputs, before and after."""
    maps = [("calibrated", result.evidence.misfit)]
    if result.explaining and result.explaining[0].refit_misfit is not None:
        maps.append(("with the verdict's effects", result.explaining[0].refit_misfit))
    names = [name.replace("omega", "ω") for name in result.evidence.misfit.features]
    height = 0.32 * len(data.outputs) + 0.5
    figure = Figure(figsize=(11, len(maps) * height + 1.6))
    limit = max(4.0, float(np.abs(result.evidence.misfit.scores.shapes).max(initial=0.0)))
    for place, (label, misfit) in enumerate(maps):
        axes = figure.add_subplot(len(maps), 1, place + 1)
        z = misfit.scores.shapes
        axes.imshow(
            np.arcsinh(z / 2),
            cmap="RdBu_r",
            vmin=-np.arcsinh(limit / 2),
            vmax=np.arcsinh(limit / 2),
            aspect="auto",
        )
        for i, j in np.argwhere(np.abs(z) > 3):
            colour = "white" if abs(z[i, j]) > 0.4 * limit else "#1c2733"
            axes.text(j, i, f"{z[i, j]:+.0f}", ha="center", va="center", fontsize=7, color=colour)
        axes.set_yticks(range(len(data.outputs)), [_LABELS[o].split(" [")[0] for o in data.outputs], fontsize=8)
        last = place == len(maps) - 1
        axes.set_xticks(range(len(names)), names if last else [""] * len(names), rotation=90, fontsize=7)
        axes.set_title(f"{label} (numbers where |z| > 3)", fontsize=9)
    figure.tight_layout()
    return figure


def draw_evidence(result: Verdict) -> Figure:
    """Draw the score of every effect as a bar, with the critical score; what explains the residual is green."""
    named = {name for c in result.explaining for name in (e.name for e in c.claimed)}
    ranked = sorted(result.evidence.candidates, key=lambda c: abs(c.z))
    figure = Figure(figsize=(9, 0.8 + 0.24 * len(ranked)))
    axes = figure.add_subplot()
    for place, candidate in enumerate(ranked):
        tested = candidate.refit is not None
        colour = "#3d9a5f" if candidate.effect.name in named else "#e08a1e" if tested else "#b8c2cc"
        axes.barh(place, candidate.z, color=colour, height=0.7)
    for edge in (-result.evidence.misfit.critical_z, result.evidence.misfit.critical_z):
        axes.axvline(edge, color="#1c2733", lw=0.8, ls="--")
    axes.set_yticks(range(len(ranked)), [c.effect.title for c in ranked], fontsize=7)
    axes.set_xscale("symlog", linthresh=2 * result.evidence.misfit.critical_z)
    axes.tick_params(axis="x", labelsize=8)
    axes.set_xlabel(
        "score z (dashed: needed for a claim; green: explains; orange: refitted and rejected)", fontsize=8
    )
    figure.tight_layout()
    return figure


def draw_residuals(result: Verdict, data: Measurements) -> Figure:
    """Draw measured minus model in per cent, against tail length, before (left) and after (right)."""
    outputs = data.outputs
    figure = Figure(figsize=(11, 1.9 * len(outputs)))
    colours = {n: c for n, c in zip((2, 3, 4, 5), ("#2a7fba", "#e08a1e", "#3d9a5f", "#8a4fa3"), strict=True)}
    rng = np.random.default_rng(0)
    used = result.conditions.split.fitted
    jitter = rng.uniform(-0.25, 0.25, used.sum())
    for i, name in enumerate(outputs):
        limit = 0.0
        pair = []
        for j, fitted in enumerate((result.base, result.final)):
            axes = figure.add_subplot(len(outputs), 2, 2 * i + j + 1)
            residual = 100 * (data.y - fitted.prediction)[used, i]
            limit = max(limit, float(np.abs(residual).max()) * 1.1)
            for n in np.unique(data.tails[used]):
                some = data.tails[used] == n
                axes.plot(
                    100 * data.length[used][some] + jitter[some],
                    residual[some],
                    ".",
                    ms=4,
                    color=colours.get(int(n), "#555555"),
                    label=f"N = {int(n)}",
                )
            axes.axhline(0, color="#1c2733", lw=0.6)
            axes.set_ylabel(f"{_LABELS[name]} [%]", fontsize=8)
            axes.tick_params(labelsize=8)
            pair.append(axes)
        for axes in pair:
            axes.set_ylim(-limit, limit)
    figure.axes[0].set_title("calibrated", fontsize=10)
    figure.axes[1].set_title("calibrated, with the verdict's effects", fontsize=10)
    figure.axes[0].legend(fontsize=7, frameon=False, ncols=4)
    for axes in figure.axes[-2:]:
        axes.set_xlabel("tail length [cm]", fontsize=8)
    figure.tight_layout()
    return figure


def _size(value: float) -> str:
    """Write a smallest detectable size; a dash where no size shows in these runs."""
    return f"{value:.2g}" if value < UNSEEN else "–"
