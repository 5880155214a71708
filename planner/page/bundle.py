"""Join the page's modules into one classic script.

A worker made from a text cannot load modules, and a page from a folder cannot either. So the modules are joined:
each becomes a function with a scope of its own, in an order in which every module comes after those that it
imports. Modules keep to a form that makes this simple: `import {…} from "./file.js";` and `export {…};` stand on
lines of their own.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import NamedTuple

from planner.page.constants import constants_module

FOLDER = Path(__file__).parent
_NAMES = r"\{ (\w+(?:, \w+)*) \}"
_IMPORT = re.compile(rf'^import {_NAMES} from "(\.\.?/[\w./]+\.js)";$', re.MULTILINE)
_EXPORT = re.compile(rf"^export {_NAMES};$", re.MULTILINE)
_LEFT_OUT = re.compile(r"^[ ]*/\*.*?\*/[ ]*\n|^[ ]+", re.MULTILINE | re.DOTALL)  # comments and indents
_OTHER = re.compile(r"^\s*(?:import|export)\b.*$", re.MULTILINE)


class Module(NamedTuple):
    """A file of JavaScript."""

    imports: tuple[tuple[str, str], ...]  # names, and the file they come from, relative to FOLDER
    exports: str
    body: str


def read_module(path: Path) -> Module:
    """Read a module and take its imports, exports, comments and indents off.

    Raises:
        ValueError: an import or an export is not in the form that can be joined.
    """
    text = constants_module() if path.name == "constants.js" else path.read_text()
    imports = tuple(
        (names, str((path.parent / source).resolve().relative_to(FOLDER)))
        for names, source in _IMPORT.findall(text)
    )
    exports = _EXPORT.findall(text)
    body = _LEFT_OUT.sub("", _EXPORT.sub("", _IMPORT.sub("", text)))
    other = _OTHER.search(body)
    if other:
        line = other.group().strip()
        raise ValueError(f"{path.name}: {line!r} cannot be joined; write import {{…}} or export {{…}} on one line")
    return Module(imports, ", ".join(names.strip() for names in exports), body.strip())


def joined(*entries: str) -> str:
    """Join modules, given by their files relative to FOLDER, with all that they import, into one script."""
    order: dict[str, Module] = {}

    def add(name: str, above: tuple[str, ...]) -> None:
        if name in above:
            raise ValueError(f"{name} imports itself by {' → '.join(above)}")
        if name in order:
            return
        module = read_module(FOLDER / name)
        for _, source in module.imports:
            add(source, (*above, name))
        order[name] = module

    for entry in entries:
        add(entry, ())
    parts = [_function(name, module) for name, module in order.items()]
    return '"use strict";\n(() => {\n' + "\n".join(parts) + "\n})();\n"


def _function(name: str, module: Module) -> str:
    """Write a module as a constant that holds what it exports."""
    takes = "\n".join(f"const {{{names.strip()}}} = {_constant(source)};" for names, source in module.imports)
    return f"const {_constant(name)} = (() => {{\n{takes}\n{module.body}\nreturn {{{module.exports}}};\n}})();"


def _constant(name: str) -> str:
    return "_" + re.sub(r"\W", "_", name.removesuffix(".js"))
