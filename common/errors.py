"""Errors for bad input: one sentence that says what was given, what is allowed, what to change.

Every command turns an `InputError` into one line on stderr and exit status 2 (`run_command`). In Python it is a
`ValueError`. Ctrl-C, a closed pipe and a refusal of the operating system end a command without a traceback, too.
All other errors are bugs and keep their traceback.
"""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from io import TextIOWrapper

INTERRUPTED, CLOSED_PIPE = 130, 141  # exit statuses as shells give them: 128 + SIGINT, 128 + SIGPIPE
_LIMITS = re.compile(
    "Too many open files|[Cc]annot allocate memory|failed to map segment|can't start new thread"
    "|Resource temporarily unavailable|No space left on device"
)


class InputError(ValueError):
    """The input is unusable. The message is one line: what was given, what is allowed, what to change.

    Example:
        >>> from softflagella import InputError, load_robot
        >>> try:
        ...     load_robot("no-such-robot")
        ... except InputError as refusal:
        ...     print(refusal)
        no robot 'no-such-robot'; give a robot.toml or one of paper-control, paper-triangle, paper-measured
    """

    status = 2  # of a command


class InputWarning(UserWarning):
    """A part of the input is left out; a command prints the message as a line on stderr."""


@contextmanager
def naming(source: object) -> Iterator[None]:
    """Write the name of a file before the message of an `InputError` that does not have it.

    Args:
        source: the path of the file; anything else has no name.
    """
    try:
        yield
    except InputError as refusal:
        message = " ".join(str(refusal).split())
        known = not isinstance(source, str | os.PathLike) or str(source) in message
        raise type(refusal)(message if known else f"{source}: {message}") from None


def run_command(main: Callable[[list[str] | None], None], argv: list[str] | None = None) -> int:
    """Run a command-line entry point and return its exit status.

    Signs that the encoding of the standard output lacks are printed as question marks.

    Returns:
        0; 2, or the error's status, for bad input, after one line on stderr; 130 after Ctrl-C; 141 where the
        reader of a pipe has gone.
    """
    if isinstance(sys.stdout, TextIOWrapper):
        sys.stdout.reconfigure(errors="replace")
    try:
        main(argv)
        sys.stdout.flush()
    except InputError as refusal:
        return _end(str(refusal), refusal.status)
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)  # or the interpreter complains when it flushes at its end
        return CLOSED_PIPE
    except KeyboardInterrupt as stop:
        print(str(stop) or "interrupted", file=sys.stderr)
        return getattr(stop, "status", INTERRUPTED)
    except Exception as error:
        refused = _refused(error)
        if refused is None:
            raise
        return _end(refused, 2)
    return 0


def _refused(error: BaseException) -> str | None:
    """Say what the operating system refused, a file or, at the root of the error, its limits; None if neither."""
    if isinstance(error, OSError) and error.filename is not None:
        return f"{error.filename}: {error.strerror}"
    if isinstance(error, RecursionError):
        return "the input is nested too deeply; give a simpler one"
    root: BaseException | None = error
    while root is not None:
        if isinstance(root, MemoryError):
            return "the memory of this machine does not suffice; give a smaller input, or raise ulimit -v"
        if limit := _LIMITS.search(str(root)):
            return f"the system refuses: {limit[0]}; free some, or raise this shell's limits (ulimit -n, -u, -v)"
        root = root.__cause__ or root.__context__
    return None


def _end(message: str, status: int) -> int:
    print(f"error: {' '.join(message.split())}", file=sys.stderr)
    return status
