"""Command `safe_stop`: coast the rotor and centre the rudder, without ROS.

For systemd's ExecStopPost, which runs also after a node was killed: PWM outputs have no watchdog of their own
and go on with the last pulse.
"""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from fish_hw.devices.rudder_driver import RudderDriver
from fish_hw.devices.rudder_output import open_output
from fish_hw.devices.vertiq import Vertiq
from fish_hw.settings.parameter_file import read_parameter_file
from fish_hw.settings.rotor import RotorSettings
from fish_hw.settings.rudder import RudderSettings
from fish_hw.transport.errors import TransportError
from fish_hw.transport.serial_port import SerialPort


def stop_rotor(settings: RotorSettings) -> None:
    """Tell the module to coast; TransportError if the port is not there."""
    port = SerialPort(settings.port, settings.baud)
    try:
        Vertiq(port, settings.module_id).coast()
    finally:
        port.close()


def stop_rudder(settings: RudderSettings) -> None:
    """Centre the servo and end the pulses as the settings say; TransportError if the output is not there."""
    driver = RudderDriver(settings, lambda: open_output(settings))
    driver.connect()  # this centres
    driver.close()


def main(arguments: Sequence[str] | None = None) -> int:
    """Stop what is named; 1 if something could not be stopped, after trying everything."""
    parser = argparse.ArgumentParser(prog="safe_stop", description="Coast the rotor and centre the rudder.")
    parser.add_argument("--rotor", type=Path, help="parameter file of the rotor node")
    parser.add_argument("--rudder", type=Path, help="parameter file of the rudder node")
    options = parser.parse_args(arguments)
    if options.rotor is None and options.rudder is None:
        parser.error("nothing to stop: give --rotor FILE, --rudder FILE or both")
    failures = []
    try:
        if options.rotor is not None:
            stop_rotor(read_parameter_file(options.rotor, RotorSettings))
    except (TransportError, ValueError) as error:
        failures.append(f"rotor: {error}")
    try:
        if options.rudder is not None:
            stop_rudder(read_parameter_file(options.rudder, RudderSettings))
    except (TransportError, ValueError) as error:
        failures.append(f"rudder: {error}")
    for failure in failures:
        print(f"safe_stop: {failure}", file=sys.stderr)
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
