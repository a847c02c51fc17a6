# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""A process of nodes runs their callbacks by either executor, and a signal ends it with 0 and without a word."""

from __future__ import annotations

import os
import signal
import subprocess
import sys

import pytest

DOMAIN = "173"
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
        env={**os.environ, "ROS_DOMAIN_ID": DOMAIN, "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"},
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
