"""The live page in Chromium, with a film as camera and a pseudo-terminal as port; who may ask for it."""

from __future__ import annotations

import http.client
import json
import os
import signal
import subprocess
import threading
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from types import SimpleNamespace
from typing import Any, NamedTuple
from urllib.parse import urlsplit

import numpy as np
import pytest

from tests.planner.page.view.browser import started_chromium
from tests.processes import LIMIT
from tests.tracking.test_live import LINE, pseudo_terminal, sent, swum, tank_files, tracking
from tracking.live import Sight
from tracking.live_page import LivePage

__all__ = ["tank_files"]


@pytest.fixture
def page() -> Iterator[LivePage]:
    with LivePage(LINE.reference, 0.11) as served:
        yield served


class Answer(NamedTuple):
    """What a server has answered."""

    status: int
    policy: str
    text: bytes


def asked(page: LivePage, what: str, method: str = "GET", **headers: str) -> Answer:
    """Ask for something; TOKEN in it stands for the page's token."""
    connection = http.client.HTTPConnection("127.0.0.1", int(page.host.partition(":")[2]), timeout=LIMIT)
    token = page.address.split("/")[3]
    connection.request(method, what.replace("TOKEN", token), headers=headers)
    answer = connection.getresponse()
    text = answer.read()
    connection.close()
    return Answer(answer.status, answer.headers.get("Content-Security-Policy", ""), text)


def test_only_who_knows_the_token_and_names_this_host_is_answered(page: LivePage) -> None:
    assert page.host.startswith("127.0.0.1:")
    assert asked(page, "/TOKEN/").status == 200
    for what in ("/", "/state", f"/{'x' * 32}/state", "/TOKEN/../state", "/TOKEN/nothing", "/TOKEN/stop"):
        assert asked(page, what).status == 404, what
    port = page.host.partition(":")[2]
    for host in (f"evil.example:{port}", "evil.example", f"localhost.evil.example:{port}", "127.0.0.1", ""):
        assert asked(page, "/TOKEN/state", Host=host).status == 403, host
    other = {"Origin": "https://evil.example"}
    assert asked(page, "/TOKEN/stop", "POST", **other).status == 403
    assert asked(page, f"/{'x' * 32}/stop", "POST").status == 404
    assert not page.stopped.is_set()
    assert asked(page, "/TOKEN/stop", "POST", Origin=f"http://{page.host}").status == 200
    assert page.stopped.is_set()


def test_a_request_without_a_path_is_refused_in_silence(page: LivePage, capfd: pytest.CaptureFixture[str]) -> None:
    for what in ("state", "?", "*", "TOKEN"):
        assert asked(page, what).status == 404, what
    assert capfd.readouterr().err == ""


def test_the_policy_allows_what_the_page_has_and_no_more(page: LivePage) -> None:
    first, again = (asked(page, "/TOKEN/") for _ in range(2))
    policy = first.policy
    assert "default-src 'none'" in policy
    assert "unsafe" not in policy
    assert policy != again.policy
    nonce = policy.split("'nonce-")[1].split("'")[0]
    assert first.text.decode().count(f'nonce="{nonce}"') == 2


def test_nothing_is_served_once_the_ride_is_over() -> None:
    before = threading.active_count()
    with LivePage(LINE.reference, 0.11) as page:
        assert asked(page, "/TOKEN/state").status == 200
    with pytest.raises(ConnectionRefusedError):
        asked(page, "/TOKEN/state")
    assert threading.active_count() <= before + 1  # the answer's own thread may be about to end


def test_what_is_not_known_yet_is_null(page: LivePage) -> None:
    state = json.loads(asked(page, "/TOKEN/state").text)
    assert state["unseen_s"] is state["flip_in_s"] is state["error_cm"] is None
    assert state["why"] == "no picture yet"
    page.show(Sight(0.5, None, "too dark"), 0, np.nan, False, np.inf)
    page.tell("a line")
    state = json.loads(asked(page, "/TOKEN/state").text)
    assert (state["why"], state["lines"], state["flip_in_s"]) == ("too dark", ["a line"], None)
    assert asked(page, "/TOKEN/picture").text == b""
    assert json.loads(asked(page, "/TOKEN/path").text) is None


def test_the_newest_sight_is_shown(page: LivePage) -> None:
    page.show(Sight(0.5, (1.0, 2.0, np.pi / 2)), 1, 0.25, True, 3.0)
    assert page.state()["why"] == "no new picture"  # if none follows
    page.show(Sight(0.7, None, "a hand"), -1, 0.5, False, 2.0)
    state = page.state()
    assert (state["x_cm"], state["y_cm"], state["heading_deg"]) == pytest.approx((11.0, 22.0, 90.0))
    assert (state["direction"], state["alarm"], state["time_s"]) == (-1, False, 0.5)
    assert state["error_cm"] == pytest.approx(5.5)
    assert 0 < state["flip_in_s"] <= 2.0
    assert state["unseen_s"] >= 0


@pytest.fixture
def browser() -> Iterator[Any]:
    with started_chromium() as started:
        yield started


