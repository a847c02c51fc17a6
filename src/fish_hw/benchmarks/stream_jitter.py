# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Jitter of the rotor's 100 Hz commands compared with that of a bare loop, and the processor time of node rotor.

    python src/fish_hw/benchmarks/stream_jitter.py [--seconds 60]

The installed node drives an emulated module behind a pseudo-terminal of this process, which stamps every speed command. A
process that only sleeps until the next 10 ms runs meanwhile: what it jitters is the computer's. Measure on a quiet computer.
Status 1 if the node's p99 is above 3 ms or its processor time above 10 % of a core.
"""

import argparse
import itertools
import multiprocessing
import os
import statistics
import subprocess
import sys
import time
from multiprocessing.connection import Connection
from pathlib import Path

import rclpy
from ament_index_python.packages import get_package_prefix
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_srvs.srv import SetBool

from fish_hw.emulators.vertiq import VELOCITY_MODE, VertiqEmulator

PERIOD_S = 0.01
JITTER_S, CPU = 3e-3, 0.10  # what is allowed: p99 of the jitter, share of a core
DOMAIN = 172
ARMED_WITHIN_S = 60.0
# a busy computer must not end the measurement: nothing real moves
PARAMETERS = {
    "estimate": "ignored",
    "rudder_timeout_s": "0.0",
    "stale_s": "1.0",
    "answer_timeout_s": "2.0",
    "telemetry_timeout_s": "10.0",
    "module_timeout_s": "2.0",
}


def bare_loop(seconds: float, answer: Connection) -> None:
    """A process that wakes every PERIOD_S and does nothing."""
    due = time.monotonic()
    end, woken = due + seconds, []
    while due < end:
        due += PERIOD_S
        time.sleep(max(due - time.monotonic(), 0.0))
        woken.append(time.monotonic())
    answer.send(woken)


def jitter(times: list[float]) -> list[float]:
    """How far each interval [s] is from PERIOD_S, sorted."""
    return sorted(abs(b - a - PERIOD_S) for a, b in itertools.pairwise(times))


def p99(values: list[float]) -> float:
    """The value that 99 % of sorted values do not exceed."""
    return values[int(0.99 * len(values))]


def processor_time(pid: int) -> float:
    """User and system time [s] of a process."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


class Commander(Node):
    """Commands the rotor, and arms it."""

    def __init__(self) -> None:
        super().__init__("stream_jitter", namespace="fish")
        self._command = self.create_publisher(JointState, "joint_command", 1)
        self._arm = self.create_client(SetBool, "arm")

    def drive(self, seconds: float, module: VertiqEmulator | None = None) -> None:
        """Command for so long; with a module: ask to arm until it is driven."""
        end, due = time.monotonic() + seconds, time.monotonic()
        while time.monotonic() < end and not (module and module.mode == VELOCITY_MODE):
            if module and self._arm.service_is_ready():
                self._arm.call_async(SetBool.Request(data=True))
            message = JointState(name=["rotor", "rudder"], position=[0.0, 0.0])
            message.velocity = [30.0, 0.0]
            self._command.publish(message)
            due += PERIOD_S
            time.sleep(max(due - time.monotonic(), 0.0))


def measure(seconds: float) -> tuple[list[float], list[float], float]:
    """Times [s] of the node's commands and of the bare loop's wakes, and the node's share of a core."""
    module = VertiqEmulator()
    program = Path(get_package_prefix("fish_hw")) / "lib" / "fish_hw" / "rotor"
    given = [
        word for k, v in {"port": module.port, **PARAMETERS}.items() for word in ("-p", f"{k}:={v}")
    ]
    environment = {**os.environ, "ROS_DOMAIN_ID": str(DOMAIN)}
    process = subprocess.Popen([str(program), "--ros-args", *given], env=environment)
    rclpy.init(domain_id=DOMAIN)
    commander = Commander()
    try:
        commander.drive(ARMED_WITHIN_S, module)
        if module.mode != VELOCITY_MODE:
            raise RuntimeError(
                f"the rotor was not armed within {ARMED_WITHIN_S:g} s; see its log above"
            )
        ours, theirs = multiprocessing.get_context("spawn").Pipe(duplex=False)
        loop = multiprocessing.get_context("spawn").Process(
            target=bare_loop, args=(seconds, theirs)
        )
        loop.start()
        begin, used = time.monotonic(), processor_time(process.pid)
        commander.drive(seconds)
        share = (processor_time(process.pid) - used) / (time.monotonic() - begin)
        sent = [t for t, _ in module.commanded_at if t > begin]
        if module.mode != VELOCITY_MODE:
            raise RuntimeError("the rotor was disarmed on the way; see its log above")
        return sent, ours.recv(), share
    finally:
        process.terminate()
        process.wait(10)
        commander.destroy_node()
        rclpy.shutdown()
        module.close()


def main() -> int:
    """Measure, print, judge."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=60.0, help="how long (60)")
    sent, woken, share = measure(parser.parse_args().seconds)
    for name, times in (("node rotor", sent), ("bare loop", woken)):
        off = jitter(times)
        mean = (times[-1] - times[0]) / (len(times) - 1)
        print(
            f"{name:10}: {len(times)} periods of {1e3 * mean:.2f} ms; jitter median {1e3 * statistics.median(off):.2f},"
            f" p99 {1e3 * p99(off):.2f}, max {1e3 * off[-1]:.2f} ms"
        )
    print(f"node rotor: {100 * share:.1f} % of a core")
    print(f"load average {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores")
    return int(p99(jitter(sent)) > JITTER_S or share > CPU)


if __name__ == "__main__":
    sys.exit(main())
