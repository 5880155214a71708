"""Results that several tests need, made once for all processes of a test session."""

from __future__ import annotations

import os
import pickle
from collections.abc import Callable
from functools import wraps
from hashlib import sha256
from pathlib import Path
from tempfile import mkdtemp
from typing import Any, ParamSpec, TypeVar, cast

from filelock import FileLock

Given = ParamSpec("Given")
Result = TypeVar("Result")

SESSION = "SOFTFLAGELLA_TEST_SESSION"  # the variable that tells the workers the folder of the session
if SESSION not in os.environ:
    os.environ[SESSION] = mkdtemp()
FOLDER = Path(os.environ[SESSION])


def shared(make: Callable[Given, Result]) -> Callable[Given, Result]:
    """Let one process of the session make each result of a function, for all others to read; nobody may change it.

    Arguments are told apart by their pickles; so is the result kept.
    """
    known: dict[str, Result] = {}

    @wraps(make)
    def result(*given: Any, **options: Any) -> Result:
        asked = make.__module__, make.__qualname__, given, sorted(options.items())
        name = sha256(pickle.dumps(asked)).hexdigest()
        if name not in known:
            with FileLock(FOLDER / f"{name}.lock"):
                file = FOLDER / name
                if not file.exists():
                    file.write_bytes(pickle.dumps(make(*given, **options)))
            known[name] = pickle.loads(file.read_bytes())
        return known[name]

    return cast(Callable[Given, Result], result)
