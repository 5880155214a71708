"""The public face: every name is there, documented, with an example that runs."""

from __future__ import annotations

import doctest
from importlib import import_module
from inspect import isfunction

import pytest

import softflagella as sf
from sim.io.keywords import keywords_of

LONG = {"FleetPlan", "Orbit", "Swim", "TrackingError", "Trip", "hold", "load_goal", "tabulate"}
NAMES = [name for name in sf.__all__ if not name.startswith("_")]


def test_every_name_is_what_its_module_has_and_is_listed_once() -> None:
    for name in sf.__all__:
        module, attribute = sf._HOMES[name]
        assert getattr(sf, name) is getattr(import_module(module), attribute)
    assert dir(sf) == sf.__all__
    assert len(sf.__all__) == len(set(sf.__all__)) > 30
    assert {"plan", "effects", "__version__", "Robot"} <= set(sf.__all__)
    with pytest.raises(AttributeError, match="no attribute 'swims'"):
        sf.swims  # noqa: B018


@pytest.mark.slow
def test_a_wrong_keyword_is_refused_with_a_proposal() -> None:
    functions = [thing for name in NAMES if isfunction(thing := getattr(sf, name))]
    assert len(functions) > 30
    for function in functions:
        *_, known = keywords_of(function)
        with pytest.raises(
            sf.InputError, match=rf"{function.__name__} has no keyword '{known}x'; is it {known}\?"
        ):
            function(**{f"{known}x": 1})
    with pytest.raises(sf.InputError, match="plan has no keyword 'colour'; there are path, robot, "):
        sf.plan(sf.circle(2.0), "paper-control", colour="red")  # type: ignore[call-arg]


@pytest.mark.parametrize("name", [pytest.param(n, marks=pytest.mark.rest) if n in LONG else n for n in NAMES])
def test_every_name_has_an_example_that_runs(name: str) -> None:
    thing = getattr(sf, name)
    examples = doctest.DocTestFinder(recurse=False).find(thing, name)
    assert examples[0].examples, f"{name} has no example"
    results = [doctest.DocTestRunner(optionflags=doctest.NORMALIZE_WHITESPACE).run(test) for test in examples]
    assert sum(result.failed for result in results) == 0
