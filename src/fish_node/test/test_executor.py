# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The executor, simulated time, and how a node ends."""

from __future__ import annotations

import itertools
import os
import resource
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import rclpy
from rclpy._rclpy_pybind11 import RCLError
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.task import Future
from std_msgs.msg import Int32
from std_srvs.srv import Trigger

from fish_node.nodes import start
from fish_node.nodes.executor import KeptWaitSetExecutor, Polled, take_all
from fish_node.nodes.heap import keep_freed_memory
from fish_node.simulated_time import LOOK_S, SimulatedTime

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
    turns, begin = 0, time.monotonic()
    while len(beats) < 20:
        bench.executor.spin_once()
        turns += 1
    assert turns < 25 + (time.monotonic() - begin)  # the events are looked at once a second


SPIN_DOMAIN = "173"
PROGRAM = """
import sys
import time
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from std_msgs.msg import Int32
from fish_node.nodes.spin import ByEvents, ByWaitSet
from fish_node.nodes.start import Part, run_together

spin, kind = {"events": ByEvents, "wait_set": ByWaitSet}[sys.argv[1]](), sys.argv[2]

class Talker(Node):
    def __init__(self):
        super().__init__("talker")
        self.count, self.publisher = 0, self.create_publisher(Int32, "numbers", 1000)
        self.create_timer(0.001, self.talk)

    def talk(self):
        if self.publisher.get_subscription_count():
            self.count += 1
            self.publisher.publish(Int32(data=self.count))

class Listener(Node):
    def __init__(self):
        super().__init__("listener")
        self.heard = []
        self.create_subscription(Int32, "numbers", self.hear, 1000)

    def hear(self, message):
        self.heard.append(message.data)
        if kind == "error" and message.data == 100:
            raise ArithmeticError("in the callback")
        if len(self.heard) == 200:
            print("in order" if self.heard == list(range(1, 201)) else self.heard, flush=True)

class Idle(Node):
    def __init__(self):
        super().__init__("idle")
        print("made", flush=True)

class Sensor(Node):
    def __init__(self):
        super().__init__("sensor")
        self.heard = {"sensor": [], "command": []}
        self.publisher = self.speak("sensor", ReliabilityPolicy.BEST_EFFORT)
        self.speak("command", ReliabilityPolicy.RELIABLE)
        time.sleep(0.3)  # all has arrived
        self.create_timer(0.05, lambda: self.publisher.publish(Int32(data=99)))

    def speak(self, topic, reliability):
        qos = QoSProfile(depth=50, reliability=reliability)
        publisher = self.create_publisher(Int32, topic, qos)
        self.create_subscription(Int32, topic, lambda message: self.hear(topic, message.data), qos)
        while not publisher.get_subscription_count():
            time.sleep(0.01)
        for number in range(20):
            publisher.publish(Int32(data=number))
        return publisher

    def hear(self, topic, number):
        self.heard[topic].append(number)
        if number == 99:
            print(self.heard["sensor"][0], len(self.heard["command"]), flush=True)

class Refused(Node):
    def __init__(self):
        super().__init__("refused")
        raise ValueError("speed is -1.0, expected at least 0")

def end(node):
    print("end of", node.get_name(), flush=True)

parts = {"idle": [Part(Idle, "idle", end)], "sensor": [Part(Sensor, "sensor")],
    "refused": [Part(Idle, "idle"), Part(Refused, "refused", end)]}
sys.exit(run_together(parts.get(kind, [Part(Talker, "talker", end), Part(Listener, "listener", end)]), spin=spin))
"""
EXECUTORS = pytest.mark.parametrize("executor", ["events", "wait_set"])


