"""Parameters of the rotor node."""

from dataclasses import dataclass

from fish_hw.settings.checks import require_choice, require_range

CYCLES = 3  # that a command or an answer may be late without anything being stopped
RESUME = ("zero", "auto", "manual")


@dataclass(frozen=True)
class RotorSettings:
    """Vertiq module, its limits, and what happens when commands stop.

    resume says what ends a stop: "zero" a command stream at rest for rearm_s (or the enable service), "auto"
    any fresh command, "manual" the enable service only.
    """

    port: str = "/dev/serial0"  # serial device, or "emulator"
    baud: int = 115200  # bit/s; must be what the module is set to
    module_id: int = 0  # 0 to 63
    startup_timeout_s: float = (
        0.0  # s to wait for the port at start; then the node ends with an error
    )
    rate_hz: float = 100.0  # Hz, commands to the module and joint_states
    reply_timeout_s: float = 0.008  # s to wait for the answers of one cycle
    sign: int = 1  # -1 if positive speed of the motor turns the rotor clockwise seen from above
    max_velocity: float = 160.0  # rad/s; full throttle at 2 Hz needs 150.8
    max_acceleration: float = 2200.0  # rad/s^2; full throttle at 2 Hz needs 1895
    stale_s: float = 0.15  # s without a command until the rotor is stopped; 3 / rate_hz at least
    ramp_s: float = (
        0.25  # s from the last speed to zero, then coast; at most one period of the oscillation
    )
    module_timeout_s: float = (
        0.25  # s without any byte until it coasts by itself; 3 / rate_hz at least
    )
    resume: str = "zero"  # zero | auto | manual
    rearm_s: float = 0.3  # s of commands at rest that end a stop (resume: zero)
    battery_cells: int = 4  # cells in series
    cell_warn_v: float = 3.5  # V per cell, filtered
    cell_stop_v: float = 3.3  # V per cell, filtered: the rotor stops
    cell_over_v: float = 4.3  # V per cell, unfiltered: braking energy has nowhere to go
    battery_filter_s: float = 5.0  # s, the rotor's load ripples at 4 Hz
    temperature_warn_c: float = 70.0  # deg C, coil or controller
    temperature_stop_c: float = 85.0  # deg C, coil or controller: the rotor stops
    frame_id: str = "base_link"

    def __post_init__(self) -> None:
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
        require_choice("resume", self.resume, RESUME)
        require_range("rearm_s", self.rearm_s, 0.0, 10.0)
        require_range("battery_cells", self.battery_cells, 1, 6)
        require_range("cell_stop_v", self.cell_stop_v, 0.0, 5.0)
        require_range("cell_warn_v", self.cell_warn_v, self.cell_stop_v, 5.0)
        require_range("cell_over_v", self.cell_over_v, self.cell_warn_v, 6.0)
        require_range("battery_filter_s", self.battery_filter_s, 0.0, 60.0)
        require_range("temperature_warn_c", self.temperature_warn_c, 0.0, 150.0)
        require_range("temperature_stop_c", self.temperature_stop_c, self.temperature_warn_c, 150.0)
