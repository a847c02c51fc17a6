# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The fake robot's ends of the Unix sockets: an I2C bus with emulated devices, and a camera."""

import contextlib
import errno
import os
import socket
import threading
import traceback
from collections.abc import Callable
from pathlib import Path

from fish_hw.emulators.i2c_bus import I2cDevice
from fish_hw.transport.unix_socket import ANSWER, FRAME, READ, REQUEST, receive

LOOK_S = 0.1  # s between looks at a driver that gets no picture


class Listener:
    """A Unix socket that serves one connection after the other on a thread of its own."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._server: socket.socket | None = None
        self._connection: socket.socket | None = None
        self._lock = threading.Lock()  # a connection may be accepted while the plug is pulled
        self.plug()

    def plug(self) -> None:
        """Listen; nothing happens where it listens already."""
        if self._server is not None:
            return
        self._path.unlink(missing_ok=True)
        self._server = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self._server.bind(str(self._path))
        self._server.listen(1)
        threading.Thread(target=self._accept, args=(self._server,), daemon=True).start()

    def unplug(self) -> None:
        """End the connection and listen no more, as pulling the plug does."""
        with self._lock:
            server, self._server = self._server, None
            connection, self._connection = self._connection, None
        if server is not None:
            # a thread that waits in accept() keeps the socket alive unless it is shut down first
            server.shutdown(socket.SHUT_RDWR)
            server.close()
        self._path.unlink(missing_ok=True)
        if connection is not None:
            close(connection)

    def serve(self, connection: socket.socket) -> None:
        """What happens with a connection; OSError ends it."""
        raise NotImplementedError

    def _accept(self, server: socket.socket) -> None:
        while True:
            try:
                connection, _ = server.accept()
            except OSError:  # unplugged
                return
            with self._lock:
                plugged = self._server is server
                if plugged:
                    self._connection = connection
            if not plugged:
                close(connection)
                return
            try:
                self.serve(connection)
            except OSError:
                close(connection)
            except (
                Exception
            ):  # what a driver sent, or a mistake here: the next connection is served
                traceback.print_exc()
                close(connection)


def close(connection: socket.socket) -> None:
    """Close a connection that another thread may be reading."""
    try:
        connection.shutdown(socket.SHUT_RDWR)
    except OSError:  # the other end was faster
        pass
    finally:
        connection.close()


class SocketBus(Listener):
    """An I2C bus; `fault` may return an errno to fail a transfer with."""

    def __init__(self, path: Path, devices: dict[int, I2cDevice]) -> None:
        self.devices = devices
        self.fault: Callable[[], int | None] = lambda: None
        super().__init__(path)

    def serve(self, connection: socket.socket) -> None:
        """Requests until the driver is gone."""
        while True:
            operation, address, count = REQUEST.unpack(receive(connection, REQUEST.size))
            written = b"" if operation == READ else receive(connection, count)
            code = self.fault()
            device = self.devices.get(address)
            if code is None and device is None:
                code = errno.EREMOTEIO
            data = b""
            if code is None and device is not None:
                if operation == READ:
                    data = device.read(count)
                else:
                    device.write(written)
            connection.sendall(ANSWER.pack(code or 0, len(data)) + data)


class SocketPictures(Listener):
    """A camera; `frozen` sends the picture of the moment again and again, with new times.

    A camera waits for nobody: a driver that is slow gets the newest picture and misses those before.
    """

    def __init__(self, path: Path) -> None:
        self.frozen = False
        self._newest: tuple[bytes, float] = (b"", 0.0)
        self._shown = threading.Condition()
        super().__init__(path)

    def serve(self, connection: socket.socket) -> None:
        """Send what is shown until the driver is gone."""
        sent = self._newest
        while self._connection is connection:
            with self._shown:
                if self._newest is sent:
                    self._shown.wait(LOOK_S)
                newest = self._newest
            if newest is not sent:
                sent = newest
                connection.sendall(FRAME.pack(len(sent[0]), sent[1]) + sent[0])
            with contextlib.suppress(BlockingIOError):  # the driver says nothing but its end
                connection.recv(1, socket.MSG_DONTWAIT)
                raise ConnectionResetError(os.strerror(errno.ECONNRESET))

    def show(self, jpeg: bytes, taken_s: float) -> None:
        """Send a picture taken at taken_s [s, the driver's clock] to the driver, if there is one."""
        with self._shown:
            before, _ = self._newest
            self._newest = (before if self.frozen and before else jpeg, taken_s)
            self._shown.notify()
