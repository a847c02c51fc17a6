# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""What the four driver nodes share: parameters, the thread that owns the device, diagnostics, the way to
end, a joint of a JointState.
"""

import signal
import sys
import time
from collections.abc import Callable
from typing import Any, Protocol

import rclpy
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy._rclpy_pybind11 import RCLError
from rclpy.clock import Clock, ClockType
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from sensor_msgs.msg import JointState

from fish_hw.devices.reconnect import WARN, DeviceError, Doubt, Loss, Status
from fish_hw.nodes.worker import Worker
from fish_hw.transport.interfaces import TransportError
from fish_node.nodes.executor import KeptWaitSetExecutor
from fish_node.nodes.robot_clock import RobotClock
from fish_node.nodes.start import ended_within, read_parameters, shut_down
from fish_node.nodes.status_log import StatusLog

NAMESPACE = "fish"
END_TIMEOUT_S = 2.0
MIDDLEWARE_END_S = 10.0
CLOCK_WAIT_S = 0.01
NO_CLOCK = (
    "use_sim_time is true, but there is no time on /clock: start the simulator, or set it to false"
)
EXPECTED = (TransportError, DeviceError, ValueError)


class Device(Protocol):
    """A driver as this node sees it."""

    @property
    def connected(self) -> bool:
        """Whether the device answers."""
        ...

    def connect(self) -> None:
        """Find it or raise."""
        ...

    def close(self) -> None:
        """Make it safe and give it back."""
        ...

    def status(self) -> Status:
        """For diagnostics."""
        ...


class DeviceNode(Node):
    """A node around one device.

    Args:
        name: of the node, relative to the namespace.
        settings_class: dataclass whose fields are the parameters.
    """

    def __init__(self, name: str, settings_class: type[Any]) -> None:
        super().__init__(
            name, namespace=NAMESPACE, automatically_declare_parameters_from_overrides=True
        )
        self.settings = read_parameters(self, settings_class)
        self.clock = RobotClock(self)
        self.failure = ""
        self._device: Device | None = None
        self._repeat: tuple[Callable[[], None], float] | None = None  # step, period [s]
        self._emulated = False
        self._worker: Worker | None = None
        wait_s = self.settings.startup_timeout_s or float("inf")
        self._give_up_s = time.monotonic() + wait_s
        self._diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", 10)
        self._log = StatusLog(self.get_logger())
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(1.0, self._on_diagnostics, clock=steady)

    def use(
        self, device: Device, step: Callable[[], None], period_s: float, emulated: bool
    ) -> None:
        """What begin() is to connect, and what it is to repeat then."""
        self._device, self._repeat, self._emulated = device, (step, period_s), emulated

    def begin(self) -> None:
        """Connect and begin to repeat the step; a device that is absent is waited for as the settings say.

        With simulated time the first step connects, once that time runs.

        Apart from the constructor: a signal may come at any moment, and only a node that its caller has can be closed.
        """
        assert self._device is not None
        assert self._repeat is not None
        device, (step, period_s) = self._device, self._repeat
        if self.clock.runs:
            self._connect(device)
        self._worker = Worker(
            lambda: self._step(device, step),
            period_s,
            self._on_failure,
            self.clock.now,
            self.clock.wall,
        )
        self._worker.start()

    def close(self) -> None:
        """Stop the thread and leave the device safe."""
        if self._worker is not None:
            self._worker.stop(END_TIMEOUT_S)
        if self._device is not None:
            self._device.close()

    def stamp(self, time_s: float) -> Time:
        """ROS time of a moment on the node's clock."""
        return self.clock.stamp(time_s)

    def publish(self, publisher: Any, message: Any) -> None:
        """Publish, unless the node is about to end (the device's thread lives a little longer than the
        context).
        """
        try:
            publisher.publish(message)
        except RCLError:
            if self.context.ok():
                raise

    def log_events(self, events: list[str]) -> None:
        """One line per event, losses as errors, doubts as warnings."""
        for event in events:
            if isinstance(event, Loss):
                self.get_logger().error(event)
            elif isinstance(event, Doubt):
                self.get_logger().warning(event)
            else:
                self.get_logger().info(event)

    def _connect(self, device: Device) -> None:
        try:
            device.connect()
        except (TransportError, DeviceError) as error:
            limit_s = self.settings.startup_timeout_s
            how_long = f"for {limit_s:g} s" if limit_s else "until it is there"
            self.get_logger().error(f"{error}; trying {how_long}")
        else:
            self.get_logger().info("emulated device ready" if self._emulated else "device ready")

    def _step(self, device: Device, step: Callable[[], None]) -> None:
        if not self.clock.runs:
            time.sleep(CLOCK_WAIT_S)
            return
        step()
        if device.connected:
            self._give_up_s = float("inf")  # from now on it is waited for without end
        else:
            self._give_up_late(device)

    def _give_up_late(self, device: Device) -> None:
        if time.monotonic() > self._give_up_s:
            self.failure = self._status(device).message
            self.context.try_shutdown()

    def _status(self, device: Device) -> Status:
        return device.status() if self.clock.runs else Status(WARN, NO_CLOCK)

    def _on_failure(self) -> None:
        """A step raised what nobody expected: that must not leave the device as it is."""
        self.failure = "the device's thread ended unexpectedly"
        if self._device is not None:
            self._device.close()
        self.context.try_shutdown()

    def _on_diagnostics(self) -> None:
        if self._device is None:
            return
        status = self._status(self._device)
        if self._emulated:  # nobody should go to the pool with it
            status = Status(
                max(status.level, WARN), f"{status.message} (emulated device)", status.values
            )
        self._log.say(bytes([status.level]), status.message)
        message = DiagnosticArray()
        message.header.stamp = self.get_clock().now().to_msg()
        message.status = [
            DiagnosticStatus(
                level=bytes([status.level]),
                name=self.get_fully_qualified_name().lstrip("/"),
                message=status.message,
                hardware_id=self.get_name(),
                values=[
                    KeyValue(key=key, value=str(value)) for key, value in status.values.items()
                ],
            )
        ]
        self._diagnostics.publish(message)
        if not self.clock.runs:  # the device's thread waits for it
            self._give_up_late(self._device)


