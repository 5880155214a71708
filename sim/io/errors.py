"""Errors for bad input: one sentence that says what was given, what is allowed, what to change.

Every command turns an `InputError` into one line on stderr and exit status 2 (`run_command`). In Python it is a
`ValueError`. Ctrl-C, a closed pipe and a refusal of the operating system end a command without a traceback, too.
All other errors are bugs and keep their traceback.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

INTERRUPTED, CLOSED_PIPE = 130, 141  # exit statuses as shells give them: 128 + SIGINT, 128 + SIGPIPE


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
        known = not isinstance(source, str | Path) or str(source) in message
        raise type(refusal)(message if known else f"{source}: {message}") from None


def run_command(main: Callable[[list[str] | None], None], argv: list[str] | None = None) -> int:
    """Run a command-line entry point and return its exit status.

    Returns:
        0; 2, or the error's status, for bad input, after one line on stderr; 130 after Ctrl-C; 141 where the
        reader of a pipe has gone.
    """
    try:
        main(argv)
        sys.stdout.flush()
    except InputError as refusal:
        return _end(str(refusal), refusal.status)
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)  # or the interpreter complains when it flushes at its end
        return CLOSED_PIPE
    except FileNotFoundError as missing:
        return _end(f"no such file: {missing.filename}; check the path", 2)
    except OSError as refusal:
        if refusal.filename is None:
            raise
        return _end(f"{refusal.filename}: {refusal.strerror}", 2)
    except RecursionError:
        return _end("the input is nested too deeply; give a simpler one", 2)
    except MemoryError:
        return _end("the memory of this machine does not suffice; give a smaller input", 2)
    except KeyboardInterrupt as stop:
        print("interrupted", file=sys.stderr)
        return getattr(stop, "status", INTERRUPTED)
    return 0


def _end(message: str, status: int) -> int:
    print(f"error: {' '.join(message.split())}", file=sys.stderr)
    return status
