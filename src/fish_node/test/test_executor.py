# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The executor with a kept wait set runs every kind of callback, also of entities that come and go while it spins."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import pytest
import rclpy
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.task import Future
from std_msgs.msg import Int32
from std_srvs.srv import Trigger

from fish_node.nodes.executor import KeptWaitSetExecutor, Polled, take_all

DOMAIN = 172
TURNS = 2000  # of at most 10 ms: the timer of the bench ends every wait


class Bench:
    """A node that is spun until something is true."""

    def __init__(self) -> None:
        self.context = rclpy.Context()
        rclpy.init(context=self.context, domain_id=DOMAIN)
        self.node = Node("bench", context=self.context)
        self.executor = KeptWaitSetExecutor(context=self.context)
        self.executor.add_node(self.node)
        self.node.create_timer(0.01, lambda: None)

    def until(self, done: Callable[[], Any]) -> bool:
        for _ in range(TURNS):
            if done():
                return True
            self.executor.spin_once()
        return False

    def close(self) -> None:
        self.executor.shutdown()
        self.node.destroy_node()
        self.context.try_shutdown()


@pytest.fixture
def bench() -> Iterator[Bench]:
    made = Bench()
    yield made
    made.close()


def test_every_message_is_heard_in_order(bench: Bench) -> None:
    heard: list[int] = []
    bench.node.create_subscription(Int32, "numbers", lambda m: heard.append(m.data), 100)
    publisher = bench.node.create_publisher(Int32, "numbers", 100)
    assert bench.until(publisher.get_subscription_count)
    for k in range(50):
        publisher.publish(Int32(data=k))
    assert bench.until(lambda: len(heard) == 50)
    assert heard == list(range(50))


def test_a_callback_may_ask_for_raw_bytes_and_for_the_info(bench: Bench) -> None:
    raw: list[bytes] = []
    info: list[dict[str, Any]] = []

    def with_info(_: Int32, about: dict[str, Any]) -> None:
        info.append(about)

    bench.node.create_subscription(Int32, "numbers", raw.append, 10, raw=True)
    bench.node.create_subscription(Int32, "numbers", with_info, 10)
    publisher = bench.node.create_publisher(Int32, "numbers", 10)
    assert bench.until(lambda: publisher.get_subscription_count() == 2)
    publisher.publish(Int32(data=7))
    assert bench.until(lambda: raw and info)
    assert raw[0][-4:] == (7).to_bytes(4, "little")
    assert "source_timestamp" in info[0]


def test_a_service_answers_a_client_of_the_same_executor(bench: Bench) -> None:
    def serve(_: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        response.message = "done"
        return response

    bench.node.create_service(Trigger, "work", serve)
    client = bench.node.create_client(Trigger, "work")
    assert bench.until(client.service_is_ready)
    answer = client.call_async(Trigger.Request())
    assert bench.until(answer.done)
    assert answer.result().message == "done"


def test_a_coroutine_may_wait_for_an_answer(bench: Bench) -> None:
    open_door, seen = Future(), list[str]()

    async def wait() -> None:
        seen.append("before")
        seen.append(await open_door)

    timer = bench.node.create_timer(0.01, wait)
    assert bench.until(lambda: seen)
    timer.cancel()
    for _ in range(20):
        bench.executor.spin_once()
    assert set(seen) == {"before"}
    open_door._set_executor(bench.executor)  # as rclpy does for a service's answer
    open_door.set_result("after")
    assert bench.until(lambda: "after" in seen)


def test_entities_come_and_go_while_it_spins(bench: Bench) -> None:
    heard: list[int] = []
    publisher = bench.node.create_publisher(Int32, "numbers", 10)
    made: list[Any] = []

    def make() -> None:
        if not made:
            made.append(
                bench.node.create_subscription(Int32, "numbers", lambda m: heard.append(m.data), 10)
            )

    bench.node.create_timer(0.01, make)
    assert bench.until(publisher.get_subscription_count)
    publisher.publish(Int32(data=1))
    assert bench.until(lambda: heard == [1])
    bench.node.destroy_subscription(made[0])
    assert bench.until(lambda: not publisher.get_subscription_count())
    publisher.publish(Int32(data=2))
    for _ in range(20):
        bench.executor.spin_once()
    assert heard == [1]


def test_a_cancelled_timer_is_silent(bench: Bench) -> None:
    beats: list[int] = []
    timer = bench.node.create_timer(0.001, lambda: beats.append(1))
    assert bench.until(lambda: len(beats) >= 3)
    timer.cancel()
    count = len(beats)
    for _ in range(20):
        bench.executor.spin_once()
    assert len(beats) == count


def test_an_error_of_a_callback_reaches_who_spins(bench: Bench) -> None:
    def fail() -> None:
        raise ArithmeticError("in the callback")

    bench.node.create_timer(0.001, fail)
    with pytest.raises(ArithmeticError, match="in the callback"):
        bench.until(lambda: False)


def test_a_context_that_ends_ends_the_spinning(bench: Bench) -> None:
    bench.node.create_timer(0.02, bench.context.shutdown)
    with pytest.raises(ExternalShutdownException):
        bench.until(lambda: False)


def test_parameters_are_answered(bench: Bench) -> None:
    from rcl_interfaces.srv import GetParameters

    bench.node.declare_parameter("speed", 0.2)
    client = bench.node.create_client(GetParameters, "bench/get_parameters")
    assert bench.until(client.service_is_ready)
    answer = client.call_async(GetParameters.Request(names=["speed"]))
    assert bench.until(answer.done)
    assert answer.result().values[0].double_value == 0.2


def test_messages_of_a_polled_subscription_wait_until_they_are_taken(bench: Bench) -> None:
    called: list[bytes] = []
    polled = bench.node.create_subscription(
        Int32, "numbers", called.append, 100, raw=True, callback_group=Polled()
    )
    heard: list[int] = []
    bench.node.create_subscription(Int32, "numbers", lambda m: heard.append(m.data), 100)
    publisher = bench.node.create_publisher(Int32, "numbers", 100)
    assert bench.until(lambda: publisher.get_subscription_count() == 2)
    for k in range(50):
        publisher.publish(Int32(data=k))
    assert bench.until(lambda: len(heard) == 50)
    taken = [int.from_bytes(data[-4:], "little") for data, _ in take_all(polled)]
    assert taken == list(range(50))
    assert called == list(take_all(polled)) == []


def test_an_offer_that_does_not_fit_is_noticed(bench: Bench) -> None:
    """The events of a subscription are looked at now and then only."""
    noticed: list[Any] = []
    bench.node.create_publisher(
        Int32, "numbers", QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
    )
    bench.node.create_subscription(
        Int32,
        "numbers",
        lambda _: None,
        1,
        event_callbacks=SubscriptionEventCallbacks(incompatible_qos=noticed.append),
    )
    assert bench.until(lambda: noticed)


def test_messages_alone_do_not_wake_a_node_that_does_not_wait_for_them(bench: Bench) -> None:
    """The middleware wakes who waits for a subscription's events also for its messages, which is what a look costs."""
    bench.node.create_subscription(Int32, "numbers", print, 100, callback_group=Polled())
    publisher = bench.node.create_publisher(Int32, "numbers", 100)
    assert bench.until(publisher.get_subscription_count)
    beats: list[None] = []
    for timer in bench.node.timers:
        bench.node.destroy_timer(timer)
    bench.node.create_timer(0.05, lambda: [publisher.publish(Int32()), beats.append(None)])
    turns = 0
    while len(beats) < 20:
        bench.executor.spin_once()
        turns += 1
    assert turns < 30
