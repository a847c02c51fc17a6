# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Which executor runs the callbacks of a process, and how SIGINT and SIGTERM end it.

ByEvents: rclpy's EventsExecutor, to which the middleware hands each message. A callback costs a third less processor time than
with a wait set, however many entities the nodes have. It knows no guard conditions and no callbacks that take a message and
its info. Its wait without an end overflows in the wheels and delivers nothing, so that each wait has a limit. In the wheels its
timers, also those of a steady clock, stand still while the wall clock is set back, for as long as it is set back: whoever
stops a motor does not use it. It logs every error that a callback raises. A signal therefore raises none: it is a
task that ends the spinning once the callback before it has come to its end.

ByWaitSet: KeptWaitSetExecutor, which can do all of that. A signal ends the context at once.
"""

from __future__ import annotations

import gc
import signal
from collections.abc import Sequence
from typing import Protocol

import rclpy
from rclpy.executors import Executor, ExternalShutdownException
from rclpy.node import Node
from rclpy.qos import ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future

from fish_node.nodes.executor import KeptWaitSetExecutor, Polled, take_all

try:  # not in the first releases of Jazzy
    from rclpy.experimental import EventsExecutor
except ImportError:
    EventsExecutor = None  # type: ignore[assignment]

LONGEST_WAIT = (
    0.5  # s, after which an executor waits anew; a signal to an idle process is seen then
)
SIGNALS = (signal.SIGINT, signal.SIGTERM)


class Spin(Protocol):
    """Runs the callbacks of a process; used once."""

    def init(self, arguments: list[str] | None) -> None:
        """rclpy.init; from here on a signal is a wish to end."""
        ...

    def __call__(self, nodes: Sequence[Node]) -> None:
        """Run the callbacks until a signal comes or the context ends.

        Raises:
            ExternalShutdownException: the context ended.
            Exception: what a callback raised.
        """
        ...


class ByWaitSet:
    """With KeptWaitSetExecutor."""

    def init(self, arguments: list[str] | None) -> None:
        """rclpy.init with its handlers of signals."""
        rclpy.init(args=arguments)
        self._executor = KeptWaitSetExecutor()  # half made by a signal it would complain

    def __call__(self, nodes: Sequence[Node]) -> None:
        """Run the callbacks; see Spin."""
        _add(self._executor, nodes)
        try:
            while nodes[0].context.ok():
                self._executor.spin_once()
            raise ExternalShutdownException
        finally:
            self._executor.shutdown()


class ByEvents:
    """With rclpy's EventsExecutor; where rclpy has none as ByWaitSet."""

    def __init__(self) -> None:
        self._asked = False
        self._executor: Executor | None = None
        self._instead = ByWaitSet() if EventsExecutor is None else None

    def init(self, arguments: list[str] | None) -> None:
        """rclpy.init with handlers of signals that interrupt nothing."""
        if self._instead is not None:
            self._instead.init(arguments)
            return
        for number in SIGNALS:
            signal.signal(number, self._on_signal)
        rclpy.init(args=arguments, signal_handler_options=SignalHandlerOptions.NO)

    def _on_signal(self, *_: object) -> None:
        self._asked = True
        if self._executor is not None:
            self._executor.create_task(self._end.set_result, None)

    def __call__(self, nodes: Sequence[Node]) -> None:
        """Run the callbacks; see Spin."""
        if self._instead is not None:
            self._instead(nodes)
            return
        context, self._end = nodes[0].context, Future()
        executor = self._executor = EventsExecutor(context=context)
        _add(executor, nodes)
        try:
            while not self._asked:
                if not context.ok():
                    raise ExternalShutdownException
                executor.spin_until_future_complete(self._end, LONGEST_WAIT)
        finally:
            self._executor = None
            executor.shutdown()


def _add(executor: Executor, nodes: Sequence[Node]) -> None:
    for node in nodes:
        forget_backlog(node)
        executor.add_node(node)
    gc.freeze()  # what nodes were made of stays: the collector need not look at it again and again


def forget_backlog(node: Node) -> None:
    """Drop what sensors said while the nodes of this process were being made.

    Executors take one topic's backlog after the other: a camera's poses of the last second would come behind the newest IMU
    samples, as if they were so late, and fusion judges clocks by that. Sensors are who is heard best effort. Reliable topics and
    those that their node polls keep their messages.
    """
    for subscription in node.subscriptions:
        sensor = subscription.qos_profile.reliability == ReliabilityPolicy.BEST_EFFORT
        if sensor and not isinstance(subscription.callback_group, Polled):
            for _ in take_all(subscription):
                pass
