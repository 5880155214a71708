"""Content, columns and warnings of a plan are Python's, letter by letter, if its numbers are."""

from __future__ import annotations

import json
from dataclasses import replace

import pytest

from tests.planner.page.page_core import answers
from tests.planner.page.plans import plan_to_page, planned


@pytest.mark.parametrize(
    ("name", "objective"), [("circle", "flips"), ("line", "error"), ("square", "flips"), ("bend", "time")]
)
def test_content_and_columns(name: str, objective: str) -> None:
    result = planned(name, objective=objective)
    page = plan_to_page(result)
    record, bare, columns, seconds, duration = answers(
        [
            ("planned.js", "planRecord", page, "0.1+ü"),
            ("planned.js", "planRecord", page),
            ("planned.js", "planColumns", page),
            ("planned.js", "planSeconds", page),
            ("planned.js", "planDuration", page),
        ]
    )
    content = result.to_dict()
    assert record["id"] == bare["id"] == content["id"]
    assert record["text"] == json.dumps({**content, "code_version": "0.1+ü"})
    assert bare["text"] == json.dumps(content)
    wanted = {key: values.tolist() for key, values in result.columns().items()}
    assert {key: list(values) for key, values in columns.items()} == wanted
    assert seconds == result.seconds.tolist()
    assert duration == result.duration


def test_warnings() -> None:
    result = planned("circle", objective="flips")
    tight = replace(result.tracked.vehicle, tail_gap=0.7)
    cases = [
        result,
        replace(result, errors=replace(result.errors, stated=9.0)),
        replace(result, errors=replace(result.errors, distance=9 * result.errors.distance + 1)),
        replace(result, tracked=result.tracked._replace(vehicle=tight)),
        replace(result, declared=replace(result.declared, warnings=("the shape is lost in part: …",))),
    ]
    found = answers([("planned.js", "planWarnings", plan_to_page(case)) for case in cases])
    assert found == [list(case.warnings) for case in cases]
    assert sum(map(len, found)) == 4
