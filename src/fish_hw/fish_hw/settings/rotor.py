# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Parameters of the rotor node."""

from dataclasses import dataclass

from fish_hw.settings.checks import require_choice, require_range
from fish_node.arming import ArmingSettings
from fish_node.frames import require_frame, require_frame_prefix

CYCLES = 3  # that a command or an answer may be late without anything being stopped


@dataclass(frozen=True)
class RotorSettings(ArmingSettings):
    """Vertiq module, its limits, and what disarms the robot."""

    port: str = "/dev/serial0"  # serial device, or "emulator"
    baud: int = 115200  # bit/s; must be what the module is set to
    module_id: int = 0  # 0 to 63
    startup_timeout_s: float = (
        0.0  # s to wait for the module at start, then the node ends with an error; 0: without end
    )
    rate_hz: float = 100.0  # Hz, commands to the module and joint_states
    reply_timeout_s: float = 0.008  # s to wait for the answers of one cycle
    sign: int = 1  # -1 if positive speed of the motor turns the rotor clockwise seen from above
    max_velocity: float = 160.0  # rad/s; full throttle at 2 Hz needs 150.8
    max_acceleration: float = 2200.0  # rad/s^2; full throttle at 2 Hz needs 1895
    stale_s: float = 0.2  # s without a command until the robot is disarmed; 3 / rate_hz at least
    ramp_s: float = (
        0.1  # s from the last speed to zero, then coast; longer if max_acceleration says so
    )
    module_timeout_s: float = (
        0.25  # s without any byte until it coasts by itself; 3 / rate_hz at least
    )
    answer_timeout_s: float = 0.15  # s without measured speed until the module is given up
    telemetry_timeout_s: float = (
        0.15  # s without battery, temperatures or faults until the robot is disarmed
    )
    rudder_timeout_s: float = (
        0.2  # s without a word of node rudder until the robot is disarmed; 0: no rudder
    )
    leak_chip: str = "/dev/gpiochip0"  # GPIO chip of the leak sensor
    leak_line: int = -1  # line of the leak sensor (BCM number), with pull-up; -1 no sensor
    leak_level: str = "low"  # low | high: level of the line when the sensor is wet
    battery_cells: int = 4  # cells in series
    cell_warn_v: float = 3.5  # V per cell, filtered
    cell_stop_v: float = 3.3  # V per cell, filtered: the robot is disarmed
    cell_over_v: float = (
        4.3  # V per cell, two answers in a row: disarmed, braking energy has nowhere to go
    )
    battery_filter_s: float = 0.4  # s, the rotor's load ripples at 4 Hz
    temperature_warn_c: float = 70.0  # deg C, coil or controller
    temperature_stop_c: float = 85.0  # deg C, coil or controller: the robot is disarmed
    frame_id: str = "base_link"  # of joint_states
    frame_prefix: str = ""  # before every frame but the pool's, such as fish_2/ for a second fish

    def __post_init__(self) -> None:
        super().__post_init__()
        require_frame("frame_id", self.frame_id)
        require_frame_prefix(self.frame_prefix)
        require_range("baud", self.baud, 9600, 3_000_000)
        require_range("module_id", self.module_id, 0, 63)
        require_range("startup_timeout_s", self.startup_timeout_s, 0.0, 3600.0)
        require_range("rate_hz", self.rate_hz, 20.0, 200.0)
        shortest_s = round(CYCLES / self.rate_hz, 4)
        require_range("reply_timeout_s", self.reply_timeout_s, 0.001, 0.2)
        require_choice("sign", self.sign, (1, -1))
        require_range("max_velocity", self.max_velocity, 0.0, 500.0)
        require_range("max_acceleration", self.max_acceleration, 1.0, 1e4)
        require_range("stale_s", self.stale_s, shortest_s, 1.0)
        require_range("ramp_s", self.ramp_s, 0.0, 1.0)
        require_range("module_timeout_s", self.module_timeout_s, max(shortest_s, 0.05), 2.0)
        require_range("answer_timeout_s", self.answer_timeout_s, shortest_s, 2.0)
        require_range("telemetry_timeout_s", self.telemetry_timeout_s, 0.1, 10.0)
        require_range("rudder_timeout_s", self.rudder_timeout_s, 0.0, 5.0)
        require_range("leak_line", self.leak_line, -1, 511)
        require_choice("leak_level", self.leak_level, ("low", "high"))
        require_range("battery_cells", self.battery_cells, 1, 6)
        require_range("cell_stop_v", self.cell_stop_v, 0.0, 5.0)
        require_range("cell_warn_v", self.cell_warn_v, self.cell_stop_v, 5.0)
        require_range("cell_over_v", self.cell_over_v, self.cell_warn_v, 6.0)
        require_range("battery_filter_s", self.battery_filter_s, 0.0, 60.0)
        require_range("temperature_warn_c", self.temperature_warn_c, 0.0, 150.0)
        require_range("temperature_stop_c", self.temperature_stop_c, self.temperature_warn_c, 150.0)
