# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""A serial port by pyserial, opened exclusively, with every failure turned into a TransportError."""

import errno
import os
import select
import termios
import time
from typing import Any

from fish_hw.transport.interfaces import PortUnavailable, TransportError, unavailable

WRITE_TIMEOUT_S = 0.1  # 1000 bytes at 115200 baud take 87 ms
READ_BYTES = 4096

REASONS = {
    errno.ENOENT: "there is no such port",
    errno.EACCES: "no permission (add the user to group dialout)",
    errno.EAGAIN: "another program holds it",
    errno.EBUSY: "another program holds it",
    errno.EISDIR: "it is a folder",
    errno.ENOTTY: "it is no serial port",
}


def import_pyserial() -> Any:
    """The serial module, or PortUnavailable that says how to install it."""
    try:
        import serial
        import serial.tools.list_ports
    except ImportError as error:
        raise PortUnavailable(
            "serial ports need pyserial: pip install pyserial==3.5, or apt install python3-serial"
        ) from error
    return serial


class SerialPort:
    """ByteStream on a serial device, 8N1.

    pyserial raises SerialException, bare OSError and termios.error (no OSError) for one and the same
    unplugged cable; all become TransportError here.
    """

    def __init__(self, port: str, baud: int) -> None:
        serial = import_pyserial()
        self.port = port
        self._failures = (serial.SerialException, OSError, termios.error)
        try:
            self._serial: Any = serial.Serial(
                port, baud, timeout=0, write_timeout=WRITE_TIMEOUT_S, exclusive=True
            )
        except (*self._failures, ValueError) as error:
            code = getattr(error, "errno", None)
            if isinstance(error.__context__, termios.error):  # pyserial drops its number
                code = error.__context__.args[0]
            reason = REASONS.get(code or 0, str(error))
            raise unavailable(f"serial port {port}", reason, other_ports(serial, port)) from error
        self._ask_for_low_latency()

    def write(self, data: bytes) -> None:
        """Send all of data; TransportError if the line does not take it within WRITE_TIMEOUT_S.

        pyserial's own time-out also blames the line for a process that a busy computer let stand still.
        """
        end, rest = time.monotonic() + WRITE_TIMEOUT_S, memoryview(data)
        try:
            while rest := rest[self._write_some(rest) :]:
                left = max(end - time.monotonic(), 0.0)
                if not select.select([], [self._serial.fileno()], [], left)[1]:
                    raise TransportError(
                        f"serial port {self.port}: write failed: the line takes nothing for {WRITE_TIMEOUT_S:g} s"
                    )
        except (*self._failures, ValueError) as error:
            raise TransportError(f"serial port {self.port}: write failed: {error}") from error

    def read(self, timeout_s: float) -> bytes:
        """Bytes that arrived, waiting at most timeout_s for the first; empty if none came."""
        try:
            fd = self._serial.fileno()
            if not select.select([fd], [], [], timeout_s)[0]:
                return b""
            if data := os.read(fd, READ_BYTES):
                return data
        except BlockingIOError:
            return b""
        except (*self._failures, ValueError) as error:  # ValueError: select on a closed descriptor
            raise TransportError(f"serial port {self.port}: read failed: {error}") from error
        raise TransportError(f"serial port {self.port}: read failed: the device is gone")

    def _write_some(self, data: memoryview) -> int:
        """Bytes that the line took at once."""
        try:
            return os.write(self._serial.fileno(), data)
        except BlockingIOError:
            return 0

    def close(self) -> None:
        """Close the port; errors of a port that is gone already do not matter."""
        try:
            self._serial.close()
        except self._failures:
            return

    def _ask_for_low_latency(self) -> None:
        """USB adapters hold replies back for 16 ms unless asked not to; pseudo-terminals cannot be asked."""
        try:
            self._serial.set_low_latency_mode(True)
        except (*self._failures, ValueError):
            return


def other_ports(serial: Any, port: str) -> list[str]:
    """Serial ports of this machine other than the one asked for."""
    return sorted(p.device for p in serial.tools.list_ports.comports() if p.device != port)
