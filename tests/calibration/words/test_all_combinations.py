"""What is said in all combinations of a verdict and its flags: one advice, and no word of what is not there.

There is no robot where a model is calibrated, and there are no runs where a robot is calibrated from a swim.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from itertools import product
from types import SimpleNamespace
from typing import Any

import pytest

from calibration.findings.findings import Findings
from calibration.report.report import sections
from calibration.verdict.calibrate import calibrate
from calibration.words.render import (
    badges,
    errors_in_words,
    headline,
    in_brief,
    next_in_short,
    next_steps,
    say_laws,
    sentence,
)
from tests.calibration.words.test_words import in_report, laws_of_five_places, read
from tests.oracles.falling_balls import balls, falls
from tests.shared import shared

Record = dict[str, Any]

OF_A_ROBOT = re.compile(
    r"robot|\btails?\b|tank|camera|motor|swim|softflagella|corrected\.toml|slip angle|heading", re.IGNORECASE
)
DECIDE = "softflagella calibration decide TABLE verdict.json --model MODEL"  # of any model
OF_RUNS = re.compile(r"\bruns?\b|\bsession|\brepeat|\bconditions\b|\btable of (?!evidence)|number of tails")
NAMES_RUNS = re.compile(  # where it is said what a swim cannot tell
    r"from runs with other numbers of tails and tail lengths|by runs with other numbers of tails and tail lengths|"
    r"softflagella calibrate runs.csv|from a table of runs|a table of runs may have|\(column ?`?run`? ?\)"
)
P_VALUE = re.compile(r"\bp [=≤]")
SPOILT = re.compile(r"\bNone\b|\bnan\b|Undefined|  |\.\.|[.,;:] [.,;]|\(\)| [.,;)]|\( ")
TAG, OF_THE_LEAD = re.compile("<[^>]*>"), 3  # words, as "falls.csv: 45 runs"
MODEL_TO_USE = re.compile(r"^(Plan with|Use) (the|neither) (corrected )?(robot|model)")

WALL = {"title": "wall of the tube", "words": "wall of the tube (wall)", "effects": ["wall"]}
LAG = {"title": "inertia", "words": "inertia (inertia)", "effects": ["inertia"]}
SHOWN = {"unit": "1", "shown": 1.0, "given": 0.0, "scale": "as it is"}
SIZE = {"title": "wall of the tube", **SHOWN, "value": 0.9, "interval": [0.8, 1.0], "value_all_runs": 0.9}
NEAREST = {
    "effect": "wall", "title": "wall of the tube", **SHOWN, "mean": 0.9, "interval": [0.8, 1.0], "spread": 0.1,
    "sizes": {}, "removed_share": 0.9, "session_gain": [30.0, 4.0], "birge": 2.0, "remainder": 0.01,
    "remainder_p": 0.002, "largest_along": "speed along depth", "as_well": ["inertia"], "at_theory": False,
    "sizes_of": "specimens",
}  # fmt: skip
SIZES = {"A": [0.7, 0.6, 0.8], "B": [1.1, 1.0, 1.2]}
OFF = {"title": "viscosity", "words": "viscosity is 9 % above what was given (9.1 σ)", "departure": "9 % above",
       "tolerances": 9.4}  # fmt: skip
MOVE = {"words": "viscosity is 9 % above that of the other runs", "where": "in session 2"}
FORMS = [
    {"title": "inertia", "error": 0.033, "theory": False, "as_well": True},
    {"title": "wall of the tube at the size of theory, 1", "error": 0.032, "theory": True, "as_well": True},
    {"title": "decoy", "error": 0.09, "theory": False, "as_well": False},
]
UNFITTED = {"title": "drag", "reason": "its fit did not converge"}
FORBIDDEN = {"title": "decoy", "error_before": 0.12, "error_after": 0.17}
CONDITIONS = {"names": "balls 2 and 5", "before": 0.12, "after": 0.04, "p_value": 0.2}
POSE = {"x": 0.012, "y": 0.034, "heading": 0.056}
SWIM = {"row": "pose", "locked_test": "last third of swim", "sessions": ["swim"], "next_runs": [],
        "limits": [], "drawn_against": ["time", "direction of the motor"], "outputs": list(POSE),
        "output_titles": {}, "output_scales": {"x": [100.0, "cm"], "y": [100.0, "cm"], "heading": [57.3, "°"]},
        "errors_by_output": dict.fromkeys(("uncalibrated", "before", "after", "law"), POSE),
        "scatter_of_a_run": POSE}  # fmt: skip
BATCH = {"runs": 4 * [{"depth": 4.0}], "decides": 0.9, "worth_making": True}
TRACE = {**BATCH, "runs": [{"depth": 4.0, "t_s": "0 to 9", "readings": 10, "read": "as often"}]}
GAINS: dict[str, Record] = {
    "certain": {"error_after": 0.04, "gain_interval": [0.05, 0.11], "gain_is_certain": True},
    "uncertain": {"error_after": 0.119, "gain_interval": [-0.01, 0.02], "gain_is_certain": False},
    "of no interval": {"error_after": 0.04},
    "none": {"error_after": 0.13, "gain_interval": [-0.02, -0.001], "gain_is_certain": False},
}
EITHER = (False, True)


@shared
def falling_balls() -> Record:
    """The record of a verdict on a model that is no robot."""
    result = calibrate(balls(falls("nothing", 0)), draws=200, progress=False)
    record: Record = json.loads(json.dumps(result.to_dict()))
    return record


def found_laws() -> Record:
    """A record of laws as it is in a verdict."""
    laws, fitted = (
        laws_of_five_places(),
        {"gain": 9.0, "error": 0.05, "error_interval": [0.04, 0.06], "leaves_noise": True},
    )
    return {**laws, "sentence": say_laws(laws), "beside": "", "laws": [{**law, **fitted} for law in laws["laws"]]}


def with_flags(verdict: str, changes: Record) -> Record:
    """A verdict with some of its entries changed, which is consistent in those that depend on others."""
    record = {**falling_balls(), "verdict": verdict, "error_uncalibrated": 0.2, "error_before": 0.12, **changes}
    claimed, adopted = record["claims"], record["nearest"]
    record["effects"] = [name for claim in claimed for name in claim["effects"]]
    record["models"] = {"uncalibrated": "model unchanged", "before": "refitted"}
    if verdict == "number":
        record["models"]["after"] = "refitted, a number free"
    elif adopted or claimed:
        record["models"]["after"] = f"refitted with {(adopted or claimed[0])['title']}"
    if isinstance(record["error_law"], float):
        record["models"]["law"] = "refitted with the best law"
    record["imitability"], record["transfer_p"] = len(claimed) * [0.1], len(claimed) * [1.0]
    falls_with_it = None if verdict in ("none", "unexplained") else record["error_after"] < record["error_before"]
    record["held_out_error_falls"] = falls_with_it
    of_base = (adopted and not falls_with_it) or verdict in ("none", "unexplained")
    of_law = record["error_law"] if record["described"] else record["error_before"]
    record.setdefault("error_corrected", 0.0)
    record["error_corrected"] = of_law if of_base else record["error_after"]
    if changes.get("given_is_best"):
        record["error_uncalibrated"] = 0.03
    advice = Findings.advice.fget  # type: ignore[attr-defined]
    return {**record, "advice": advice(SimpleNamespace(**record))}


def combinations(verdict: str) -> Iterator[Record]:
    """All combinations of the flags of a verdict."""
    flags: dict[str, tuple[Record, ...]] = {
        "subject": ({"subject": "model"}, {"subject": "robot"}, {"subject": "robot", **SWIM}),
        "agree": ({"held_out_runs_agree": True, "locked_p_value": 0.4}, {"held_out_runs_agree": False}),
        "moves": ({}, {"moves": [MOVE]}),
        "given": ({}, {"given_is_best": True}),
        "provisional": (
            {},
            {
                "not_tried": ["a wall"],
                "withdrawn": [FORBIDDEN],
                "errors_of_conditions": CONDITIONS,
                "not_fitted": [UNFITTED, UNFITTED],
                "halving": "inertia",
            },
        ),
    }
    batches: tuple[Record, ...] = (
        {}, *({"next_batch": {**of, "worth_making": worth}} for of in (BATCH, TRACE) for worth in EITHER)
    )  # fmt: skip
    gains = tuple(GAINS.values())
    imitable: tuple[Record, ...] = ({}, {"imitable": True})
    claim = {"claims": [WALL], "parameters": {**falling_balls()["parameters"], "wall": SIZE}}
    match verdict:
        case "none":
            flags |= {"number": ({}, {"notable_number": OFF["words"]})}
        case "number":
            check = {"number_check": {"uncertain": True, "implausible": True, "tolerances": 9.0}}
            flags |= {
                "number": ({"wrong_number_records": [[OFF]]}, {"wrong_number_records": [[OFF, OFF]], **check}),
                "gain": gains, "batch": batches, "instead": ({}, {"claims_instead": ["inertia"]}),
            }  # fmt: skip
        case "effect":
            flags |= {
                "claim": (claim, {**claim, "in_form_only": ["wall"]}, {**claim, "wrong_number_records": [[OFF]]}),
                "gain": gains, "imitable": imitable, "batch": batches[1:], "forms": ({}, {"forms": FORMS}),
            }  # fmt: skip
        case "ambiguous":
            several = {**claim, "claims": [WALL, LAG]}
            flags |= {
                "claim": (several, {**claim, "rival_numbers": [OFF]},
                          {**several, "certain": ["wall"], "undecided": ["inertia", "decoy", ""]}),
                "gain": gains, "imitable": imitable,
                "batch": batches, "number": ({}, {"notable_number": OFF["words"]}),
            }  # fmt: skip
        case "partial":
            turns = [{"error": 0.12, "named": "", "left": "speed along depth"},
                     {"error": 0.04, "named": "wall of the tube", "left": ""}]  # fmt: skip
            flags |= {
                "nearest": ({"nearest": NEAREST}, {"nearest": {**NEAREST, "sizes": SIZES, "as_well": []}},
                            {"nearest": {**NEAREST, "remainder": 0.0, "largest_along": ""}, "turns": turns}),
                "gain": gains, "forms": ({}, {"forms": FORMS, "error_new_specimen": 0.05}),
            }  # fmt: skip
        case "unexplained":
            laws = {"laws": found_laws(), "error_law": 0.05}
            laws["errors_by_output"] = {**falling_balls()["errors_by_output"], "law": {}}
            near = {"title": "inertia", "removed_share": 0.6, "reason": "its interval includes the null"}
            flags |= {
                "what": ({}, {"harmless": True}, {"largest_along": "speed along depth", "nearest_candidate": near},
                         {"largest_departures": [{"at": ["depth = 4"], "departure": 3.0}], "largest_along": ""}),
                "untestable": ({}, {"untestable": {"drift": "needs a time"}}),
            }  # fmt: skip
    for chosen in product(*flags.values()):
        record = {key: value for change in chosen for key, value in change.items()}
        if "row" in record:
            record["next_batch"] = None  # a swim has no next runs
        yield with_flags(verdict, record)
        if verdict in ("none", "partial") and record["held_out_runs_agree"] and "moves" not in record:
            scored = [{**c, "verdict": "not needed"} for c in falling_balls()["candidates"]]
            yield with_flags(verdict, {**record, "noise_known": False, "candidates": scored})
        if verdict == "unexplained" and chosen[0] == {"subject": "robot"}:  # laws are of its runs
            for batch in batches:
                yield with_flags(verdict, {**record, **laws, **batch, "described": "harmless" not in record})


@pytest.mark.parametrize("verdict", ["none", "number", "effect", "ambiguous", "partial", "unexplained"])
def test_every_combination_is_said_in_whole_sentences_with_one_advice(verdict: str) -> None:
    advised = set()
    for record in combinations(verdict):
        advice, steps = record["advice"], next_steps(record)
        advised.add(advice)
        said, errors = sentence(record), errors_in_words(record)
        report = sections({**record, "sentence": said, "next_steps": steps}, {})
        seen = read(report)
        first, *experiments = steps
        assert MODEL_TO_USE.match(first), first
        brief, short = in_brief(record), next_in_short(record)
        title = headline(record)
        assert len(title.split()) <= 25, title
        assert len(brief) <= 4
        assert 1 <= len(badges(record)) <= 5
        assert MODEL_TO_USE.match(short[0]), short
        assert max(len(step.split()) for step in short) <= 20, short
        opened = report.partition("<h2>")[0]
        assert len(f"{title} {TAG.sub(' ', opened)}".split()) <= 90 - OF_THE_LEAD, opened
        for text in (said, errors, *steps, *brief, *short):
            assert not SPOILT.search(text), text
        assert all(text and text.endswith(".") for text in (said, *steps)), steps
        for step in experiments:
            assert not MODEL_TO_USE.match(step), steps
            assert "corrected" not in step, steps
        assert ("plan/plan.json" in " ".join(steps)) <= (advice == "corrected"), steps
        assert ("--robot corrected.toml" in first) == (advice == "corrected" and record["subject"] == "robot")
        bears_out = record["held_out_error_falls"] and record["gain_is_certain"] is not False
        if verdict in ("number", "effect", "ambiguous"):
            no_gain = f"no gain that these {record['row']}s can show"
            assert ("does not fall" in said or no_gain in said) == (not bears_out), said
            assert bears_out or advice != "corrected", steps
        assert not re.search(r"\bNone\b|\bnan\b|Undefined|\.\.", seen), seen
        if record["subject"] == "model":
            for text in (said, errors, *steps, seen):
                assert not OF_A_ROBOT.search(text.replace(DECIDE, "")), text
        if record["row"] == "pose":
            for text in (said, errors, *steps, seen):
                assert not OF_RUNS.search(
                    NAMES_RUNS.sub("", text.replace(MOVE["words"][1:], "").replace(MOVE["where"], ""))
                ), text
        if not record["noise_known"]:
            for text in (said, errors, *steps, seen):
                assert not P_VALUE.search(text), text
                assert f"noise of a {record['row']}" not in text
    assert advised == {"as given", "corrected", "wait"}  # also where a form halves the error on left-out runs


def test_what_the_loop_found_has_its_sections() -> None:
    loop = [{"error": 0.12, "named": "", "left": "speed along depth"}]
    changes = {
        "nearest": NEAREST,
        "forms": FORMS,
        "turns": loop,
        "errors_of_conditions": CONDITIONS,
        **GAINS["certain"],
    }
    record = with_flags("partial", {**changes, "withdrawn": [FORBIDDEN]})
    said, seen = sentence(record), in_report(record)
    assert (
        "Decoy was claimed first and withdrawn: with it the error on held-out runs rises from 12.00 % to 17.00 %"
        in said
    )
    assert "These runs have been looked at 2 times." in said
    assert "falls from 12.00 % to 4.00 % (by 8.00 %, 95 % interval 5.00 to 11.00 %)" in said
    forms = "tell these alternatives apart: wall of the tube at the size of theory, 1 (3.20 %); inertia (3.30 %)."
    assert forms in said
    assert "The loop" in seen
    assert "1 – 12.00 % speed along depth" in seen
    assert "decoy 9.00 % no" in seen
    assert "on conditions that were not fitted (balls 2 and 5): refitted 12.00 %" in errors_in_words(record)
    assert "<td>4.00 %</td>" in sections(record, {})


@pytest.mark.parametrize(
    ("scales", "unit"),
    [
        ({"time": [1.0, "s"]}, " s"),
        ({"time": [1.0, "s"], "lag": [1.0, "s"]}, " s"),
        ({"angle": [1.0, "°"]}, "°"),
        ({"count": [1.0, ""]}, ""),
    ],
)
def test_errors_of_differences_are_in_the_unit_that_they_share(scales: Record, unit: str) -> None:
    loop = [{"error": 0.12, "named": "", "left": ""}]
    changes = {
        "nearest": NEAREST, "forms": FORMS, "turns": loop, "errors_of_conditions": CONDITIONS,
        "withdrawn": [FORBIDDEN], "output_scales": scales, **GAINS["certain"],
    }  # fmt: skip
    record = with_flags("partial", changes)
    said, errors, seen = sentence(record), errors_in_words(record), in_report(record)
    assert f"falls from 0.12{unit} to 0.04{unit} (by 0.08{unit}, 95 % interval 0.05 to 0.11{unit})" in said
    assert not re.search(r"\b(12|4)\.00 %", seen)
    assert f"model unchanged 0.2{unit}, refitted 0.12{unit}, refitted with {NEAREST['title']} 0.04{unit}" in errors
    for text in (said, errors, *next_steps({**record, "advice": "as given"})):
        assert not re.search(r"\b\d+\.\d+ %", text), text


def test_errors_of_ratios_and_slip_angles_are_in_per_cent() -> None:
    """As a robot's: the slip angle is shown in degrees, and compared in radians."""
    record = with_flags("none", {"output_scales": {"speed": [100.0, "%"], "theta": [57.3, "°"]}})
    assert "model unchanged 20.00 %, refitted 12.00 %" in errors_in_words(record)


@pytest.mark.parametrize("unit", ["rad", "deg", "m", ""])
def test_errors_of_ratios_and_differences_are_each_in_its_unit(unit: str) -> None:
    by_output = {name: {"speed": 0.05, "angle": 0.3} for name in ("uncalibrated", "before", "after")}
    changes = {
        "output_scales": {"speed": [100.0, "%"], "angle": [1.0, unit]},
        "errors_by_output": by_output, "scatter_of_a_run": {"speed": 0.02, "angle": 0.1},
    }  # fmt: skip
    claimed = with_flags("partial", {**changes, "nearest": NEAREST, **GAINS["certain"]})
    falls_to = f"falls from speed 5.0 % and angle 0.3 {unit}".rstrip()
    assert falls_to in sentence(claimed)
    assert "(95 % interval without zero)" in sentence(claimed)
    errors = errors_in_words(with_flags("none", changes))
    assert f"refitted speed 5.0 % and angle 0.3 {unit}".rstrip() in errors
    assert f"noise of a run speed 2.0 % and angle 0.1 {unit}".rstrip() in errors
