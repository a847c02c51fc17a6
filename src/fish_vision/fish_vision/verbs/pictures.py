# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Pictures in and out of the commands: files, folders, a camera's topic, and a page on which a person clicks points of a picture.

Every failure is a CalibrationError. The page is on this computer and previews what the points give.
"""

import argparse
import base64
import json
import sys
import threading
from collections.abc import Callable, Mapping, Sequence
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from math import isfinite
from pathlib import Path
from typing import Any

import cv2

from fish_vision.calibration import CalibrationError, Lens
from fish_vision.picture import PICTURES, PictureError, picture_files, to_jpeg
from fish_vision.segmentation import Image

SILENCE_S = 10.0  # s without a picture after which a topic counts as silent

LONGEST = 65536  # bytes of a request
IDLE_S = 10.0  # s after which a connection without a request is closed
LOOK_S = 0.1  # s after which the page looks whether the person is done
PAGE = Path(__file__).with_name("picking_page.html")


def new_file(path: Path) -> Path:
    """The path, where nothing is yet: a params file may hold keys of the user's own. Raises CalibrationError."""
    if path.exists():
        raise CalibrationError(
            f"{path}: exists already; expected a new file, as calibrate overwrites none"
        )
    return path


def write_picture(path: Path, picture: Image) -> None:
    """Picture to a file; CalibrationError if that cannot be."""
    try:
        written = cv2.imwrite(str(path), picture)
    except cv2.error as error:
        raise CalibrationError(
            f"{path}: no name of a picture, expected like checked.png ({error.err})"
        ) from error
    if not written:
        raise CalibrationError(f"{path}: cannot be written")


def read_picture(path: Path) -> Image:
    """Picture from a file."""
    picture = cv2.imread(str(path), cv2.IMREAD_COLOR)
    if picture is None:
        raise CalibrationError(f"{path}: no such picture, or not one that OpenCV reads")
    return picture


def read_pictures(paths: Sequence[Path]) -> list[Image]:
    """Pictures from files, and from all picture files of folders in order of name."""
    files: list[Path] = []
    for path in paths:
        inside = picture_files(path)
        if not inside:
            raise CalibrationError(f"{path}: no pictures in it, expected {', '.join(PICTURES)}")
        files += inside
    return [read_picture(file) for file in files]


def from_topic(topic: str, count: int, accept: Callable[[Image], bool]) -> list[Image]:
    """The first pictures of a topic that are accepted. Needs ROS."""
    from fish_vision.nodes.picture_source import collect

    try:
        return collect(topic, accept, count, SILENCE_S)
    except PictureError as error:
        raise CalibrationError(str(error)) from error


def add_picture_arguments(parser: argparse.ArgumentParser) -> None:
    """--image and --topic: where the one picture of a command comes from."""
    source = parser.add_mutually_exclusive_group()
    source.add_argument("--image", type=Path, help="picture file of the camera")
    source.add_argument("--topic", help="take the picture from this topic of a running camera")


def one_picture(args: argparse.Namespace, lens: Lens) -> Image | None:
    """The picture that --image or --topic names, None without them; its size must be the lens file's."""
    if args.image is None and args.topic is None:
        return None
    if args.image is not None:
        picture = read_picture(args.image)
    else:
        picture = from_topic(args.topic, 1, lambda _: True)[0]
    require_size(picture, lens, str(args.image or args.topic))
    return picture


def require_size(picture: Image, lens: Lens, name: str) -> None:
    """Raise CalibrationError if a picture is not of the lens's size."""
    if picture.shape[1::-1] != lens.size:
        raise CalibrationError(
            f"{name}: size {picture.shape[1::-1]}, but the lens file says {lens.size}"
        )


Points = dict[str, tuple[float, float]]  # name -> u, v, pixels
Preview = Callable[[Points], tuple[str, Image | None]]  # text and picture for the points set so far


class _Server(ThreadingHTTPServer):
    """A thread for each connection: browsers open some in advance and send nothing on them."""

    daemon_threads = True
    timeout = LOOK_S

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Say nothing of a browser that has gone."""
        if not isinstance(sys.exception(), ConnectionError | TimeoutError):
            super().handle_error(request, client_address)


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
        self._picked: Points = {}
        self._done, self._previewing = threading.Event(), threading.Lock()
        page = self

        class Handler(BaseHTTPRequestHandler):
            timeout = IDLE_S

            def do_GET(self) -> None:
                page._get(self)

            def do_POST(self) -> None:
                page._post(self)

            def log_message(self, *_: Any) -> None:  # the terminal belongs to the command
                pass

        self._server = _Server(("127.0.0.1", port), Handler)

    @property
    def address(self) -> str:
        """What to open in a browser."""
        return f"http://127.0.0.1:{self._server.server_address[1]}/"

    def wait(self) -> Points:
        """Answer requests until the person is done; the points, pixels."""
        try:
            while not self._done.is_set():
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
            with self._previewing:
                text, picture = self._preview(points)
            shown = "" if picture is None else base64.b64encode(to_jpeg(picture, 90)).decode()
            body = json.dumps({"text": text, "picture": shown}).encode()
            _answer(request, 200, "application/json", body)
        elif request.path == "/done" and set(points) == set(self._names):
            self._picked = points
            try:
                _answer(request, 200, "text/plain", b"saved")
            finally:
                self._done.set()
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