def process(executor: str, kind: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-c", PROGRAM, executor, kind],
        env={
            **os.environ,
            "ROS_DOMAIN_ID": SPIN_DOMAIN,
            "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
        },
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


@EXECUTORS
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize(("kind", "said"), [("talk", "in order"), ("idle", "made")])
def test_messages_of_one_node_reach_the_other_until_a_signal_comes(
    executor: str, number: signal.Signals, kind: str, said: str
) -> None:
    with process(executor, kind) as nodes:
        assert nodes.stdout is not None
        assert nodes.stdout.readline() == f"{said}\n"
        nodes.send_signal(number)
        output, errors = nodes.communicate(timeout=30)
    assert nodes.returncode == 0
    if kind == "talk":
        assert output == "end of talker\nend of listener\n"
    else:  # with a wait set the signal may interrupt what makes the node
        assert output in ("end of idle\n", "" if executor == "wait_set" else "end of idle\n")
    assert "Traceback" not in errors
    assert "Error" not in errors


@EXECUTORS
def test_what_a_sensor_said_while_the_nodes_were_made_is_no_news(executor: str) -> None:
    with process(executor, "sensor") as nodes:
        assert nodes.stdout is not None
        assert nodes.stdout.readline() == "99 20\n"
        nodes.send_signal(signal.SIGTERM)
        nodes.communicate(timeout=30)
    assert nodes.returncode == 0


@EXECUTORS
def test_a_mistake_in_a_callback_ends_the_process_with_its_traceback(executor: str) -> None:
    with process(executor, "error") as nodes:
        output, errors = nodes.communicate(timeout=30)
    assert (nodes.returncode, output) == (1, "")
    assert "ArithmeticError: in the callback" in errors


@EXECUTORS
def test_a_node_that_is_refused_ends_those_made_before_it(executor: str) -> None:
    with process(executor, "refused") as nodes:
        output, errors = nodes.communicate(timeout=30)
    assert (nodes.returncode, output) == (1, "made\n")
    assert errors == "refused: speed is -1.0, expected at least 0\n"


def run(monkeypatch, error, alive):
    """Run a node whose callback raises `error` and return what it did at its end; alive: no signal has come."""
    ended = []

    class Spin:
        def init(self, _):
            pass

        def __call__(self, _):
            raise error

    replaced = {
        "ok": lambda: alive,
        "try_shutdown": lambda: ended.append("shut down"),
    }
    monkeypatch.setattr(start, "rclpy", SimpleNamespace(**replaced))
    node = SimpleNamespace(destroy_node=lambda: ended.append("destroyed"))
    start.run(lambda: node, "controller", spin=Spin())
    return ended


@pytest.mark.parametrize(
    "error",
    [
        RCLError("Failed to publish: publisher's context is invalid"),
        RuntimeError("not ok"),
        ValueError("x"),
    ],
)
def test_what_a_signal_that_has_shut_the_context_down_brings_about_is_no_failure(
    monkeypatch, error
):
    ended = run(monkeypatch, error, alive=False)
    assert ended == ["destroyed", "shut down"]


@pytest.mark.parametrize("error", [RCLError("Failed to publish"), ValueError("invalid literal")])
def test_a_mistake_in_a_callback_is_no_refused_parameter(monkeypatch, error):
    with pytest.raises(type(error), match=str(error)):
        run(monkeypatch, error, alive=True)


def test_what_cannot_start_says_why(monkeypatch, capsys):
    def refuse():
        raise ValueError("speed is -1.0,\n expected at least 0")

    replaced = {"ok": lambda: True, "try_shutdown": lambda: None}
    monkeypatch.setattr(start, "rclpy", SimpleNamespace(**replaced))
    assert start.run(refuse, "planner", spin=SimpleNamespace(init=lambda _: None)) == 1
    assert capsys.readouterr().err == "planner: speed is -1.0, expected at least 0\n"


def test_a_signal_that_shuts_the_context_down_at_the_same_moment_is_no_failure(monkeypatch):
    """rclpy looks whether it is still there, and then shuts it down."""
    tries = []

    def try_shutdown():
        tries.append(None)
        if len(tries) == 1:
            raise RCLError("failed to shutdown: rcl_shutdown already called on the given context")

    monkeypatch.setattr(start, "rclpy", SimpleNamespace(try_shutdown=try_shutdown))
    start.shut_down()
    assert len(tries) == 2  # the second finds it gone, and forgets it


def test_large_blocks_are_used_again() -> None:
    if not keep_freed_memory():
        pytest.skip("the C library has no mallopt")
    size = 5 * 2**20
    np.ones(size, np.uint8)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
    for _ in range(20):
        np.ones(size, np.uint8)
    faults = resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before
    assert faults < 20 * size / resource.getpagesize() / 10


DT = 0.01


class Wall:
    def __init__(self) -> None:
        self.now = 100.0

    def __call__(self) -> float:
        return self.now


def ticked(rate: float, count: int = 30) -> tuple[SimulatedTime, Wall]:
    """A time that has heard a message for every period, at a rate; the last one said count * DT."""
    wall = Wall()
    time = SimulatedTime(wall)
    for k in range(count + 1):
        time.tick(DT * k)
        wall.now += DT / rate
    wall.now -= DT / rate
    return time, wall


def test_it_does_not_run_before_the_first_message():
    wall = Wall()
    time = SimulatedTime(wall)
    wall.now += 5.0
    assert not time.runs
    assert time.now() == 0.0


@pytest.mark.parametrize("rate", [0.1, 0.5, 1.0, 3.0])
def test_it_runs_on_at_the_rate_of_the_messages(rate):
    time, wall = ticked(rate)
    assert time.now() == pytest.approx(30 * DT)
    wall.now += 0.4 * DT / rate
    assert time.now() == pytest.approx(30.4 * DT)


def test_it_waits_for_the_next_message():
    time, wall = ticked(0.2)
    wall.now += 100.0
    assert time.now() == pytest.approx(31 * DT)


def test_two_that_hear_a_message_at_different_moments_differ_by_the_delay_times_the_rate():
    early, wall = ticked(0.2)
    late, _ = ticked(0.2)
    late._wall = wall  # one computer
    early.tick(31 * DT)
    wall.now += 0.004
    late.tick(31 * DT)
    assert early.now() - late.now() == pytest.approx(0.2 * 0.004)


def test_it_never_goes_back_while_the_messages_do_not():
    time, wall = ticked(0.3)
    seen = []
    for k, delay in enumerate([0.0, 0.1, 0.002, 0.5, 0.03, 0.0, 0.04]):
        for _ in range(5):
            wall.now += delay / 5
            seen.append(time.now())
        time.tick((31 + k) * DT)
        seen.append(time.now())
        time.tick((31 + k) * DT)  # said again
        seen.append(time.now())
    assert all(after >= before for before, after in itertools.pairwise(seen))


def test_one_standstill_does_not_make_it_slow():
    time, wall = ticked(0.25)
    wall.now += 60.0
    time.tick(31 * DT)
    wall.now += 0.5 * DT / 0.25
    assert time.now() == pytest.approx(31.5 * DT)


def test_it_runs_on_where_the_clock_is_set_back():
    time, wall = ticked(0.5)
    wall.now += 0.01
    before = time.now()
    assert before == pytest.approx(30.5 * DT)
    for _ in range(2):  # the second is the same again
        time.tick(0.0)
        assert time.now() == pytest.approx(before)
    wall.now += 0.02
    time.tick(DT)
    wall.now += 0.01
    assert time.now() == pytest.approx(before + 1.5 * DT)
    assert time.now() - time.ahead_s == pytest.approx(1.5 * DT)


def test_who_waits_looks_again_soon_however_slow_the_simulation_is():
    time, _ = ticked(0.5)
    assert time.wall(0.002) == pytest.approx(0.004)
    assert time.wall(10.0) == LOOK_S
