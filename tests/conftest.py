"""Shared by all tests: one thread, the marks by duration, the order, and the processor time that each test takes.

tests/durations.json has the processor seconds of the longer tests; `pytest --write-durations` brings it up to date
for the tests that it runs. Tests over `SLOW` are marked. The longest run first, so that all processes
end at about the same time. The quick tests of a file stay in one process, with those that share a fixture of the
module. Another slow test goes to whichever process is free, unless an `xdist_group` says with which tests it runs.
"""

from __future__ import annotations

import json
import os
import resource
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

for library in ("OMP", "MKL", "OPENBLAS"):
    os.environ.setdefault(f"{library}_NUM_THREADS", "1")

import pytest  # noqa: E402
import torch  # noqa: E402

torch.set_num_threads(1)

DURATIONS = Path(__file__).parent / "durations.json"
NOTED, SLOW = 0.1, 0.15  # s of processor time
_measured: dict[str, float] = defaultdict(float)
_last = 0.0


def noted_durations() -> dict[str, float]:
    """Return the processor seconds of the longer tests."""
    return dict(json.loads(DURATIONS.read_text())) if DURATIONS.exists() else {}


def exists(test: str) -> bool:
    """Whether the file of a test still has a function of its name."""
    file, _, name = test.partition("::")
    path = DURATIONS.parents[1] / file
    return path.exists() and f"def {name.partition('[')[0]}(" in path.read_text()


def without_group(test: str) -> str:
    """Return the identifier of a test without the group that pytest-xdist appends."""
    name, brackets, group = test.partition("]@")
    if group:
        return name + brackets[0]
    at, bracket = test.find("@"), test.find("[")
    return test[:at] if at >= 0 and not 0 <= bracket < at else test


def shares_fixture(item: pytest.Item) -> bool:
    """Whether a test uses a fixture that is made once for its module."""
    fixtures = getattr(item, "_fixtureinfo").name2fixturedefs.values()  # noqa: B009
    return any(fixture.scope == "module" for fixtures_of_name in fixtures for fixture in fixtures_of_name)


def processor_seconds() -> float:
    """Return the processor time of this process and of those that it started and that have ended [s]."""
    usages = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(usage.ru_utime + usage.ru_stime for usage in usages)


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--write-durations", action="store_true", help="bring tests/durations.json up to date")


@pytest.hookimpl(tryfirst=True)  # before tests are selected by their marks
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    durations = noted_durations()
    groups: dict[pytest.Item, str] = {}
    seconds: dict[str, float] = defaultdict(float)
    for item in items:
        if durations.get(item.nodeid, 0.0) > SLOW:
            item.add_marker(pytest.mark.slow)
        named = item.get_closest_marker("xdist_group")
        alone = item.get_closest_marker("slow") and not shares_fixture(item)
        group = named.args[0] if named else item.nodeid if alone else item.nodeid.partition("::")[0]
        item.add_marker(pytest.mark.xdist_group(group))
        groups[item] = group
        seconds[group] += durations.get(item.nodeid, 0.0)
    items.sort(key=lambda item: -seconds[groups[item]])


def pytest_runtest_logstart() -> None:
    global _last
    _last = processor_seconds()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Iterator[None]:
    """Send the processor time of each phase of a test with its report."""
    global _last
    report = yield
    now = processor_seconds()
    report.processor_seconds, _last = now - _last, now
    return report


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    if hasattr(report, "processor_seconds"):
        _measured[without_group(report.nodeid)] += report.processor_seconds


def pytest_sessionfinish(session: pytest.Session) -> None:
    if session.config.getoption("--write-durations") and not hasattr(session.config, "workerinput"):
        durations = {**noted_durations(), **{test: round(seconds, 2) for test, seconds in _measured.items()}}
        kept = {test: durations[test] for test in sorted(durations) if durations[test] >= NOTED and exists(test)}
        DURATIONS.write_text(json.dumps(kept, indent=0, ensure_ascii=False) + "\n")
