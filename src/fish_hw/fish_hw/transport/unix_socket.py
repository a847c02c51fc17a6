# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Ports of the fake robot (node fake_robot) as Unix sockets: an I2C bus and a camera, where the kernel has no emulation.

A device name that begins with `unix:` names the socket. I2C: a request (operation, address, count, data) and its answer (errno,
data). Camera: frames as (bytes, time of the exposure [s] on the
clock that both ends share: the computer's monotonic one, or simulated time) and JPEG.
"""

import os
import socket
import struct
import time
from collections.abc import Callable

from fish_hw.transport.interfaces import TransportError, unavailable
from fish_hw.transport.video_capture import Frame, compressed_frame

PREFIX = "unix:"
REQUEST, ANSWER = struct.Struct("<BBH"), struct.Struct("<hH")
FRAME = struct.Struct("<Id")
WRITE, READ = 0, 1
TIMEOUT_S = 1.0


def connect(device: str, what: str) -> socket.socket:
    """A connection to the socket of a device name; PortUnavailable if nobody listens there."""
    path = device.removeprefix(PREFIX)
    connection = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    connection.settimeout(TIMEOUT_S)
    try:
        connection.connect(path)
    except OSError as error:
        connection.close()
        reason = f"{error.strerror or error}; start the fake robot: ros2 run fish_hw fake_robot"
        raise unavailable(f"{what} {device}", reason, []) from error
    return connection


def receive(connection: socket.socket, count: int) -> bytes:
    """Exactly count bytes; OSError if the other end is gone or too slow."""
    data = b""
    while len(data) < count:
        piece = connection.recv(count - len(data))
        if not piece:
            raise ConnectionResetError("the fake robot is gone")
        data += piece
    return data


class SocketI2c:
    """I2cBus of the fake robot."""

    def __init__(self, bus: str) -> None:
        self._bus = bus
        self._connection = connect(bus, "I2C bus")

    def write(self, address: int, data: bytes) -> None:
        """One write message."""
        self._transfer(REQUEST.pack(WRITE, address, len(data)) + data, address)

    def read(self, address: int, count: int) -> bytes:
        """One read message of exactly count bytes."""
        return self._transfer(REQUEST.pack(READ, address, count), address)

    def close(self) -> None:
        """Close the connection."""
        self._connection.close()

    def _transfer(self, request: bytes, address: int) -> bytes:
        try:
            self._connection.sendall(request)
            code, count = ANSWER.unpack(receive(self._connection, ANSWER.size))
            data = receive(self._connection, count)
        except OSError as error:
            raise TransportError(f"I2C bus {self._bus}, device 0x{address:02x}: {error}") from error
        if code:
            said = os.strerror(code)
            raise TransportError(f"I2C bus {self._bus}, device 0x{address:02x}: {said}")
        return data


class SocketCamera:
    """Frame source of the fake robot: JPEG as a camera sends it.

    Args:
        device: name of the socket.
        own: the driver's time [s] of one on the clock that both ends share.
    """

    def __init__(self, device: str, own: Callable[[float], float] = lambda time_s: time_s) -> None:
        self._own = own
        self._connection: socket.socket | None = connect(device, "camera")

    def read(self) -> Frame | None:
        """The next frame, waiting for it; None if there was none."""
        if self._connection is None:
            time.sleep(0.1)  # the camera was unplugged: the driver decides when to open it again
            return None
        try:
            count, taken_s = FRAME.unpack(receive(self._connection, FRAME.size))
            return compressed_frame(self._own(taken_s), receive(self._connection, count))
        except TimeoutError:
            return None
        except OSError:
            self.close()
            return None

    def close(self) -> None:
        """Give the camera back."""
        if self._connection is not None:
            self._connection.close()
        self._connection = None
