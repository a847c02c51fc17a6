# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Registers of a Vertiq 40-06 (speed firmware) that the rotor needs.

Source: iq-module-communication-doc, docs/clients; numbers as in the vendor's client files.
"""

import struct
from dataclasses import dataclass

from fish_hw.protocol.iquart import GET, SET, Message


@dataclass(frozen=True)
class Register:
    """One entry: address (type, param), struct code of its value ("" for none), name with unit."""

    type: int
    param: int
    format: str
    name: str

    def set(self, module: int, value: float | None = None) -> Message:
        """The message that writes value (None for a register without one)."""
        data = struct.pack("<" + self.format, value) if self.format else b""
        return Message(self.type, self.param, SET, module, data)

    def get(self, module: int) -> Message:
        """The message that asks for the value."""
        return Message(self.type, self.param, GET, module)

    def values(self, data: bytes) -> tuple[float, ...] | None:
        """Numbers in the data of a reply; None if the size is wrong."""
        if len(data) != struct.calcsize("<" + self.format):
            return None
        return struct.unpack("<" + self.format, data)


CTRL_MODE = Register(52, 0, "b", "control mode")
CTRL_COAST = Register(52, 2, "", "coast")
CTRL_VELOCITY = Register(52, 5, "f", "velocity command [rad/s]")
VELOCITY_KP = Register(52, 7, "f", "velocity Kp [V s/rad]")
VELOCITY_KI = Register(52, 8, "f", "velocity Ki [V/rad]")
VELOCITY_KD = Register(52, 9, "f", "velocity Kd [V s^2/rad]")
VELOCITY_FF1 = Register(52, 11, "f", "velocity feed-forward [V s/rad]")
TIMEOUT = Register(52, 15, "f", "timeout [s]")
INPUT_FILTER = Register(52, 16, "I", "command filter [Hz]")
TIMEOUT_MEANING = Register(52, 17, "B", "timeout meaning")
TIMEOUT_BEHAVIOR = Register(52, 18, "B", "timeout behaviour")
TIMEOUT_SONG = Register(52, 19, "B", "timeout song")
OBS_ANGLE = Register(50, 12, "f", "angle [rad], wrapped to +-pi")
OBS_VELOCITY = Register(50, 13, "f", "velocity [rad/s]")
DERATE = Register(50, 41, "i", "derating, 65536 = none")
FAULT_NOW = Register(84, 0, "B", "faults present")
FAULT_EVER = Register(84, 1, "B", "faults since cleared")
FIRMWARE = Register(5, 16, "I", "firmware version")
TELEMETRY = Register(88, 1, "hhhhhhI", "telemetry")

COAST, NO_MODE, BRAKE = 1, -1, 0
RESTING_MODES = (NO_MODE, BRAKE, COAST)
DERATE_NONE = 65536
FAULT_BITS = (
    "logic supply low",
    "input voltage",
    "reference voltage",
    "supply current",
    "motor current",
    "controller temperature",
    "coil temperature",
)
TUNING = (VELOCITY_KP, VELOCITY_KI, VELOCITY_KD, VELOCITY_FF1, INPUT_FILTER, FIRMWARE)


def fault_names(bits: int) -> list[str]:
    """The faults in a FAULT_NOW or FAULT_EVER byte in words."""
    return [name for bit, name in enumerate(FAULT_BITS) if bits >> bit & 1]
