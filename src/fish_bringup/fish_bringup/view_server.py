# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Serves the live view's page, its state and, if that is allowed, its buttons, on one address. No ROS."""

from __future__ import annotations

import threading
from collections.abc import Callable
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from importlib.resources import files

LOOPBACK = ("127.0.0.1", "localhost", "::1")
HEADER = "X-Robot-Fish"  # a page of another site cannot send it without asking first
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
        self.local = address in LOOPBACK
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
    view: ViewServer
    page: bytes
    act: tuple[Act | None]  # a plain function in a class would become a method

    def do_GET(self) -> None:
        if not self._from_here():
            self._answer(HTTPStatus.FORBIDDEN, b"wrong host", "text/plain")
        elif self.path == "/":
            self._answer(HTTPStatus.OK, self.page, "text/html; charset=utf-8")
        elif self.path == "/state":
            self._answer(HTTPStatus.OK, self.view.state.encode(), "application/json")
        else:
            self._answer(HTTPStatus.NOT_FOUND, b"not found", "text/plain")

    def do_POST(self) -> None:
        self.rfile.read(int(self.headers.get("Content-Length") or 0))
        act = self.act[0]
        if act is None or HEADER not in self.headers or not self._from_here():
            self._answer(HTTPStatus.FORBIDDEN, b"this view only shows", "text/plain")
        elif self.path in ("/arm", "/disarm"):
            act(self.path == "/arm")
            self._answer(HTTPStatus.OK, b"asked", "text/plain")
        else:
            self._answer(HTTPStatus.NOT_FOUND, b"not found", "text/plain")

    def _from_here(self) -> bool:
        """A page of another site whose name leads to this computer must not read the view."""
        host = self.headers.get("Host", "").rpartition(":")[0].strip("[]")
        return not self.view.local or host in LOOPBACK

    def _answer(self, status: HTTPStatus, body: bytes, kind: str) -> None:
        self.send_response(status)
        self.send_header("Content-Type", kind)
        self.send_header("Content-Length", str(len(body)))
        self.send_header("Cache-Control", "no-store")
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, format: str, *args: object) -> None:
        """Say nothing: the page asks ten times a second."""
