"""Texts that make a pattern work hardest: each repetition within it many times, after what leads to it.

As a program it feeds the patterns of modules with them, and prints those whose time grows faster than the length
of a text: python -m tests.patterns MODULE …
"""

from __future__ import annotations

import ast
import inspect
import re
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from importlib import import_module
from re import _constants as codes  # type: ignore[attr-defined]
from re import _parser as parser  # type: ignore[attr-defined]
from types import ModuleType
from typing import Any

SIZES = (30, 1000, 10_000, 100_000)  # characters
STEEP = 40.0  # growth of the time, from a size to the next, that is too much
IDLE = 0.005  # s that count as no time
ENDS = ("", "!", "a", "1", "\n", ",")
_SIGNS = "a1 \n!#;"  # of which some are in any class
_REPEATS = (codes.MAX_REPEAT, codes.MIN_REPEAT)
_OF_CATEGORY = {
    codes.CATEGORY_DIGIT: "1", codes.CATEGORY_SPACE: " ", codes.CATEGORY_WORD: "a",
    codes.CATEGORY_NOT_DIGIT: "a", codes.CATEGORY_NOT_SPACE: "a", codes.CATEGORY_NOT_WORD: "!",
}  # fmt: skip
_ANCHORED = {"match", "fullmatch"}
Text = tuple[str, str, str]  # what leads to the repetition, what is repeated, what follows


def texts(pattern: str, flags: int = 0) -> list[Text]:
    """List texts for a pattern: each repetition after its lead, without it, and both repeated together."""
    pumps = dict.fromkeys(_pumps(parser.parse(pattern, flags)))
    forms = [form for lead, unit in pumps for form in ((lead, unit), ("", unit), ("", lead + unit))]
    return [(*form, end) for form in dict.fromkeys(forms) for end in ENDS]


def _pumps(tree: Any) -> Iterator[tuple[str, str]]:
    """Yield the repetitions within a pattern: what leads to each, and what is repeated."""
    lead = ""
    for code, given in tree:
        for inner in _inside(code, given):
            yield from ((lead + before, unit) for before, unit in _pumps(inner))
        if code in _REPEATS and given[1] > 9:
            yield from ((lead, unit) for unit in _samples(given[2]) if unit)
        lead += _sample(code, given)


def _inside(code: Any, given: Any) -> list[Any]:
    """List the patterns within a part of a pattern."""
    if code in _REPEATS:
        return [given[2]]
    if code is codes.BRANCH:
        return list(given[1])
    return [given[3]] if code is codes.SUBPATTERN else []


def _samples(tree: Any) -> list[str]:
    """List texts that a pattern matches: one for each choice that it begins with."""
    [(code, given), *others] = tree
    rest = "".join(_sample(*part) for part in others)
    if code is codes.BRANCH:
        return ["".join(_sample(*part) for part in branch) + rest for branch in given[1]]
    if code is codes.SUBPATTERN:
        return [text + rest for text in _samples(given[3])]
    return [sign + rest for sign in _signs(given)] if code is codes.IN else [_sample(code, given) + rest]


def _sample(code: Any, given: Any) -> str:
    """Return a text that a part of a pattern matches."""
    if code is codes.LITERAL:
        return chr(given)
    if code is codes.IN:
        return _signs(given)[0]
    if code in (codes.ANY, codes.NOT_LITERAL):
        return "a"
    inner = _inside(code, given)
    times = max(given[0], min(1, given[1])) if code in _REPEATS else 1
    return times * "".join(_sample(*part) for part in inner[0]) if inner else ""


def _signs(members: Any) -> list[str]:
    """List signs that a class in brackets has."""
    if members[0][0] is codes.NEGATE:
        others = [part for part in members[1:] if part[0] is codes.RANGE]
        named = {sign for part in members[1:] for sign in _signs([part])}
        within = {sign for sign in _SIGNS for _, (low, high) in others if low <= ord(sign) <= high}
        return [sign for sign in _SIGNS if sign not in named | within]
    signs = (
        _OF_CATEGORY[given] if code is codes.CATEGORY else chr(given[0] if code is codes.RANGE else given)
        for code, given in members
    )
    return list(dict.fromkeys(signs))


def slow(work: Callable[[str], object], text: Text) -> bool:
    """Say whether the time of some work grows faster than the length of its text."""
    lead, unit, end = text
    before = IDLE
    for size in SIZES:
        words = lead + unit * (size // len(unit)) + end
        least = _seconds(work, words)
        for _ in range(2):
            least = min(least, _seconds(work, words)) if least > STEEP * before else least
        if least > STEEP * before:
            return True
        before = max(least, IDLE)
    return False


def _seconds(work: Callable[[str], object], words: str) -> float:
    began = time.process_time()
    work(words)
    return time.process_time() - began


def patterns_of(module: ModuleType) -> Iterator[tuple[str, re.Pattern[str], bool]]:
    """Yield the patterns of a module: a name, the pattern, and whether it is used at the start of texts only."""
    used: dict[str, set[str]] = {}
    for node in ast.walk(ast.parse(inspect.getsource(module))):
        called = ast.unparse(node.func) if isinstance(node, ast.Call) else ""
        if isinstance(node, ast.Call) and re.fullmatch(r"re\.(sub|split|\w*match|search|find\w+)", called):
            given = [word for word in [*node.args[1:], *(each.value for each in node.keywords)]]
            flags = [ast.unparse(word) for word in given if ast.unparse(word).startswith("re.")]
            for pattern in _written(module, ast.unparse(node.args[0]), *flags):
                yield pattern.pattern, pattern, called.removeprefix("re.") in _ANCHORED
        elif isinstance(node, ast.Attribute) and hasattr(re.Pattern, node.attr):
            used.setdefault(ast.unparse(node.value).partition("[")[0], set()).add(node.attr)
    for name, value in vars(module).items():
        for pattern in _compiled(value):
            yield name, pattern, bool(used.get(name)) and used[name] <= _ANCHORED


def _written(module: ModuleType, words: str, flags: str = "0") -> list[re.Pattern[str]]:
    """Compile what is written where a pattern is used; local names stand for a table of patterns."""
    local = {
        "start": lambda: [start for _, start in module.KINDS.values()],
        "program.begins": lambda: [program.begins for program in module.PROGRAMS.values()],
    }
    names = vars(module) | {"units": "s|ms|min|h"}
    patterns = local[words]() if words in local else [eval(words, names)]
    return [re.compile(pattern, eval(flags, names)) for pattern in patterns]


def _compiled(value: Any) -> Iterator[re.Pattern[str]]:
    if isinstance(value, re.Pattern):
        yield value
    elif isinstance(value, Mapping):
        for part in value.values():
            yield from _compiled(part)


def main(modules: list[str]) -> None:
    """Feed the patterns of some modules."""
    for module in modules:
        for name, pattern, anchored in patterns_of(import_module(module)):
            works = [pattern.match, pattern.fullmatch] if anchored else [lambda words, p=pattern: p.sub("", words)]
            found = (text for text in texts(pattern.pattern, pattern.flags) for work in works if slow(work, text))
            for text in [*found][:1]:
                print(f"{module} {name} {text}", flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
