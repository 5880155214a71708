"""Large compiled loops are called by those that use them, not copied into them.

numba links all that a loop calls into it, optimises it again, and makes machine code of it again. In a chain of
loops, the innermost is then compiled as often as the chain is long. So where a loop has more than LARGE
instructions, its callers get a call of its symbol. LLVM would not inline a loop of that size. Smaller loops are
linked as numba does.

The name of a symbol says which loop, which types, and which code; so it is the same in all processes. The machine
code of what a loop calls must be in memory before its own. So beside each cached loop is a list of the large loops
that it calls (`Needed`), which are read or compiled first.

Only loops that are `compiled_exactly` are called: the last digits of others depend on how often LLVM optimises
them. Loops of other packages are linked.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple, cast

from llvmlite import binding
from numba.core.caching import CompileResultCacheImpl, FunctionCache
from numba.core.compiler import Compiler
from numba.core.compiler import CompileResult as _CompileResult

from sim.compiling import Loop, digest_of_code

LARGE = 200  # instructions; LLVM inlines a few dozen
CompileResult: Any = _CompileResult  # numba has no types of its fields
_HERE = Path(__file__).parent


class Needed(NamedTuple):
    """A large loop, for arguments of some types."""

    module: str
    name: str
    types: tuple[Any, ...]
    symbol: str  # its name in machine code

    @property
    def loop(self) -> Loop:
        """The loop itself."""
        return cast(Loop, getattr(import_module(self.module), self.name))

    def is_found(self) -> bool:
        """Have its machine code in memory, read or compiled; tell whether it has the symbol that callers call."""
        self.loop.dispatcher.compile(self.types)
        return bool(self.loop.dispatcher.overloads[self.types].fndesc.llvm_func_name == self.symbol)

    def __call__(self) -> None:
        """Do nothing: numba calls what a cached loop needs, but it has been found before."""


class LoopCompiler(Compiler):
    """numba's compiler, for loops that are called where they are large."""

    def _compile_bytecode(self) -> Any:
        function = self.state.func_id.func
        called = _may_be_called(function)
        if called:
            self.state.func_id.unique_id = digest_of_code(function.__code__)
        result: Any = super()._compile_bytecode()  # type: ignore[no-untyped-call]
        if called and _is_large(result):
            _let_call(result)
        return result


class _Written(CompileResultCacheImpl):
    """What is written of a compiled loop: of a large one the names of its symbols, and no code to be linked."""

    def reduce(self, result: Any) -> Any:
        """Return what is written."""
        library = result.library
        called = not list(library._get_module_for_linking().functions)
        names = [function.name for function in library.get_defined_functions()] if called else []
        return names, result._reduce()

    def rebuild(self, target: Any, written: Any) -> Any:
        """Return the loop, after all that it calls; None if that is no longer what it was."""
        names, parts = written
        *_, calls, _ = parts
        if not all(needed.is_found() for needed in calls if isinstance(needed, Needed)):
            return None
        target.codegen()._engine._defined_symbols.update(names)
        result = CompileResult._rebuild(target, *parts)
        if names:
            _let_call(result)
        else:
            result.library._reload_init.update(calls)
        return result


class LoopCache(FunctionCache):
    """Where compiled loops are kept."""

    _impl_class = _Written


def _may_be_called(function: Callable[..., Any]) -> bool:
    """Tell whether a function is a loop of this package that other processes find by its name."""
    module = sys.modules.get(function.__module__)
    here = Path(function.__code__.co_filename).is_relative_to(_HERE)
    loop = getattr(module, function.__name__, None)
    return here and isinstance(loop, Loop) and loop.exact


def _is_large(result: Any) -> bool:
    """Tell whether a loop, as LLVM has optimised it, is too large to be copied."""
    code = result.library.get_function(result.fndesc.llvm_func_name)
    return sum(1 for block in code.blocks for _ in block.instructions) > LARGE


def _let_call(result: Any) -> None:
    """Let others link nothing of a loop, but have it in memory."""
    function, library = result.fndesc, result.library
    types, symbol = tuple(result.signature.args), function.llvm_func_name
    library._shared_module = binding.parse_assembly(str(library.codegen._create_empty_module(library.name)))
    library._reload_init = {Needed(function.modname, function.qualname, types, symbol)}
