"""The public face: every name is there, documented, with an example that runs; importing is light."""

from __future__ import annotations

import doctest
import subprocess
import sys
from importlib import import_module
from inspect import isfunction

import pytest

import softflagella as sf
from sim.io.keywords import keywords_of
from tests.processes import LIMIT

NAMES = [name for name in sf.__all__ if not name.startswith("_")]


@pytest.mark.parametrize("name", sf.__all__)
def test_every_name_is_what_its_module_has(name: str) -> None:
    module, attribute = sf._HOMES[name]
    assert getattr(sf, name) is getattr(import_module(module), attribute)
    assert name in dir(sf)


def test_nothing_else_is_listed() -> None:
    assert dir(sf) == sf.__all__


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


def test_an_old_keyword_works_with_a_warning() -> None:
    with pytest.warns(DeprecationWarning, match="query\\(table=…\\) is deprecated; use lookup=…"):
        old = sf.query("paper-control", table=None)  # type: ignore[call-arg]
    assert old.equals(sf.query("paper-control"))


def test_the_stub_lists_each_name_once() -> None:
    assert len(sf.__all__) == len(set(sf.__all__)) > 30
    assert {"plan", "effects", "__version__", "Robot"} <= set(sf.__all__)


@pytest.mark.parametrize(("old", "new"), [("Voyage", "GoalPlan"), ("switch_response", "response")])
def test_old_names_work_with_a_warning(old: str, new: str) -> None:
    with pytest.warns(DeprecationWarning, match=f"{old} is deprecated; use softflagella.{new}"):
        assert callable(getattr(sf, old))
    assert old not in sf.__all__


def test_an_old_name_is_the_new_thing() -> None:
    with pytest.warns(DeprecationWarning, match="use softflagella.GoalPlan"):
        assert sf.Voyage is sf.GoalPlan


@pytest.mark.parametrize("name", NAMES)
def test_every_name_has_an_example_that_runs(name: str) -> None:
    thing = getattr(sf, name)
    examples = doctest.DocTestFinder(recurse=False).find(thing, name)
    assert examples[0].examples, f"{name} has no example"
    results = [doctest.DocTestRunner(optionflags=doctest.NORMALIZE_WHITESPACE).run(test) for test in examples]
    assert sum(result.failed for result in results) == 0


def test_a_name_that_is_not_there() -> None:
    with pytest.raises(AttributeError, match="no attribute 'swims'"):
        sf.swims  # noqa: B018


def test_importing_the_package_loads_nothing_heavy() -> None:
    heavy = ("numpy", "torch", "numba", "pandas", "matplotlib", "scipy", "pyarrow", "sim")
    code = f"import sys, softflagella; print([name for name in {heavy!r} if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=LIMIT)
    assert done.stdout.strip() == "[]"
