# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""A page on this computer on which a person clicks points of a picture, with a preview of what they give."""

import base64
import json
from collections.abc import Callable, Mapping, Sequence
from http.server import BaseHTTPRequestHandler, HTTPServer
from math import isfinite
from pathlib import Path
from typing import Any

import cv2

from fish_vision.picture import to_jpeg
from fish_vision.segmentation import Image

Points = dict[str, tuple[float, float]]  # name -> u, v, pixels
Preview = Callable[[Points], tuple[str, Image | None]]  # text and picture for the points set so far
LONGEST = 65536  # bytes of a request
PAGE = Path(__file__).with_name("picking_page.html")


class PickingPage:
    """Serves one picture on 127.0.0.1 until a person has clicked every point.

    Args:
        picture: (h, w, 3) blue, green, red.
        names: of the points, in the order in which they are asked for.
        preview: called with the points after every click.
        port: 0 takes any free one.
    """

    def __init__(
        self, picture: Image, names: Sequence[str], preview: Preview, port: int = 0
    ) -> None:
        self._picture = cv2.imencode(".png", picture)[1].tobytes()
        self._size = picture.shape[1::-1]
        self._names, self._preview = list(names), preview
        self._picked: Points | None = None
        page = self

        class Handler(BaseHTTPRequestHandler):
            def do_GET(self) -> None:
                page._get(self)

            def do_POST(self) -> None:
                page._post(self)

            def log_message(self, *_: Any) -> None:  # the terminal belongs to the command
                pass

        self._server = HTTPServer(("127.0.0.1", port), Handler)

    @property
    def address(self) -> str:
        """What to open in a browser."""
        return f"http://127.0.0.1:{self._server.server_address[1]}/"

    def wait(self) -> Points:
        """Answer requests until the person is done; the points, pixels."""
        try:
            while self._picked is None:
                self._server.handle_request()
        finally:
            self._server.server_close()
        return self._picked

    def _get(self, request: BaseHTTPRequestHandler) -> None:
        if not self._own(request):
            return
        if request.path == "/picture.png":
            _answer(request, 200, "image/png", self._picture)
        elif request.path == "/":
            text = PAGE.read_text(encoding="utf-8").replace("NAMES", json.dumps(self._names), 1)
            _answer(request, 200, "text/html; charset=utf-8", text.encode())
        else:
            _answer(request, 404, "text/plain", b"expected / or /picture.png")

    def _post(self, request: BaseHTTPRequestHandler) -> None:
        if not self._own(request):
            return
        try:
            points = self._points(request)
        except ValueError as error:
            _answer(request, 400, "text/plain", str(error).encode())
            return
        if request.path == "/preview":
            text, picture = self._preview(points)
            shown = "" if picture is None else base64.b64encode(to_jpeg(picture, 90)).decode()
            body = json.dumps({"text": text, "picture": shown}).encode()
            _answer(request, 200, "application/json", body)
        elif request.path == "/done" and set(points) == set(self._names):
            self._picked = points
            _answer(request, 200, "text/plain", b"saved")
        else:
            _answer(request, 400, "text/plain", b"expected every point to be set")

    def _own(self, request: BaseHTTPRequestHandler) -> bool:
        """Whether the request names this computer: another site in the browser must not ask in its own name."""
        host = request.headers.get("Host", "").rsplit(":", 1)[0]
        if host in ("127.0.0.1", "localhost"):
            return True
        _answer(request, 403, "text/plain", b"expected 127.0.0.1 as host")
        return False

    def _points(self, request: BaseHTTPRequestHandler) -> Points:
        """Points of a request, checked. Raises ValueError."""
        length = request.headers.get("Content-Length", "")
        if not length.isdigit() or int(length) > LONGEST:
            raise ValueError(f"Content-Length {length!r}: expected at most {LONGEST} bytes")
        given = json.loads(request.rfile.read(int(length)))
        if not isinstance(given, Mapping) or not set(given) <= set(self._names):
            raise ValueError(f"expected points of {self._names}")
        return {name: self._pixel(value) for name, value in given.items()}

    def _pixel(self, value: object) -> tuple[float, float]:
        if (
            not isinstance(value, list)
            or len(value) != 2
            or not all(isinstance(v, int | float) and isfinite(v) for v in value)
            or not all(-0.5 <= v <= side for v, side in zip(value, self._size, strict=True))
        ):
            raise ValueError(f"{value!r}: expected u, v in the picture")
        return float(value[0]), float(value[1])


def _answer(request: BaseHTTPRequestHandler, status: int, kind: str, body: bytes) -> None:
    request.send_response(status)
    request.send_header("Content-Type", kind)
    request.send_header("Content-Length", str(len(body)))
    request.end_headers()
    request.wfile.write(body)
