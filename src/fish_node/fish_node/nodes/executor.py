# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""An executor that keeps its wait set: rclpy's own builds it anew for every callback, and twice.

rclpy's SingleThreadedExecutor collects all entities of all nodes before every wait. Each callback also triggers the
executor's own guard condition, so that the next wait returns at once without work. For a node that hears 100 messages a
second this takes most of its processor time. Here the entities are collected when they change, and callbacks run directly.
What rclpy does in a callback is left to rclpy. Subscriptions of a Polled group are not waited for.

Every publisher and subscription also has events, such as an offer that does not fit. To add them to the wait set takes most
of the time of a wait, and who waits for a subscription's events wakes up for its messages. So they are looked at once a second.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Coroutine, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from rclpy._rclpy_pybind11 import InvalidHandle, WaitSet
from rclpy.callback_groups import CallbackGroup
from rclpy.event_handler import EventHandler
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.subscription import Subscription
from rclpy.waitable import NumberOfEntities, Waitable

EVENTS_S, EVENTS_NS = 1.0, 1_000_000_000  # between two looks at the events
Work = Callable[[], Coroutine[Any, Any, None]] | None  # what rclpy's _take_.. functions give
Take = Callable[[Any], Work]


@dataclass(frozen=True)
class Waited:
    """The wait set with room for everything that is waited for.

    Attributes:
        events: of publishers and subscriptions.
        waitables: everything else of this kind.
        added: functions that add a handle to the wait set, each with its handles.
        taken: kinds of entities in the order in which their callbacks run; of each the entities by the address of their
            handle, and rclpy's function that takes an event of one.
    """

    wait_set: WaitSet
    events: tuple[Waitable, ...]
    waitables: tuple[Waitable, ...]
    added: tuple[tuple[Callable[[Any], object], tuple[Any, ...]], ...]
    taken: tuple[tuple[str, Mapping[int, Any], Take], ...]

    def fill(self, events: bool) -> tuple[Waitable, ...]:
        """Put everything into the wait set anew, the events only if so said; the waitables that are in it.

        Raises:
            InvalidHandle: something was destroyed.
        """
        self.wait_set.clear_entities()
        for add, handles in self.added:
            for handle in handles:
                add(handle)
        waitables = self.waitables + self.events if events else self.waitables
        for waitable in waitables:
            waitable.add_to_wait_set(self.wait_set)
        return waitables


class Polled(CallbackGroup):
    """Subscriptions that no executor takes messages of: their node looks by itself when it wants to (take_all)."""

    def can_execute(self, _: Any) -> bool:
        """Never."""
        return False

    def beginning_execution(self, _: Any) -> bool:
        """Never."""
        return False

    def ending_execution(self, _: Any) -> None:
        """Nothing was begun."""


def take_all(subscription: Subscription) -> Iterator[tuple[Any, dict[str, Any]]]:
    """Take every message that waits, with what the middleware says of it, oldest first."""
    with subscription.handle:
        while taken := subscription.handle.take_message(subscription.msg_type, subscription.raw):
            yield taken


