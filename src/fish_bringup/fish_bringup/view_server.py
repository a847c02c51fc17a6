# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Serves the live view's page, its state and, if that is allowed, its buttons, on one address. No ROS."""

from __future__ import annotations

import threading
from collections.abc import Callable
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from importlib.resources import files
from ipaddress import ip_address
from urllib.parse import urlsplit

LONGEST_BODY = 1024  # bytes; the page sends none
WRONG_LENGTH = b"the length of the body is none of 0 to 1024 bytes"
IDLE_S = (
    10.0  # s after which a connection without a request is closed; the page asks ten times a second
)
HEADER = "X-Robot-Fish"  # a page of another site cannot send it without asking first
WRONG_HOST = b"wrong host; open this view by the address of its computer, such as 127.0.0.1"
Act = Callable[[bool], None]  # True arms, False disarms


class ViewServer:
    """A small web server in a thread of its own.

    GET / is the page, GET /state the newest state; POST /arm and /disarm call `act`, if there is one.

    Args:
        address, port: to listen on; port 0 is any free one.
        act: arms or disarms; None: the page only shows.

    Raises:
        ValueError: the port is in use, or the address is none of this computer.
    """

    def __init__(self, address: str, port: int, act: Act | None = None) -> None:
        self.state = "{}"
        page = files("fish_bringup").joinpath("view.html").read_bytes()
        handler = type("Handler", (_Handler,), {"view": self, "page": page, "act": (act,)})
        try:
            self._server = ThreadingHTTPServer((address, port), handler)
        except OSError as error:
            raise ValueError(
                f"cannot show the view on {address}:{port}: {error.strerror or error}; give another port or address"
            ) from error
        self._server.daemon_threads = True
        self.address, self.port = address, self._server.server_address[1]
        self._thread = threading.Thread(target=self._server.serve_forever, daemon=True)
        self._thread.start()

    @property
    def url(self) -> str:
        """Where a browser of this computer finds it."""
        return f"http://{'127.0.0.1' if self.address == '0.0.0.0' else self.address}:{self.port}/"

    def close(self) -> None:
        """End the thread and give the port back."""
        self._server.shutdown()
        self._server.server_close()
        self._thread.join()


class _Handler(BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"
    timeout = IDLE_S
    view: ViewServer
    page: bytes
    act: tuple[Act | None]  # a plain function in a class would become a method

    def do_GET(self) -> None:
        if not self._from_here():
            self._answer(HTTPStatus.FORBIDDEN, WRONG_HOST, "text/plain")
        elif self.path == "/":
            self._answer(HTTPStatus.OK, self.page, "text/html; charset=utf-8")
        elif self.path == "/state":
            self._answer(HTTPStatus.OK, self.view.state.encode(), "application/json")
        else:
            self._answer(HTTPStatus.NOT_FOUND, b"not found", "text/plain")

    def do_POST(self) -> None:
        act = self.act[0]
        if act is None or HEADER not in self.headers or not self._from_here():
            self._answer(HTTPStatus.FORBIDDEN, b"this view only shows", "text/plain")
        elif not self._read_body():
            self._answer(HTTPStatus.BAD_REQUEST, WRONG_LENGTH, "text/plain")
        elif self.path in ("/arm", "/disarm"):
            act(self.path == "/arm")
            self._answer(HTTPStatus.OK, b"asked", "text/plain")
        else:
            self._answer(HTTPStatus.NOT_FOUND, b"not found", "text/plain")

    def _read_body(self) -> bool:
        """Take the request's body; False where its length is none of 0 to LONGEST_BODY."""
        length = self.headers.get("Content-Length", "0")
        if not length.isdecimal() or len(length) > 9 or int(length) > LONGEST_BODY:
            return False
        self.rfile.read(int(length))
        return True

    def _from_here(self) -> bool:
        """Whether Host is no foreign name: another site can lead a name of its own to this computer, but no address."""
        try:
            host = urlsplit(f"//{self.headers.get('Host', '')}").hostname or ""
            if host not in ("localhost", self.view.address.lower()):
                ip_address(host)
        except ValueError:
            return False
        return True

    def _answer(self, status: HTTPStatus, body: bytes, kind: str) -> None:
        self.send_response(status)
        self.send_header("Content-Type", kind)
        self.send_header("Content-Length", str(len(body)))
        self.send_header("Cache-Control", "no-store")
        if status != HTTPStatus.OK:  # a body that was not read is no next request
            self.send_header("Connection", "close")
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, format: str, *args: object) -> None:
        """Say nothing: the page asks ten times a second."""
