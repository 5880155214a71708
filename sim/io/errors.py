"""How the program refuses: one sentence that says what was given, what is allowed, what to change.

Every command turns an `InputError` into one line on stderr and exit status 2 (`run_command`); inside
Python it is an ordinary `ValueError`. Anything else that goes wrong is a bug and keeps its traceback.
"""

from __future__ import annotations

import sys
from collections.abc import Callable


class InputError(ValueError):
    """The input cannot be used; the message is one line: given, allowed, change.

    Example:
        >>> from softflagella import InputError, load_robot
        >>> try:
        ...     load_robot("no-such-robot")
        ... except InputError as refusal:
        ...     print(refusal)
        no robot 'no-such-robot'; give a robot.toml or one of paper-control, paper-triangle, paper-measured
    """


def run_command(main: Callable[[list[str] | None], None], argv: list[str] | None = None) -> int:
    """Run a command-line entry point: 0 when it worked, 2 with one line on stderr for bad input."""
    try:
        main(argv)
    except InputError as refusal:
        print(f"error: {' '.join(str(refusal).split())}", file=sys.stderr)
        return 2
    except FileNotFoundError as missing:
        print(f"error: no such file: {missing.filename}; check the path", file=sys.stderr)
        return 2
    return 0
