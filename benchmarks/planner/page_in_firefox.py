"""The page's planner in Firefox: how far its plans are from Python's."""

from __future__ import annotations

import json
import shutil
import subprocess
import tempfile
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from threading import Event, Thread
from typing import Any

import numpy as np

from planner.page.table_data import table_data
from planner.paths.path import Path2D, circle, polygon
from planner.planning.plan import plan
from planner.planning.planned import Plan
from sim.model.presets import PRESETS
from sim.model.robot import Robot
from surrogate.table.model_file import load
from tests.planner.page.page_core import FOLDER, to_page

PATHS = (circle(1.5), circle(4.0), polygon(3, 3.0), polygon(4, 3.0), polygon(6, 2.0), Path2D.of([[0, 0], [6, 0]]))
HARNESS = """<!doctype html><script type="module">
import { readTable } from "/lookup.js";
import { pathOf } from "/path.js";
import { planPath } from "/plan.js";
import { makeRobot } from "/robot.js";
const { data, cases } = await (await fetch("/cases")).json();
const table = await readTable(data);
const answers = cases.map(({ robot, points, closed }) => {
  const { switches, errors } = planPath(pathOf(points, closed), makeRobot(robot), table);
  return { dwells: Array.from(switches.dwells), poses: switches.poses.flat(), stated: errors.stated };
});
await fetch("/answers", { method: "POST", body: JSON.stringify(answers) });
</script>"""


class Handler(SimpleHTTPRequestHandler):
    """Serves the page's modules and the cases, and takes the answers."""

    def __init__(self, *words: Any, cases: str, answers: list[Any], done: Event, **settings: Any):
        self.pages = {"/": ("text/html", HARNESS), "/cases": ("application/json", cases)}
        self.answers, self.done = answers, done
        super().__init__(*words, directory=str(FOLDER), **settings)

    def do_GET(self) -> None:
        if self.path not in self.pages:
            super().do_GET()
            return
        kind, text = self.pages[self.path]
        self.send_response(200)
        self.send_header("Content-Type", kind)
        self.end_headers()
        self.wfile.write(text.encode())

    def do_POST(self) -> None:
        self.answers += json.loads(self.rfile.read(int(self.headers["Content-Length"])))
        self.send_response(204)
        self.end_headers()
        self.done.set()

    def log_message(self, *words: object) -> None:
        """Say nothing."""


def parity() -> tuple[int, float] | None:
    """Plan paths for each preset in Firefox and in Python.

    Returns:
        Number of plans, and the largest difference of a dwell, a pose or a stated error [μ0 l⁴/EI, l, rad]; None:
        there is no firefox-esr here.
    """
    program = shutil.which("firefox-esr") or shutil.which("firefox")
    if program is None:
        return None
    cases = [(path, robot) for robot in PRESETS.values() for path in PATHS]
    found = _planned(program, cases)
    wanted = [plan(path, robot) for path, robot in cases]
    return len(cases), max(_apart(answer, result) for answer, result in zip(found, wanted, strict=True))


def _planned(program: str, cases: list[tuple[Path2D, Robot]]) -> list[dict[str, Any]]:
    rows = [
        {"robot": to_page(robot), "points": path.polyline().tolist(), "closed": path.closed}
        for path, robot in cases
    ]
    answers: list[dict[str, Any]] = []
    done = Event()
    text = json.dumps({"data": json.loads(table_data(load())), "cases": rows})
    with (
        ThreadingHTTPServer(("127.0.0.1", 0), partial(Handler, cases=text, answers=answers, done=done)) as server,
        tempfile.TemporaryDirectory() as profile,
    ):
        Thread(target=server.serve_forever, daemon=True).start()
        address = f"http://127.0.0.1:{server.server_port}/"
        browser = subprocess.Popen(
            [program, "--headless", "--no-remote", "--profile", profile, address],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        try:
            if not done.wait(600):
                raise RuntimeError("Firefox gave no answer")
        finally:
            browser.terminate()
            browser.wait()
            server.shutdown()
    return answers


def _apart(answer: dict[str, Any], result: Plan) -> float:
    """Return the largest difference of two plans; infinite if one has more flips."""
    if len(answer["dwells"]) != len(result.dwells):
        return np.inf
    pairs = (
        (answer["dwells"], result.dwells),
        (answer["poses"], result.switches.poses.ravel()),
        ([answer["stated"]], [result.stated_error]),
    )
    return max(float(np.abs(np.asarray(ours) - np.asarray(theirs)).max()) for ours, theirs in pairs)
