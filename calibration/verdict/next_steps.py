"""What a lab does next, by the verdict of a table, in words.

A verdict that the held-out runs contradict comes before all others: more runs, and no use of it until then. A
corrected robot that does not lower their error is not advised.
"""

from __future__ import annotations

from calibration.verdict.verdict import DISAGREES, Verdict
from surrogate.input_ranges import COEFFICIENTS

_PLAN = "Plan with the corrected robot: `softflagella plan square:3l --robot corrected.toml --out plan`."
_NEW_SESSION = "add the new runs to the table with a session of their own (column `session`)"


def next_steps(result: Verdict) -> list[str]:
    """List what to do next, the most urgent first; code is between backticks."""
    by_verdict = {
        "none": _after_none,
        "number": _after_number,
        "effect": _after_effect,
        "ambiguous": _after_ambiguous,
        "partial": _after_partial,
        "unexplained": _after_unexplained,
    }
    steps = [*_moved(result), *_contradicted(result), *by_verdict[result.verdict](result)]
    if not set(COEFFICIENTS) <= set(result.base.names):  # no robot is handed on
        return [step for step in steps if "corrected" not in step and "softflagella" not in step]
    if (
        result.moves or result.error_corrected < result.error_uncalibrated
    ):  # the held-out runs may be those that differ
        return steps
    return [
        "Plan with the robot as given: the corrected one does not lower the error on the held-out runs "
        f"({100 * result.error_uncalibrated:.2f} % as given, {100 * result.error_corrected:.2f} % corrected). "
        "Check the units of the table, or make more runs.",
        *(step for step in steps if "corrected.toml" not in step),
    ]


def _moved(result: Verdict) -> list[str]:
    """What comes first if a number differs in some runs."""
    if not result.moves:
        return []
    where = " and ".join(dict.fromkeys(move.record["where"] for move in result.moves))
    return [
        f"Find out what changed {where}: look at the set-up, the fluid and the camera of these runs. Repeat a few "
        f"of them, {_NEW_SESSION}, and calibrate again; or leave them out."
    ]


def _contradicted(result: Verdict) -> list[str]:
    """What comes first if the held-out runs do not bear the verdict out."""
    held_out = result.conditions.split.names
    missing = result.verdict in ("partial", "unexplained")
    if result.errors.p_value < DISAGREES and not missing and not result.moves:
        return [
            f"Find out what is different about the held-out runs ({held_out}): they do not agree with the final "
            f"model (p = {result.errors.p_value:.2g}). Look for a change of the set-up on that day, or make more "
            f"runs: {_NEW_SESSION}, and calibrate again."
        ]
    if result.held_out_error_falls is False and result.effects:
        return [
            f"Do not rely on this claim yet: it does not lower the error on the held-out runs ({held_out}). Make "
            f"more runs: {_NEW_SESSION}, and calibrate again."
        ]
    return []


def _after_none(result: Verdict) -> list[str]:
    return [
        _PLAN,
        "An effect may still be there if it is smaller than these runs can show: the table of evidence has the "
        "smallest detectable size of each.",
    ]


def _after_number(result: Verdict) -> list[str]:
    titles = [" or ".join(pull.parameter.title for pull in alike) for alike in result.wrong_numbers]
    unconfirmed = (
        " Do not take over the fitted value without measuring it: it does not lower the error on the held-out "
        "runs."
    )
    steps = [
        f"Measure again: {'; and '.join(titles)}. Correct it in the robot's file or in the table, and calibrate "
        f"again.{unconfirmed if result.held_out_error_falls is False else ''}",
        *_telling_apart(result),
    ]
    if result.held_out_error_falls is False:
        return [*steps, "Until then, plan with the robot as given: corrected.toml has the fitted value."]
    return [*steps, f"Until then, corrected.toml has the fitted value. {_PLAN}"]


