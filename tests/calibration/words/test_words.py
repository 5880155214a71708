"""What a verdict says: templates over a stored verdict.json, in every branch."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from html import unescape
from typing import Any

import pytest
from jinja2 import UndefinedError

from calibration.findings.next_runs import SELDOM
from calibration.report.report import sections
from calibration.words.render import headline, next_steps, say_laws, sentence
from tests.calibration.toy_tables import ambiguous, effect, none, number

VERDICTS = {"none": none, "number": number, "effect": effect, "ambiguous": ambiguous}


def stored(name: str, **changes: Any) -> dict[str, Any]:
    """Return the content of a verdict.json, with some of its entries changed."""
    record: dict[str, Any] = json.loads(json.dumps(VERDICTS[name]().to_dict()))
    assert not changes.keys() - record.keys()
    return record | changes


@pytest.mark.parametrize("name", VERDICTS)
def test_a_stored_verdict_says_again_what_it_said(name: str) -> None:
    record = stored(name)
    assert (record["verdict"], record["sentence"]) == (name, VERDICTS[name]().sentence)
    assert sentence(record) == record["sentence"]
    assert next_steps(record) == record["next_steps"] != []


NEAREST = {
    "unit": "1",
    "shown": 1.0,
    "title": "a wall",
    "removed_share": 0.999,
    "reason": "its interval includes the null",
}
HEAD = {"title": "L (head length)", "departure": "9 % above what was given", "tolerances": 9.4}
UNEXPLAINED = {"verdict": "unexplained", "p_value": 0.001, "held_out_error_falls": None}
SPREAD = {
    "effect": "wall", "title": "a wall", "unit": "1", "shown": 1.0, "mean": 2.0, "interval": [1.0, 3.0],
    "sizes": {"A": [1.5, 1.0, 2.0], "B": [9.0, 8.0, 10.0]}, "removed_share": 0.999, "remainder": 0.0,
    "sizes_of": "specimens", "largest_along": "", "as_well": ["drag", "a current"], "at_theory": False,
}  # fmt: skip
PARTIAL = {"verdict": "partial", "nearest": SPREAD, "held_out_error_falls": True}


BORNE_OUT = {"held_out_error_falls": True, "gain_is_certain": True, "held_out_runs_agree": True}
RISEN = {"held_out_error_falls": False, "error_before": 0.03, "error_after": 0.031}


@pytest.mark.parametrize(
    ("name", "changes", "said"),
    [
        ("effect", {}, "Missing: "),
        ("effect", RISEN, "Not confirmed: "),
        ("effect", {"gain_is_certain": False}, "Not confirmed: "),
        ("effect", {"held_out_runs_agree": False}, "Not confirmed: "),
        ("ambiguous", BORNE_OUT, " explains these runs."),
        ("ambiguous", RISEN, " may explain these runs."),
        ("none", {"noise_known": False}, "The noise is unknown, so no effect can be judged."),
    ],
)
def test_a_headline_does_not_call_missing_what_held_out_runs_do_not_bear_out(
    name: str, changes: dict[str, Any], said: str
) -> None:
    assert said in headline(stored(name, **changes))


@pytest.mark.parametrize(
    ("name", "changes", "said"),
    [
        ("number", RISEN, "does not fall with it (3.00 % without, 3.10 % with it). No effect is claimed."),
        ("effect", RISEN, "of the catalogue, but the error on the held-out runs does not fall with it (3.00 %"),
        ("none", UNEXPLAINED, "There is a residual (p ≤ 0.001 under the model, with noise as estimated) that no"),
        ("none", UNEXPLAINED | {"not_tried": ["a wall"]}, "is provisional: the search ended early. There"),
        ("none", UNEXPLAINED | {"not_tried": ["a wall"]}, "no pair of effects that was tried explains"),
        ("effect", {"not_tried": ["a wall"]}, "and with no other effect that was tried."),
        ("none", UNEXPLAINED | {"nearest_candidate": NEAREST}, "; the nearest, a wall, removes nearly all of it,"),
        ("none", UNEXPLAINED | {"largest_along": "omega_h along N"}, ". Most of it is in head spin along N."),
        ("none", PARTIAL | {"held_out_error_falls": False}, "not fitted to, but the error on the held-out"),
        ("none", UNEXPLAINED | {"harmless": True}, ". It is smaller than the noise of a run, and harmless for"),
        ("none", {"held_out_runs_agree": False, "locked_p_value": 5e-4}, "The held-out runs (N=4) do not"),
        ("none", {"notable_number": "E is 9 % off"}, "E is 9 % off. No effect is missing"),
        ("number", {"claims_instead": ["a", "b"]}, "If the number is right, a or b would fit as well."),
        ("effect", {"in_form_only": ["end_over_end_drag"]}, "is consistent with something in form like head's"),
        ("effect", {"imitable": True}, "or something outside the catalogue that looks like it, and with no other"),
        ("ambiguous", {"imitable": True}, ", or something outside the catalogue that looks like them: these runs"),
        ("ambiguous", {"rival_numbers": [HEAD]}, ", or with L (head length) that is 9 % above what was given (9"),
        ("none", PARTIAL, "differs between specimens: 2 (1 to 3) at the mean, from 1.5"),
        ("none", PARTIAL, "It leaves nothing beyond the noise. Others would fit as well: drag, a current."),
    ],
)  # fmt: skip
def test_every_branch_of_the_sentence(name: str, changes: dict[str, Any], said: str) -> None:
    assert said in sentence(stored(name, **changes))


@pytest.mark.parametrize(
    ("name", "changes", "said"),
    [
        ("number", RISEN | {"advice": "wait"}, "Plan with neither robot yet, as given or corrected: the"),
        ("number", RISEN, "Measure again: scale of the camera. Correct it in the"),
        ("effect", {"advice": "as given"}, "Plan with the robot as given: the corrected one does not"),
        ("none", {"held_out_runs_agree": False}, "Find out what is different about the held-out runs (N=4)"),
        ("none", {"moves": [{"where": "on day 2"}]}, "Find out what changed on day 2: look at the set-up"),
        ("ambiguous", {"rival_numbers": [HEAD]}, "Measure L (head length) again, to rule out"),
        ("effect", {"in_form_only": ["drag"]}, "It has the effect, as a description of the runs: its size"),
        ("none", PARTIAL | {"held_out_error_falls": False}, "It is without a wall, which does not"),
        ("none", PARTIAL, "Find out what differs between"),
        ("none", UNEXPLAINED | {"largest_along": "theta along (ln l)²"}, "slip angle along (ln l)², so"),
        ("none", UNEXPLAINED | {"largest_along": "v along time"}, "so check first the camera: its scale"),
        ("none", UNEXPLAINED | {"largest_along": "v along course_x"}, "first whether the tank has a current"),
        ("none", UNEXPLAINED | {"largest_departures": [{"at": ["N = 2", "l = 5 cm"]}]}, "): N = 2, l = 5 cm."),
        ("none", UNEXPLAINED | {"untestable": {"drift": "needs elapsed_min"}}, "Note more in the table, so"),
        ("none", UNEXPLAINED | {"described": True}, "Look for a cause where the law acts (below), and"),
        ("none", UNEXPLAINED, "so it serves only where a residual of this size does not matter."),
    ],
)  # fmt: skip
def test_every_branch_of_the_next_steps(name: str, changes: dict[str, Any], said: str) -> None:
    assert any(said in step for step in next_steps(stored(name, **changes)))


def in_report(record: dict[str, Any]) -> str:
    """What a reader sees of the sections of a report."""
    return read(sections(record, {}))


def read(markup: str) -> str:
    """What a reader sees of HTML."""
    return " ".join(unescape(re.sub("<[^>]*>", " ", markup)).split())


def test_rivals_are_told_apart_by_runs_that_are_worth_making_and_a_command() -> None:
    batch, (run, *_) = (stored("ambiguous")[key] for key in ("next_batch", "next_runs"))

    def proposing(batch_decides: float, *runs_decide: float) -> dict[str, Any]:
        """A verdict with a batch and single runs that decide in these shares of cases."""
        return stored(
            "ambiguous",
            next_batch=batch | {"decides": batch_decides, "worth_making": batch_decides >= SELDOM},
            next_runs=[run | {"decides": share, "worth_making": share >= SELDOM} for share in runs_decide],
        )

    often, seldom = proposing(0.95, 0.93, 0.14), proposing(0.14, 0.14)
    (place,) = (i for i, step in enumerate(next_steps(often)) if step.startswith("Make the 8 runs listed under"))
    assert "`softflagella calibration decide " in next_steps(often)[place + 1]
    assert next_steps(seldom)[place].startswith("Make more runs")
    assert next_steps(seldom)[place + 1].startswith(
        "More runs with these settings hardly tell the explanations apart"
    )
    assert "decide in 14 % of cases only" in next_steps(seldom)[place + 1]
    assert "Runs to make next" not in in_report(seldom)
    assert "Single settings" not in in_report(seldom)
    seen = in_report(often)
    assert "Runs to make next: N l [cm]" in seen
    assert "93 %" in seen
    assert " 14 %" not in seen.partition("Error on the held-out runs")[0]
    assert "`" not in seen


@pytest.mark.parametrize(
    ("robot", "path_decides", "decides", "said"),
    [
        ("as given", 0.7, 0.7,
         "Let the robot swim circle:2l, as this command plans: `softflagella plan circle:2l`."),
        ("tails.count=3", 0.02, 0.9, "the best one, circle:2l, decides in 2 % of cases. Let another robot, with "
         "`tails.count=3`, swim square:2l, as this command plans: `softflagella plan square:2l`."),
        ("tails.count=3", 0.6, 0.9, "Let another robot, with `tails.count=3`, swim"),
        ("tails.count=3", 0.02, 0.1, "Do not let the robot swim again"),
    ],
    ids=["a path", "no path", "a path, but less often", "nothing"],
)  # fmt: skip
def test_the_swim_that_decides_is_named_with_its_command(
    robot: str, path_decides: float, decides: float, said: str
) -> None:
    circle = {"path": "circle:2l", "robot": "as given", "minutes": 21.2, "plan": "softflagella plan circle:2l"}
    square = {"path": "square:2l", "robot": robot, "minutes": 19.9, "plan": "softflagella plan square:2l"}
    shares = [(square, decides), (circle, path_decides)]
    best, *_ = listed = [circle] if robot == "as given" else [square, circle]
    record = stored(
        "ambiguous",
        next_batch={"runs": [best], "decides": decides, "separation": 9.0, "worth_making": decides >= SELDOM},
        next_runs=[
            {**swim, "repeats": 1, "separation": 9.0, "decides": share, "worth_making": share >= SELDOM}
            for swim, share in shares if swim in listed
        ],
    )  # fmt: skip
    steps = next_steps(record)
    (place,) = (i for i, step in enumerate(steps) if said in step)
    assert ("No path tried" in steps[place]) == (robot != "as given" and path_decides < SELDOM <= decides)
    assert ("softflagella calibration decide TRACK" in " ".join(steps)) == (decides >= SELDOM)
    seen = in_report(record)
    assert "path robot minutes plan decides" in seen
    assert f"circle:2l as given 21.2 softflagella plan circle:2l {path_decides:.0%}".replace("%", " %") in seen
    assert "runs listed under" not in " ".join(steps)


def test_a_pull_that_is_not_taken_to_be_wrong_has_its_reason() -> None:
    """And a report without a claim compares no model with itself."""
    first, *others = stored("none")["numbers_as_given"]
    pulled = [first | {"pull": 19.0, "wrong": True, "learnt": True}, *others]
    reason = f"pull beyond 3: {first['title']}. Nothing explains the residual, so this is no"
    for wrong, words in (([], reason), ([[first]], f"The runs ask for another value of {first['title']}.")):
        seen = in_report(stored("none", numbers_as_given=pulled, wrong_number_records=wrong))
        assert "+19.0 (beyond 3)" in seen
        assert words in seen
        assert "The runs ask for no other value" not in seen
        assert seen.count("(beyond 3)") == 1
    assert "On a path" not in seen
    assert "with the verdict's effects" not in seen


def test_what_users_write_is_text_in_the_report() -> None:
    seen = sections(stored("none", locked_test="<b>day</b> & night", limits=["a <i>"]), {})
    assert "&lt;b&gt;day&lt;/b&gt; &amp; night" in seen
    assert "a &lt;i&gt;." in seen


def laws_of_five_places() -> dict[str, Any]:
    """A record of laws at five places."""
    plain = {"undetermined": False, "reason": "", "curves": [], "p_value": 0.3}
    return {
        "complete": True, "significant": True, "search_p_value": 0.001, "tables_without_law": 999, "curved": None,
        "in_common": "act on the head", "kept": list("abcde"), "as_good": None, "in_common_of_as_good": "",
        "laws": [{"place": place, "words": f"law {place}", "acts": place, **plain} for place in "abcde"],
    }  # fmt: skip


def test_of_many_laws_the_best_two_are_named_and_the_others_counted() -> None:
    laws = laws_of_five_places()
    said = say_laws(laws)
    named = "The residual is described by law a; or law b; or laws at 3 other places: these runs cannot"
    assert said.startswith(named)
    assert said.endswith("(with the choice among all places counted, p ≤ 0.001). All of them act on the head.")
    beside = say_laws(laws | {"as_good": list("abc")})
    assert beside == "It is described as well by law a; or by law b; or by laws at 1 other place."
    judged = laws["laws"][0] | {"gain": 9.0, "error": 0.02, "first": None, "leaves_noise": True}
    fitted = laws | {"sentence": said, "laws": 15 * [judged]}
    assert "3 others, with smaller gains, are in verdict.json." in in_report(stored("none", laws=fitted))


def test_the_settings_to_repeat_are_those_of_the_largest_departures() -> None:
    result = none()
    runs, used = result.runs, result.split.fitted
    off = used & (runs.condition == runs.condition[used][0])
    moved = replace(result, runs=replace(runs, y=runs.y + 0.5 * off[:, None]))
    first, *others = moved.facts["largest_departures"]
    assert first["at"] == [f"{name} = {v[off][0]:.4g}{unit}" for name, (v, unit) in runs.settings.items()]
    assert first["departure"] > 5 * others[0]["departure"]
    assert len(others) == 4


def test_an_entry_that_is_missing_is_no_empty_text() -> None:
    record = stored("none")
    del record["p_value"]
    with pytest.raises(UndefinedError, match="p_value"):
        sentence(record)


def test_what_all_explanations_share_is_told_from_what_is_undecided() -> None:
    record = stored("ambiguous")
    name = next(iter(record["parameters"]))
    said = sentence({**record, "certain": [name], "undecided": ["tail sag", "inertia", ""]})
    size = record["parameters"][name]
    assert f"consistent with {size['title']} ({name}), size" in said
    assert (
        "which is certain among these explanations; undecided is tail sag or inertia or neither beside it" in said
    )


def test_an_effect_without_a_fit_is_named_with_the_reason() -> None:
    said = sentence(
        {**stored("effect"), "not_fitted": [{"title": "inertia", "reason": "its fit did not converge"}]}
    )
    assert "Nothing is concluded about inertia (its fit did not converge)." in said