@pytest.mark.slow
def test_a_request_that_gets_lost_leaves_the_button_alive(browser: Any, page: LivePage) -> None:
    tab = browser.new_page()
    tab.set_default_timeout(1000 * LIMIT)
    lost = {"state": "**/state", "stop": "**/stop"}
    tab.goto(page.address)
    tab.locator("#facts", has_text="no picture yet").wait_for()
    for address in lost.values():
        tab.route(address, lambda route: route.abort())
    tab.locator("#alarm", has_text="does not answer").wait_for()
    tab.click("#stop")
    tab.locator("#stop", has_text="press again").wait_for()
    tab.unroute(lost["state"])
    tab.wait_for_selector("#alarm:empty", state="attached")
    assert not page.stopped.is_set()
    tab.unroute(lost["stop"])
    tab.click("#stop")
    assert page.stopped.wait(LIMIT)


def address_of(process: subprocess.Popen[str]) -> str:
    """Read the address that is told first."""
    assert process.stderr is not None
    line = process.stderr.readline()
    assert line.startswith("live page: http://127.0.0.1:"), line + process.stderr.read()
    return line.split()[-1]


@pytest.mark.slow
def test_a_lab_looks_at_the_robot_and_stops_it(browser: Any, tank_files: Path) -> None:
    from tests.oracles import tank

    tank.Tank().film(tank_files / "film.avi", lambda time: (*swum(time), 0.0, 0.0), 30.0, 5.0, codec="MJPG")
    master, port = pseudo_terminal()
    process = tracking(tank_files, port, "--show")
    page = browser.new_page()
    page.set_default_timeout(1000 * LIMIT)
    troubles: list[str] = []
    page.on("console", lambda message: troubles.append(message.text))
    page.on("pageerror", lambda error: troubles.append(str(error)))
    page.goto(address_of(process))
    page.locator("#facts", has_text="forward (+)").wait_for()
    while (page.locator("#trail").get_attribute("d") or "").count("L") < 3:  # its policy forbids wait_for_function
        page.wait_for_timeout(50)
    seen = page.locator("#facts").inner_text()
    assert "cm" in seen
    assert "degrees" in seen
    width = page.evaluate(  # a picture has none until it is there as a whole
        "new Promise((done) => document.querySelector('#picture')"
        ".addEventListener('load', (event) => done(event.target.naturalWidth), { once: true }))"
    )
    assert width == 480
    band = float(page.locator("#band").get_attribute("stroke-width"))
    assert band > 1
    centre = page.evaluate(
        "document.querySelector('#robot').getAttribute('d').split(/[MLZ,]/).slice(3, 5).map(Number)"
    )
    assert 0 < centre[0] < 480
    assert 0 < centre[1] < 360
    assert process.poll() is None
    assert not troubles
    page.click("#stop")
    _, told = process.communicate(timeout=LIMIT)
    assert process.returncode == 0, told
    assert sent(master).split()[-1] == b"S"
    page.locator("#alarm", has_text="Stopped.").wait_for()
    assert page.locator("#stop").is_disabled()
    assert "stopped on the live page" in told
    assert "Traceback" not in told


@pytest.mark.slow
def test_a_program_that_hangs_is_not_shown_as_if_it_steered(browser: Any, tank_files: Path) -> None:
    from tests.oracles import tank

    tank.Tank().film(tank_files / "film.avi", lambda time: (*swum(time), 0.0, 0.0), 30.0, 5.0, codec="MJPG")
    process = tracking(tank_files, pseudo_terminal()[1], "--show")
    page = browser.new_page()
    page.set_default_timeout(1000 * LIMIT)
    page.goto(address_of(process))
    page.locator("#facts", has_text="forward (+)").wait_for()
    process.send_signal(signal.SIGSTOP)
    try:
        page.locator("#alarm", has_text="does not answer").wait_for(timeout=5000)
        assert page.locator("#facts").inner_text() == ""
    finally:
        process.send_signal(signal.SIGCONT)
    page.locator("#facts", has_text="forward (+)").wait_for()
    page.click("#stop")
    process.communicate(timeout=LIMIT)
    assert process.returncode == 0


@pytest.mark.slow
def test_a_stop_comes_through_where_nobody_reads_the_rows(tank_files: Path) -> None:
    master, port = pseudo_terminal()
    reads, full = os.pipe()
    os.set_blocking(full, False)
    with suppress(BlockingIOError):
        while True:
            os.write(full, b"#" * 4096)
    os.set_blocking(full, True)
    process = tracking(tank_files, port, "--show", stdout=full)
    address, orders = urlsplit(address_of(process)), b""
    while not {b"F", b"B"} & set(orders.split()) and process.poll() is None:
        time.sleep(0.1)
        orders += sent(master)
    connection = http.client.HTTPConnection(address.netloc, timeout=LIMIT)
    connection.request("POST", f"{address.path}stop")
    assert connection.getresponse().status == 200
    connection.close()
    _, told = process.communicate(timeout=LIMIT)
    assert process.returncode == 0, told
    assert "stopped on the live page" in told
    assert (orders + sent(master)).split()[-1] == b"S"
    for end in (reads, full):
        os.close(end)


def test_a_path_that_leaves_the_picture_is_told_of_once(page: LivePage) -> None:
    picture = np.zeros((100, 200, 3), np.uint8)
    places = np.linspace([0, 50], [250, 50], len(page._path))
    view: Any = SimpleNamespace(homography=None, to_picture=lambda path: places)
    assert page.see(picture, view) == ""
    view.homography = np.eye(3)
    assert page.see(picture, view) == "20 % of the path lies outside the picture"
    assert page.see(picture, view) == ""
