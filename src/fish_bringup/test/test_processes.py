# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Starting and ending processes: small Python programs stand for nodes."""

import signal
import subprocess
import sys
import time

import pytest

from fish_bringup import processes
from fish_bringup.node_table import NodeSpec

POLITE = """
import time
try: print('ready', flush=True); time.sleep(60)
except KeyboardInterrupt: print('bye')
"""
DEAF = """
import signal, time
for number in (signal.SIGINT, signal.SIGTERM): signal.signal(number, signal.SIG_IGN)
print('ready', flush=True); time.sleep(60)
"""
BUSY = "print('ready', flush=True)\nwhile True: sum(range(1000))"
BROKEN = "import sys; print('no such weights', file=sys.stderr); sys.exit(3)"
PROGRAMS = {"polite": POLITE, "deaf": DEAF, "busy": BUSY, "broken": BROKEN}


@pytest.fixture
def nodes(tmp_path, monkeypatch):
    """A set of processes that run PROGRAMS by executable name."""
    monkeypatch.setattr(
        processes, "command", lambda spec, *_: [sys.executable, "-c", PROGRAMS[spec.executable]]
    )
    monkeypatch.setattr(
        processes, "GRACE", ((signal.SIGINT, 3.0), (signal.SIGTERM, 0.2), (signal.SIGKILL, 3.0))
    )
    with processes.NodeProcesses(0, tmp_path / "logs") as nodes:
        yield nodes


def start(nodes, executable):
    process = nodes.start(NodeSpec("test", executable, "none.yaml"))
    deadline = time.monotonic() + 10.0
    while "ready" not in process.log.read_text() and process.status is None:
        assert time.monotonic() < deadline, "the program did not start"
        time.sleep(0.01)
    return process


def test_sigint_ends_a_polite_process_with_0(nodes):
    process = start(nodes, "polite")
    assert nodes.stop() == {process.spec: 0}
    assert process.last_words() == "bye"


def test_a_deaf_process_is_killed_in_the_end(nodes, monkeypatch):
    monkeypatch.setattr(
        processes, "GRACE", ((signal.SIGINT, 0.2), (signal.SIGTERM, 0.2), (signal.SIGKILL, 3.0))
    )
    process = start(nodes, "deaf")
    assert nodes.stop() == {process.spec: -signal.SIGKILL}


def test_a_process_that_fails_is_found_with_its_last_words(nodes):
    process = start(nodes, "broken")
    assert process.wait(5.0) == 3
    assert [(ended.spec.executable, ended.last_words()) for ended in nodes.ended()] == [
        ("broken", "no such weights")
    ]


def test_a_process_can_be_started_again_after_kill(nodes):
    first = start(nodes, "polite")
    first.signal(signal.SIGKILL)
    assert first.wait(5.0) == -signal.SIGKILL
    second = nodes.start(first.spec)
    assert second.pid != first.pid
    assert nodes.ended() == []


def test_cpu_time_is_that_of_the_process(nodes):
    busy, idle = start(nodes, "busy"), start(nodes, "polite")
    before, began = busy.cpu_time(), time.monotonic()
    while time.monotonic() - began < 0.5:
        time.sleep(0.05)
    assert (
        0.02 < busy.cpu_time() - before <= time.monotonic() - began + 0.02
    )  # it may share its core
    assert idle.cpu_time() < 2.0


def test_nothing_survives_the_starter(tmp_path):
    """kill -9 of the starter ends the node: the kernel sends it SIGTERM."""
    starter = f"""
import sys, time
from pathlib import Path
from fish_bringup import processes
from fish_bringup.node_table import NodeSpec
processes.command = lambda spec, *_: [sys.executable, "-c", {POLITE!r}]
nodes = processes.NodeProcesses(0, Path({str(tmp_path)!r}))
print(nodes.start(NodeSpec("test", "polite", "none.yaml")).pid, flush=True)
time.sleep(60)
"""
    with subprocess.Popen(
        [sys.executable, "-c", starter], stdout=subprocess.PIPE, text=True
    ) as parent:
        child = int(parent.stdout.readline())
        parent.kill()
        parent.wait()
    deadline = time.monotonic() + 10.0
    while _alive(child):
        assert time.monotonic() < deadline, "the node outlived its starter"
        time.sleep(0.02)


def _alive(pid):
    try:
        with open(f"/proc/{pid}/stat") as stat:
            return stat.read().rpartition(")")[2].split()[0] != "Z"  # a zombie waits for init only
    except FileNotFoundError:
        return False
