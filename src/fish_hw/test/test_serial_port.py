# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The serial transport on pseudo-terminals."""

import os
import pty
import sys
import termios
import tty

import pytest

from fish_hw.transport.interfaces import PortUnavailable, TransportError
from fish_hw.transport.serial_port import SerialPort


@pytest.fixture
def terminal():
    master, slave = pty.openpty()
    tty.setraw(master)
    tty.setraw(slave)
    yield master, os.ttyname(slave)
    for descriptor in (master, slave):
        try:
            os.close(descriptor)
        except OSError:
            continue  # a test pulled the plug


def test_bytes_both_ways(terminal):
    master, name = terminal
    port = SerialPort(name, 115200)
    port.write(b"\x55\x00\x0a\x0d\xff")
    assert os.read(master, 10) == b"\x55\x00\x0a\x0d\xff"
    os.write(master, b"\x03\x13\x11\xff")
    assert port.read(1.0) == b"\x03\x13\x11\xff"
    assert port.read(0.0) == b""
    port.close()


def test_port_has_the_speed_that_was_asked_for(terminal):
    master, name = terminal
    port = SerialPort(name, 57600)
    _, _, cflag, _, read_speed, write_speed, _ = termios.tcgetattr(master)
    assert (read_speed, write_speed) == (termios.B57600, termios.B57600)
    assert cflag & (termios.CSIZE | termios.PARENB | termios.CSTOPB) == termios.CS8  # 8N1
    port.close()


def test_port_is_exclusive(terminal):
    _, name = terminal
    port = SerialPort(name, 115200)
    with pytest.raises(PortUnavailable, match="another program holds it"):
        SerialPort(name, 115200)
    port.close()
    SerialPort(name, 115200).close()


def test_absent_port_lists_the_others():
    with pytest.raises(
        PortUnavailable,
        match="cannot open serial port /dev/ttyX9: there is no such port; available: ",
    ):
        SerialPort("/dev/ttyX9", 115200)


def test_something_that_is_no_serial_port():
    with pytest.raises(
        PortUnavailable, match="cannot open serial port /dev/null: it is no serial port"
    ):
        SerialPort("/dev/null", 115200)


def test_peer_gone(terminal):
    master, name = terminal
    port = SerialPort(name, 115200)
    os.close(master)
    with pytest.raises(TransportError, match="read failed"):
        port.read(0.1)
    with pytest.raises(TransportError, match="write failed"):
        port.write(b"x")
    port.close()


def test_closed_port(terminal):
    port = SerialPort(terminal[1], 115200)
    port.close()
    port.close()
    with pytest.raises(TransportError):
        port.read(0.1)
    with pytest.raises(TransportError):
        port.write(b"x")


def test_missing_library_names_the_package(monkeypatch):
    monkeypatch.setitem(sys.modules, "serial", None)
    with pytest.raises(PortUnavailable, match=r"pip install pyserial.*apt install python3-serial"):
        SerialPort("/dev/ttyX9", 115200)
