"""Errors for bad input: one sentence that says what was given, what is allowed, what to change.

Every command turns an `InputError` into one line on stderr and exit status 2 (`run_command`). In Python it is a
`ValueError`. All other errors are bugs and keep their traceback.
"""

from __future__ import annotations

import sys
from collections.abc import Callable


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


def run_command(main: Callable[[list[str] | None], None], argv: list[str] | None = None) -> int:
    """Run a command-line entry point. Returns 0; for bad input the error's status, after one line on stderr."""
    try:
        main(argv)
    except InputError as refusal:
        print(f"error: {' '.join(str(refusal).split())}", file=sys.stderr)
        return refusal.status
    except FileNotFoundError as missing:
        print(f"error: no such file: {missing.filename}; check the path", file=sys.stderr)
        return 2
    return 0