class KeptWaitSetExecutor(SingleThreadedExecutor):
    """SingleThreadedExecutor with a wait set that lasts until an entity is made or destroyed.

    One thread spins it. Entities are made and destroyed in that thread's callbacks, or while it does not spin.
    """

    def __init__(self, **options: Any) -> None:
        self._waited: Waited | None = None  # None: to be collected
        self._events_due = 0.0  # s of the monotonic clock
        super().__init__(**options)

    def add_node(self, node: Node) -> bool:
        """As rclpy's."""
        self._waited = None
        return super().add_node(node)

    def remove_node(self, node: Node) -> None:
        """As rclpy's."""
        self._waited = None
        super().remove_node(node)

    def wake(self) -> None:
        """As rclpy's: nodes call it when an entity was made or destroyed."""
        self._waited = None
        super().wake()

    def shutdown(self, timeout_sec: float | None = None) -> bool:
        """As rclpy's."""
        self._waited = None
        return super().shutdown(timeout_sec)

    def spin_once(self, timeout_sec: float | None = None) -> None:
        """Wait without an end and run all callbacks that are ready; with a time limit exactly rclpy's.

        Raises:
            ExternalShutdownException: the context was shut down.
            Exception: what a callback raised.
        """
        if timeout_sec is not None or self._is_shutdown:
            super().spin_once(timeout_sec)
            return
        if self._tasks:  # coroutines that wait for something
            super().spin_once(0.0)
        for work in self._ready():
            if work is not None:
                self._run(work())

    def _run(self, coroutine: Coroutine[Any, Any, None]) -> None:
        """Run rclpy's handling of one event; one that waits for something goes on as a task of rclpy's."""
        try:
            coroutine.send(None)
        except StopIteration:
            return
        self.create_task(coroutine)

    def _ready(self) -> Iterator[Work]:
        """Wait, then take every event that is ready, one after the other."""
        self._check_context()
        waited = self._waited = self._waited or self._collect()
        wait_set = waited.wait_set
        events = (now := time.monotonic()) >= self._events_due
        if events:
            self._events_due = now + EVENTS_S
        try:
            waitables = waited.fill(events)
        except InvalidHandle:  # destroyed since: collect again
            self._waited = None
            return
        wait_set.wait(0 if events else EVENTS_NS)
        self._check_context()
        # all that is ready is known before a callback can change the wait set
        found: list[tuple[Any, Take]] = [
            (waitable, self._take_waitable) for waitable in waitables if waitable.is_ready(wait_set)
        ]
        for kind, entities, take in waited.taken:
            ready = wait_set.get_ready_entities(kind)
            found += [(entities[pointer], take) for pointer in ready if pointer in entities]
        for entity, take in found:
            yield take(entity)

    def _check_context(self) -> None:
        if not self._context.ok():
            raise ExternalShutdownException

    def _take_ready_timer(self, timer: Any) -> Work:
        """A timer that was cancelled is in the wait set and not ready."""
        try:
            return self._take_timer(timer) if timer.handle.is_timer_ready() else None
        except InvalidHandle:  # destroyed by the callback before
            return None

    def _collect(self) -> Waited:
        """All entities of all nodes."""
        nodes = self.get_nodes()
        waitables = tuple(w for node in nodes for w in node.waitables)
        subscriptions, guards, timers, clients, services = (
            tuple(entity for node in nodes for entity in getattr(node, name))
            for name in ("subscriptions", "guards", "timers", "clients", "services")
        )
        subscriptions = tuple(s for s in subscriptions if not isinstance(s.callback_group, Polled))
        awake = (*guards, self._guard, self._sigint_gc)  # the executor's own have no callback
        count = NumberOfEntities(
            len(subscriptions), len(awake), len(timers), len(clients), len(services)
        )
        for waitable in waitables:
            count += waitable.get_num_entities()
        wait_set = WaitSet(
            count.num_subscriptions,
            count.num_guard_conditions,
            count.num_timers,
            count.num_clients,
            count.num_services,
            count.num_events,
            self._context.handle,
        )
        added = (
            (wait_set.add_subscription, subscriptions),
            (wait_set.add_guard_condition, awake),
            (wait_set.add_timer, timers),
            (wait_set.add_client, clients),
            (wait_set.add_service, services),
        )
        taken = (
            ("timer", timers, self._take_ready_timer),
            ("subscription", subscriptions, self._take_subscription),
            ("client", clients, self._take_client),
            ("service", services, self._take_service),
            ("guard_condition", guards, self._take_guard_condition),
        )
        return Waited(
            wait_set,
            tuple(w for w in waitables if isinstance(w, EventHandler)),
            tuple(w for w in waitables if not isinstance(w, EventHandler)),
            tuple((add, tuple(entity.handle for entity in found)) for add, found in added),
            tuple(
                (kind, {entity.handle.pointer: entity for entity in found}, take)
                for kind, found, take in taken
                if found
            ),
        )
