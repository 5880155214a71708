"""Style sheets of drawings: rules for kinds of elements, classes and ids; which of them hold for an element."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping
from dataclasses import dataclass

from sim.io.errors import InputError

_COMMENT = re.compile(r"/\*.*?\*/|<!--|-->", re.DOTALL)
_NO_RULE = re.compile(r"@(?:charset|namespace)[^;{}]*;|@font-face\s*\{[^{}]*\}", re.IGNORECASE)
_RULE = re.compile(r"([^{}]*)\{([^{}]*)\}")
_SELECTOR = re.compile(r"(\*|[\w-]*)((?:[.#][\w-]+)*)")
_IMPORTANT = re.compile(r"\s*!\s*important$", re.IGNORECASE)


@dataclass(frozen=True)
class Rule:
    """Declarations for elements of a kind, with classes and ids."""

    kind: str  # empty or *: any
    names: tuple[str, ...]  # .class and #id
    declared: dict[str, str]

    @property
    def weight(self) -> tuple[int, int, bool]:
        """What decides between rules: ids, classes, kind."""
        ids = sum(name.startswith("#") for name in self.names)
        return ids, len(self.names) - ids, self.kind not in ("", "*")


def read_style_sheet(text: str, known: Collection[str]) -> list[Rule]:
    """Read the rules that declare one of the `known` properties, the weakest first.

    Raises:
        InputError: such a rule has a selector of another kind, or is marked as important.
    """
    text = _NO_RULE.sub("", _COMMENT.sub("", text))
    rest = _RULE.sub("", text).strip()
    if rest:
        raise InputError(f"<style> is not read from {rest[:30]!r} on; write attributes instead")
    rules = []
    for selectors, body in _RULE.findall(text):
        given = {name: value for name, value in declarations(body).items() if name in known}
        for selector in map(str.strip, selectors.split(",")):
            found = _SELECTOR.fullmatch(selector)
            if given and (found is None or _IMPORTANT.search(body.strip().rstrip(";"))):
                raise InputError(
                    f"<style> sets {', '.join(given)} of {selector!r}; read are kinds, classes and ids, "
                    "without !important; write attributes instead"
                )
            if given and found:
                rules.append(Rule(found[1], tuple(re.findall(r"[.#][\w-]+", found[2])), given))
    return sorted(rules, key=lambda rule: rule.weight)


def declared(rules: list[Rule], kind: str, attributes: Mapping[str, str]) -> dict[str, str]:
    """Return what rules declare for an element."""
    names = {f".{name}" for name in attributes.get("class", "").split()} | {f"#{attributes.get('id')}"}
    found: dict[str, str] = {}
    for rule in rules:
        if rule.kind in ("", "*", kind) and names.issuperset(rule.names):
            found |= rule.declared
    return found


def declarations(text: str) -> dict[str, str]:
    """Read the declarations of a rule, or of the attribute style."""
    parts = (part.partition(":") for part in _COMMENT.sub("", text).split(";"))
    return {name.strip().lower(): _IMPORTANT.sub("", value.strip()) for name, colon, value in parts if colon}
