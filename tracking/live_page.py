"""A page on this computer that shows a ride live, and a button on it that stops the motor.

The page is served to this computer alone, on a free port of 127.0.0.1. Its address has a token that nobody can
guess. A request that names another host is refused, so that no other page reaches this one by a name of its own
that leads to 127.0.0.1. The camera's thread leaves its newest picture here. It is compressed when the page asks,
in a thread of the server, so steering waits for nothing.
"""

from __future__ import annotations

import hmac
import json
import math
import secrets
import sys
import threading
import time
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from common.arrays import Floats

if TYPE_CHECKING:
    from camera.view import View
    from tracking.live import Sight

_WIDEST = 960  # pixels of a picture that is sent
_POINTS = 500  # of the path
_PATIENCE = 5.0  # s that a browser may take for its request
_LINES = 6  # told last
_POLICY = "default-src 'none'; connect-src 'self'; img-src 'self' data:; frame-ancestors 'none'; base-uri 'none'; "
_HEADERS = {"Cache-Control": "no-store", "Referrer-Policy": "no-referrer", "X-Content-Type-Options": "nosniff"}


class LivePage:
    """What is shown of a ride; it is served in a `with` block.

    Args:
        path: (n, 2), that is followed [l].
        length: of a tail [m].
    """

    def __init__(self, path: Floats, length: float):
        self.stopped = threading.Event()  # by the button
        self._path, self._length = path[:: max(1, len(path) // _POINTS)] * length, length
        self._seen: tuple[Any, View] | None = None  # the newest picture, and the camera's view
        self._compared = False  # the path, with the view
        self._state: dict[str, Any] = {"why": "no picture yet"}
        self._flip_at = math.nan
        self._lines: list[str] = []
        self._token = secrets.token_urlsafe(24)

    def __enter__(self) -> LivePage:
        self._server = _Server(("127.0.0.1", 0), _handler(self))
        self.host = f"127.0.0.1:{self._server.server_port}"
        self.address = f"http://{self.host}/{self._token}/"
        threading.Thread(target=self._server.serve_forever, args=(0.05,), daemon=True).start()
        return self

    def __exit__(self, *error: object) -> None:
        self._server.shutdown()
        self._server.server_close()

    def see(self, picture: Any, view: View) -> str:
        """Take the newest picture; say once, where the view is known, how much of the path it cannot show."""
        self._seen = picture, view
        if self._compared or view.homography is None:
            return ""
        self._compared = True
        places, size = view.to_picture(self._path), picture.shape[1::-1]
        share = ((places < 0) | (places > size)).any(1).mean()
        return f"{100 * share:.2g} % of the path lies outside the picture" if share else ""

    def tell(self, line: str) -> None:
        """Take a line that the user should know."""
        self._lines = [*self._lines, line][-_LINES:]

    def show(self, sight: Sight, direction: int, error: float, alarm: bool, flip_in: float) -> None:
        """Take what is known after a sight: as for `tracking.live.steer`, and the time until the next flip [s]."""
        now = time.monotonic()
        self._flip_at = now + flip_in
        state = {**self._state, "direction": direction, "alarm": alarm, "why": sight.why or self._state["why"]}
        state["error_cm"] = 100 * self._length * error if math.isfinite(error) else None
        if sight.pose is not None:
            state |= {"pose": sight.pose, "seen": now, "time_s": sight.time, "why": "no new picture"}
        self._state = state

    def state(self) -> dict[str, Any]:
        """Return what the page shows: lengths in cm, places in the picture in pixels."""
        state, now, seen = self._state, time.monotonic(), self._seen
        flip = self._flip_at - now
        answer = {name: state.get(name) for name in ("direction", "alarm", "error_cm", "time_s", "why")}
        answer |= {"flip_in_s": max(flip, 0.0) if math.isfinite(flip) else None, "lines": self._lines}
        answer["unseen_s"] = now - state["seen"] if "seen" in state else None
        if "pose" in state:
            x, y, heading = state["pose"]
            cm = 100 * self._length
            answer |= {"x_cm": cm * x, "y_cm": cm * y, "heading_deg": math.degrees(heading)}
            if seen is not None and seen[1].homography is not None:
                axis = np.outer([-1.0, 0.0, 0.3], [math.cos(heading), math.sin(heading)])
                places = seen[1].to_picture(self._length * (np.array([x, y]) + axis))
                answer["robot"] = places.tolist()  # end of the tails, the head's centre, ahead of it
                answer["band"] = (answer["error_cm"] or 0.0) / 50 / seen[1].metres(places[1])
        return answer

    def path(self) -> dict[str, Any] | None:
        """Return the size of a picture and the path in it [pixels]; None: neither is known yet."""
        if self._seen is None or self._seen[1].homography is None:
            return None
        size = self._seen[0].shape[1::-1]
        return {"size": size, "path": np.round(self._seen[1].to_picture(self._path), 1).tolist()}

    def picture(self) -> bytes:
        """Compress the newest picture, JPEG; nothing before the first one."""
        from camera.view import opencv

        if self._seen is None:
            return b""
        cv, picture = opencv(), self._seen[0]
        share = min(1.0, _WIDEST / picture.shape[1])
        smaller = cv.resize(picture, None, fx=share, fy=share, interpolation=cv.INTER_AREA)
        return bytes(cv.imencode(".jpg", smaller)[1])

    def answer(self, method: str, path: str) -> tuple[str, bytes, str] | None:
        """Answer a request: type, content, and policy for scripts and styles; None: there is no such thing."""
        root, _, what = path.partition("?")[0].rpartition("/")
        if not hmac.compare_digest(root.encode(), f"/{self._token}".encode()):
            return None
        match method, what:
            case "POST", "stop":
                self.stopped.set()
                return "application/json", b"{}", ""
            case "GET", "":
                nonce = secrets.token_urlsafe(16)
                text = Path(__file__).with_suffix(".html").read_text(encoding="utf-8").replace("@NONCE@", nonce)
                policy = f"script-src 'nonce-{nonce}'; style-src 'nonce-{nonce}'"
                return "text/html; charset=utf-8", text.encode(), policy
            case "GET", "picture":
                return "image/jpeg", self.picture(), ""
            case "GET", ("state" | "path") as name:
                content = self.state() if name == "state" else self.path()
                return "application/json", json.dumps(content).encode(), ""
        return None


class _Server(ThreadingHTTPServer):
    def handle_error(self, request: Any, client_address: Any) -> None:
        """Say nothing of a browser that has gone away."""
        if not isinstance(sys.exception(), OSError):
            super().handle_error(request, client_address)


def _handler(page: LivePage) -> type[BaseHTTPRequestHandler]:
    """Make what answers the requests of a page."""

    class Handler(BaseHTTPRequestHandler):
        timeout = _PATIENCE

        def do_GET(self) -> None:
            host, origin = self.headers.get("Host", ""), self.headers.get("Origin")
            allowed = host == page.host and origin in (None, f"http://{host}")
            answer = page.answer(self.command, self.path) if allowed else None
            if answer is None:
                self.send_error(HTTPStatus.NOT_FOUND if allowed else HTTPStatus.FORBIDDEN)
                return
            kind, content, policy = answer
            self.send_response(HTTPStatus.OK)
            own = {
                "Content-Type": kind,
                "Content-Length": len(content),
                "Content-Security-Policy": _POLICY + policy,
            }
            for name, value in {**_HEADERS, **own}.items():
                self.send_header(name, str(value))
            self.end_headers()
            self.wfile.write(content)

        do_POST = do_GET

        def log_message(self, format: str, *args: Any) -> None: ...

    return Handler
