"""Arguments of public functions: a wrong keyword is refused with a proposal, a wrong type with the right ones."""

from __future__ import annotations

import difflib
from collections.abc import Callable
from functools import wraps
from inspect import Parameter, signature, unwrap
from typing import Any, ParamSpec, TypeVar

from common.errors import InputError

P = ParamSpec("P")
R = TypeVar("R")


def checks_keywords(function: Callable[P, R]) -> Callable[P, R]:
    """Make a function refuse keywords that it does not have with an `InputError` that proposes the nearest."""
    known = keywords_of(function)

    @wraps(function)
    def checked(*arguments: P.args, **given: P.kwargs) -> R:
        for name in given:
            if name not in known:
                near = difflib.get_close_matches(name, known, 1)
                proposal = f"is it {near[0]}?" if near else f"there are {', '.join(known)}"
                raise InputError(f"{function.__name__} has no keyword {name!r}; {proposal}")
        return function(*arguments, **given)

    return checked


def checks_types(function: Callable[P, R]) -> Callable[P, R]:
    """Make a function refuse arguments of other classes than it names, `A | pkg.B`, and unknown keywords.

    Annotations are compared as names, so that the classes are not imported.
    """
    takes = signature(function)
    kinds = {
        p.name: [word.rpartition(".")[2] for word in str(p.annotation).split(" | ")]
        for p in takes.parameters.values()
    }

    @checks_keywords
    @wraps(function)
    def checked(*arguments: P.args, **given: P.kwargs) -> R:
        for name, value in takes.bind(*arguments, **given).arguments.items():
            classes = {each.__name__ for each in type(value).__mro__} | ({"None"} if value is None else set())
            if classes.isdisjoint(kinds[name]):
                wanted = " or ".join(kinds[name])
                raise InputError(f"{function.__name__}: {name} is of type {type(value).__name__}; give {wanted}")
        return function(*arguments, **given)

    return checked


def keywords_of(function: Callable[..., Any]) -> list[str]:
    """List the keywords of a function, those of `**options: Unpack[Options]` among them."""
    function, known = unwrap(function), list[str]()
    for parameter in signature(function).parameters.values():
        if parameter.kind is Parameter.VAR_KEYWORD:
            options = str(parameter.annotation).removeprefix("Unpack[").removesuffix("]")
            known += function.__globals__[options].__annotations__
        elif parameter.kind in (Parameter.POSITIONAL_OR_KEYWORD, Parameter.KEYWORD_ONLY):
            known.append(parameter.name)
    return known
