# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""An executor that keeps its wait set: rclpy's own builds it anew for every callback, and twice.

rclpy's SingleThreadedExecutor collects all entities of all nodes before every wait. Each callback also triggers the
executor's own guard condition, so that the next wait returns at once without work. For a node that hears 100 messages a
second this takes most of its processor time. Here the entities are collected when they change, and callbacks run directly.
What rclpy does in a callback is left to rclpy.
"""

from __future__ import annotations

from collections.abc import Callable, Coroutine, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import rclpy
from rclpy._rclpy_pybind11 import InvalidHandle, WaitSet
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.waitable import NumberOfEntities, Waitable

Work = Callable[[], Coroutine[Any, Any, None]] | None  # what rclpy's _take_.. functions give
Take = Callable[[Any], Work]


@dataclass(frozen=True)
class Waited:
    """The wait set with room for everything that is waited for.

    Attributes:
        added: functions that add a handle to the wait set, each with its handles.
        taken: kinds of entities in the order in which their callbacks run; of each the entities by the address of their
            handle, and rclpy's function that takes an event of one.
    """

    wait_set: WaitSet
    waitables: tuple[Waitable, ...]
    added: tuple[tuple[Callable[[Any], object], tuple[Any, ...]], ...]
    taken: tuple[tuple[str, Mapping[int, Any], Take], ...]

    def fill(self) -> None:
        """Put everything into the wait set anew.

        Raises:
            InvalidHandle: something was destroyed.
        """
        self.wait_set.clear_entities()
        for add, handles in self.added:
            for handle in handles:
                add(handle)
        for waitable in self.waitables:
            waitable.add_to_wait_set(self.wait_set)


class KeptWaitSetExecutor(SingleThreadedExecutor):
    """SingleThreadedExecutor with a wait set that lasts until an entity is made or destroyed.

    One thread spins it. Entities are made and destroyed in that thread's callbacks, or while it does not spin.
    """

    def __init__(self, **options: Any) -> None:
        self._waited: Waited | None = None  # None: to be collected
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
        try:
            waited.fill()
        except InvalidHandle:  # destroyed since: collect again
            self._waited = None
            return
        wait_set.wait(-1)
        self._check_context()
        # all that is ready is known before a callback can change the wait set
        found: list[tuple[Any, Take]] = [
            (waitable, self._take_waitable)
            for waitable in waited.waitables
            if waitable.is_ready(wait_set)
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
            waitables,
            tuple((add, tuple(entity.handle for entity in found)) for add, found in added),
            tuple(
                (kind, {entity.handle.pointer: entity for entity in found}, take)
                for kind, found, take in taken
                if found
            ),
        )


def spin(node: Node) -> None:
    """Run a node's callbacks until its context ends; rclpy.spin with this executor.

    Raises:
        ExternalShutdownException: the context was shut down while it waited.
    """
    rclpy.spin(node, KeptWaitSetExecutor(context=node.context))
