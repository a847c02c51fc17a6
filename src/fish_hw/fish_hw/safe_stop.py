# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Command `safe_stop`: coast the rotor and centre the rudder, without ROS.

For systemd's ExecStopPost, which runs also after a node was killed: PWM outputs have no watchdog of their own
and go on with the last pulse.
"""

import argparse
import sys
from collections.abc import Sequence
from functools import partial
from pathlib import Path

from fish_hw.devices.rudder_driver import RudderDriver
from fish_hw.devices.rudder_output import open_output
from fish_hw.devices.vertiq import Vertiq
from fish_hw.settings import RotorSettings, RudderSettings
from fish_hw.transport.interfaces import TransportError
from fish_hw.transport.serial_port import SerialPort
from fish_node.parameter_file import read_settings

# what a stop needs; a mistake in another parameter must not keep the robot from being stopped
ROTOR = ("port", "baud", "module_id")
RUDDER = (
    *("backend", "chip", "bus", "address", "channel", "pca_clock_hz", "pwm_hz"),
    *("sign", "centre_us", "us_per_rad", "trim", "min_us", "max_us"),
    *("max_angle", "max_rate", "off_at_exit"),
)


def stop_rotor(path: Path) -> None:
    """Tell the module of a parameter file to coast; TransportError if the port is not there.

    An emulator has nothing to stop.
    """
    settings = read_settings(path, "/fish/rotor", RotorSettings, partial(_warn, "rotor"), ROTOR)
    if settings.port == "emulator":
        return
    port = SerialPort(settings.port, settings.baud)
    try:
        Vertiq(port, settings.module_id).coast()
    finally:
        port.close()


def stop_rudder(path: Path) -> None:
    """Centre the servo and end the pulses as the parameter file says; TransportError if that cannot be done.

    An emulator has nothing to stop.
    """
    settings = read_settings(path, "/fish/rudder", RudderSettings, partial(_warn, "rudder"), RUDDER)
    if settings.backend == "emulator":
        return
    driver = RudderDriver(settings, lambda: open_output(settings))
    driver.connect()  # this centres
    driver.make_safe()


def _warn(device: str, text: str) -> None:
    """A mistake that must not keep the robot from being stopped, least of all after a crash."""
    print(f"safe_stop: {device}: {text}; stopping it all the same", file=sys.stderr)


def main(arguments: Sequence[str] | None = None) -> int:
    """Stop what is named; 1 if something could not be stopped, after trying everything."""
    parser = argparse.ArgumentParser(
        prog="safe_stop", description="Coast the rotor and centre the rudder."
    )
    parser.add_argument("--rotor", type=Path, help="parameter file of the rotor node")
    parser.add_argument("--rudder", type=Path, help="parameter file of the rudder node")
    options = parser.parse_args(arguments)
    if options.rotor is None and options.rudder is None:
        parser.error("nothing to stop: give --rotor FILE, --rudder FILE or both")
    failed = False
    for name, path, stop in (
        ("rotor", options.rotor, stop_rotor),
        ("rudder", options.rudder, stop_rudder),
    ):
        try:
            if path is not None:
                stop(path)
        except Exception as error:  # whatever it is, the other device is still to be stopped
            failed = True
            expected = isinstance(error, TransportError | ValueError)
            print(f"safe_stop: {name}: {error if expected else repr(error)}", file=sys.stderr)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
