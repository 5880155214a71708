"""The part of a calibration's report on the held-out runs: how far each model is from them."""

from __future__ import annotations

import numpy as np

from calibration.laws.law_fits import Laws
from calibration.report.figures import draw_summary, final_model
from calibration.report.quantities import feature_in_words, output_error, output_label, plain, ranges_in_words
from calibration.statistics.statistical_model import Runs
from calibration.verdict.verdict import Verdict
from sim.io.pages import Page


def add_errors(page: Page, result: Verdict, data: Runs) -> None:
    """Add the section on the errors of each model on the held-out runs."""
    page.section("Error on the held-out runs")
    errors, split = result.errors, result.conditions.split
    page.text(
        f"{int(split.test.sum())} runs ({split.names}) were held out before anything was fitted. This is how far "
        "each model is from them."
    )
    models = {"uncalibrated": "as given", "before": "calibrated"}
    if final_model(result):
        models["after"] = f"calibrated, {final_model(result)}"
    if "predictive" in errors.rms:
        models["predictive"] = "calibrated, with the correction in corrected.toml"
    if "law" in errors.rms:
        models["law"] = "calibrated, with the best law"
    models["generic"] = "calibrated, with a regression of the residual"
    rows = [
        (
            words,
            f"{100 * errors.rms[name]:.2f} %",
            *(output_error(output, error) for output, error in errors.by_output[name].items()),
        )
        for name, words in models.items()
    ]
    scatter = np.sqrt(np.diag(result.base.noise.run)).tolist()
    noise = (
        "noise of one run",
        f"{100 * errors.noise:.2f} %",
        *(output_error(output, error) for output, error in zip(data.outputs, scatter, strict=True)),
    )
    page.table(("model", "all outputs", *(output_label(o) for o in data.outputs)), [*rows, noise])
    _add_agreement(page, result)
    if result.held_out_error_falls is False:
        page.text(
            f"The error does not fall with what is claimed: {100 * result.error_before:.2f} % without it, "
            f"{100 * result.error_after:.2f} % with it.",
            tone="bad",
        )
    page.figures([(draw_summary(result, data), "residual of each output over the noise, for each model",
                   "The same on the runs that were fitted, for each output.")])  # fmt: skip
    features = [feature_in_words(name) for name in result.corrections.regression.features]
    page.text(
        "The regression of the residual describes it, and does not explain it. It uses "
        f"{', '.join(features) or 'no feature'}."
    )
    _add_correction(page, result, data)


def _add_agreement(page: Page, result: Verdict) -> None:
    """Say whether the held-out runs agree with the final model, and how well its error is known."""
    errors, law = result.errors, result.corrections.law
    agree = result.held_out_runs_agree
    model, whose, (low, high) = "final", "Its", errors.after_interval
    if result.described and isinstance(law, Laws):
        model, whose, (low, high) = "calibrated", "With the law, the", law.kept[0].error_interval
    said = f"The held-out runs {'agree' if agree else 'do not agree'} with the {model} model"
    page.text(
        f"{said} (p = {plain(errors.p_value, 2)}). {whose} error has the 95 % interval {100 * low:.2f} to "
        f"{100 * high:.2f} %.",
        tone="good" if agree or result.described else "bad",
    )


def _add_correction(page: Page, result: Verdict, data: Runs) -> None:
    learnt = result.corrections.learnt
    if learnt is None:
        return
    page.text(
        "So that the robot can be steered although nothing explains the residual, corrected.toml has a correction "
        f"of the head's load in {', '.join(learnt.terms)}. It holds between these runs only: "
        f"{ranges_in_words(data.settings)}. "
        "A robot outside is refused. The response to a flip is simulated with the same load."
    )
