# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Every node started by hand, and its help."""

import importlib
import signal
import sys
import time
from contextlib import ExitStack
from pathlib import Path

import pytest
import rclpy

from conftest import PATIENCE
from fish_bringup.node_table import EXCITER, RECORDER, ROBOTS
from fish_bringup.nodes.watch import watching
from fish_bringup.processes import NodeProcesses
from fish_control.nodes import entry
from fish_node.domain import domain_in_use

NODES = (*ROBOTS["sim"], EXCITER)
SIGNALS = (signal.SIGINT, signal.SIGTERM)


def settings(spec, folder):
    """What a node cannot do without."""
    if spec == EXCITER:
        (folder / "program.json").write_text(
            '[{"t": 0, "amplitude": 8, "frequency": 2, "rudder": 0}]'
        )
        return {"program_file": str(folder / "program.json")}
    return {"output": str(folder), "name": "recording"} if spec == RECORDER else {}


@pytest.fixture(scope="module", params=SIGNALS, ids=lambda number: number.name)
def ended(request, tmp_path_factory):
    """Every node started alone, on a domain of its own, until it published diagnostics; then the signal.

    Returns what each said of itself and its exit status.
    """
    folder = tmp_path_factory.mktemp(request.param.name)
    said, status = {}, {}
    with ExitStack() as stack:
        started = {}
        for domain, spec in zip(free_domains(len(NODES)), NODES, strict=True):
            nodes = stack.enter_context(NodeProcesses(domain, folder / "logs"))
            started[spec] = (
                nodes.start(spec, settings(spec, folder)),
                *stack.enter_context(watching(domain)),
            )
        deadline = time.monotonic() + PATIENCE
        while len(said) < len(NODES) and time.monotonic() < deadline:
            for spec, (_, watch, listen) in started.items():
                listen(0.02)
                if f"fish/{spec.executable}" in watch.levels:
                    said[spec] = watch.levels[f"fish/{spec.executable}"]
        for process, *_ in started.values():
            process.signal(request.param)
        deadline = time.monotonic() + PATIENCE  # all of them end at once
        for spec, (process, *_) in started.items():
            status[spec] = process.wait(max(deadline - time.monotonic(), 0.0))
    return said, status


@pytest.mark.parametrize("spec", NODES, ids=lambda spec: spec.name)
def test_a_node_runs_alone_and_ends_with_0(spec, ended):
    said, status = ended
    assert spec in said, "no diagnostics"
    assert said[spec][1], "diagnostics without words"
    assert status[spec] == 0


@pytest.mark.parametrize("number", SIGNALS, ids=lambda number: number.name)
@pytest.mark.parametrize("spec", NODES, ids=lambda spec: spec.name)
def test_a_signal_while_python_imports_a_node_ends_it_with_0(spec, number, monkeypatch):
    entry = importlib.import_module(f"{spec.package}.nodes.entry")
    before = {s: signal.getsignal(s) for s in (signal.SIGINT, signal.SIGTERM)}
    # what a shell starts in the background ignores it
    signal.signal(signal.SIGINT, signal.default_int_handler)

    def interrupted(name):
        assert name == f"{spec.package}.nodes.{spec.executable}"
        signal.raise_signal(number)

    monkeypatch.setattr(importlib, "import_module", interrupted)
    try:
        assert getattr(entry, spec.executable)() == 0
    finally:
        for changed, handler in before.items():
            signal.signal(changed, handler)


def free_domains(count):
    free = [domain for domain in range(1, 102) if not domain_in_use(domain)]
    assert len(free) >= count, "too few free ROS domains"
    return free[-count:]


def test_the_simulator_keeps_its_pace_without_a_c_compiler(tmp_path):
    """By its own processor time for a simulated second, which other programs do not lengthen much."""
    simulator, domain = NODES[0], free_domains(1)[0]
    with NodeProcesses(domain, tmp_path / "logs") as nodes, watching(domain) as (watch, listen):
        nodes.environment["FISH_SIM_NO_COMPILER"] = "1"
        process = nodes.start(simulator)
        deadline = time.monotonic() + PATIENCE

        def next_report():
            """Simulated seconds in a second, when the simulator says so next."""
            last = watch.diagnostics.get("fish/simulator")
            while (now := watch.diagnostics.get("fish/simulator")) is last:
                assert process.status is None, process.last_words()
                assert time.monotonic() < deadline, watch.levels
                listen(0.02)
            return float(now["real_time_factor"])

        while next_report() == 0.0:
            pass
        used, before, simulated = process.cpu_time(), time.monotonic(), 0.0
        for _ in range(4):
            pace = next_report()
            now = time.monotonic()
            simulated += pace * (now - before)
            before = now
        assert simulated > 0.0
        assert process.cpu_time() - used < simulated / 0.95


NODES_WITH_HELP = {
    "fish_sim": ("simulator", "camera"),
    "fish_vision": ("tracker",),
    "fish_description": ("joint_angles",),
    "fish_control": ("fusion", "planner", "controller", "exciter"),
    "fish_hw": ("rotor", "rudder", "imu", "camera"),
    "fish_bag": ("recorder", "replayer"),
}


@pytest.mark.parametrize("flag", ["-h", "--help"])
@pytest.mark.parametrize(
    ("package", "name"), [(p, name) for p, names in NODES_WITH_HELP.items() for name in names]
)
def test_help_says_what_a_node_is_and_starts_nothing(package, name, flag, monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", [name, flag])
    monkeypatch.setattr(rclpy, "init", lambda *_, **__: pytest.fail("started"))
    assert getattr(importlib.import_module(f"{package}.nodes.entry"), name)() == 0
    usage, what, parameters = capsys.readouterr().out.splitlines()
    assert usage.startswith(f"usage: {name} ")
    assert what
    assert Path(parameters.split(": ")[1]).name == f"{name}.yaml"
    assert Path(parameters.split(": ")[1]).exists()


def test_help_of_several_nodes_in_one_process_names_them(monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["pilot", "--help"])
    monkeypatch.setattr(rclpy, "init", lambda *_, **__: pytest.fail("started"))
    assert entry.pilot() == 0
    usage, what, parameters = capsys.readouterr().out.splitlines()
    assert usage.startswith("usage: pilot --ros-args -r __ns:=/fish --fusion --params-file FILE")
    assert "fusion, planner and controller" in what
    assert parameters.endswith("config/NODE.yaml")