def _after_effect(result: Verdict) -> list[str]:
    steps = []
    if any(claim.uncertain for claim in result.explaining):
        steps.append(
            "Test the claim where it matters most: make runs with other numbers of tails and tail lengths, "
            f"{_NEW_SESSION}, and calibrate again. Something outside the catalogue may look like it."
        )
    if result.in_form_only:
        steps.append(
            "Take the effect as a description of the runs: its size is outside the range that its source allows."
        )
    worth_making = result.next.batch is not None and result.next.batch.worth_making
    return [
        *steps,
        *(_telling_apart(result) if worth_making else []),  # else runs with other settings, as above
        f"{_PLAN} It has the effect.",
        "Film the robot on its way, and compare: `softflagella planner check plan/plan.json track.csv`.",
    ]


def _after_ambiguous(result: Verdict) -> list[str]:
    first = result.explaining[0].title
    numbers = " and ".join(p.parameter.title for p in result.evidence.rival_numbers)
    again = f"Measure {numbers} again, to rule out that the stated value is wrong, and calibrate again."
    return [
        *([again] if numbers else []),
        *_telling_apart(result),
        f"Until then, corrected.toml has {first}. It predicts runs like those of this table; elsewhere the "
        "explanations differ.",
    ]


def _after_partial(result: Verdict) -> list[str]:
    assert result.nearest is not None
    title = result.nearest.effect.title
    if not result.held_out_error_falls:
        return [
            f"Do not use {title}: it does not lower the error on the held-out runs. corrected.toml is without it."
        ]
    specimens = (
        [f"Find out what differs between the specimens: the report shows the size of {title} for each."]
        if result.nearest.sizes
        else []
    )
    return [
        *specimens,
        f"Make runs where most is left ({result.nearest.largest_along}), {_NEW_SESSION}, and calibrate again.",
        f"{_PLAN} It has {title}, with its spread between specimens in the stated error.",
    ]


def _after_unexplained(result: Verdict) -> list[str]:
    if result.harmless:
        return [
            f"{_PLAN} The residual is smaller than the noise of a run, and harmless for prediction between these "
            "runs.",
            "Look for its cause only if you want to name it. These runs show it because they are many: repeat the "
            f"conditions where it is largest (below), {_NEW_SESSION}, and calibrate again.",
        ]
    if result.described:
        steps = ["Look for a cause where the law acts (below), and which depends on the same inputs."]
    else:
        steps = [
            "Look where the residual is large (below): a dependence on one input points to the part of the set-up "
            "to check."
        ]
    if result.evidence.untestable:
        missing = sorted(result.evidence.untestable)
        steps.append(
            f"Note more in the table, so that these effects can be tested: {', '.join(missing)}. The section on "
            "the evidence says which columns they need."
        )
    if result.described:
        return [
            *steps,
            *_telling_apart(result),
            f"{_PLAN} It has the law, which holds between these runs only.",
            "When the cause is known, make the law an effect of the catalogue: `softflagella calibration adopt "
            "verdict.json --name NAME --out effects`.",
        ]
    if result.error_predictive is None:
        return [
            *steps,
            "Plan with corrected.toml only where a residual of this size does not matter: nothing in it describes "
            "the residual.",
        ]
    return [*steps, f"{_PLAN} It has a correction of the residual, which holds between these runs only."]


def _telling_apart(result: Verdict) -> list[str]:
    """The runs that tell several explanations apart, and the command that judges them."""
    if result.next.batch is None:
        return []
    count, decides = len(result.next.batch.settings), result.next.batch.decides
    if not result.next.batch.worth_making:
        return [
            "Do not make runs with these settings to tell the explanations apart: the best "
            f"{count} decide in {100 * decides:.0f} % of cases only. Say what else the lab can set or build, and "
            "calibrate again, for example with `--own N=2,4,6 --own l_cm=5,7,9`."
        ]
    return [
        f"Make the {count} runs of the table below, which tell the explanations apart in "
        f"{100 * decides:.0f} % of cases; {_NEW_SESSION}.",
        "Ask which explanation they speak for: `softflagella calibration decide TABLE verdict.json --robot "
        "ROBOT`, with the table, the verdict.json beside this report, and the robot as it was given.",
    ]