def run(make_node: Callable[[], DeviceNode], name: str) -> None:
    """Run a node until SIGINT or SIGTERM (exit code 0), or until it cannot go on (one line, exit code 1).

    A signal may come while the node is being made or opens its device: what it makes fail is no failure, and the device is
    left safe.
    """
    try:
        rclpy.init()
    except (RCLError, ValueError) as error:
        sys.exit(f"{name}: {one_line(error)}")
    failure = ""
    node: DeviceNode | None = None
    try:
        executor = (
            KeptWaitSetExecutor()
        )  # before the node: a signal while it is made upsets rclpy.spin
        node = make_node()
        node.begin()
        executor.add_node(node)
        executor.spin()
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    except Exception as error:
        if rclpy.ok():  # else the context's end brought it about
            if not isinstance(error, EXPECTED):
                raise
            failure = one_line(error)
    finally:
        for number in (
            signal.SIGINT,
            signal.SIGTERM,
        ):  # a second Ctrl-C must not interrupt the way to safety
            signal.signal(number, signal.SIG_IGN)
        if node is not None:
            node.close()
            failure = failure or node.failure
        if failure:
            print(f"{name}: {failure}", file=sys.stderr, flush=True)
        with ended_within(MIDDLEWARE_END_S):  # the device is safe
            if node is not None:
                node.destroy_node()
            shut_down()
    if failure:
        sys.exit(1)


def one_line(error: Exception) -> str:
    """The error's text without line breaks."""
    return " ".join(str(error).split())


def joint_value(message: JointState, name: str, field: str) -> float | None:
    """message.<field> of the joint `name`; None if the joint is absent or has no such value."""
    values = getattr(message, field)
    if name not in message.name:
        return None
    index = message.name.index(name)
    return float(values[index]) if index < len(values) else None
