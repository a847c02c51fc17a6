# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The demo as a user starts it: all nodes with rendered images; and bad input, one line each."""

import json
import os
import re
import signal
import socket
import subprocess
import time
from pathlib import Path

import pytest
from ament_index_python.packages import get_package_prefix

from fish_node.domain import choose_domain, discovery_port, domain_in_use
from fish_report import robofish as command

ROOT = Path(__file__).parents[1]
PROGRAM = f"{get_package_prefix('fish_report')}/lib/fish_report/robofish"


def demo(folder, *arguments, limit_s=240):
    """Run `robofish demo` in a folder."""
    command = [PROGRAM, "demo", *map(str, arguments)]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=limit_s)


@pytest.fixture(scope="module")
def shown(tmp_path_factory):
    """A short demo, as slow as the computer needs: its output, its folder and its domain."""
    folder = tmp_path_factory.mktemp("demo")
    domain = choose_domain()
    result = demo(
        folder,
        "--letter",
        "S",
        "--speed",
        0.2,
        "--duration",
        10,
        "--lockstep",
        "--domain",
        domain,
        "--out",
        "run",
    )
    assert result.returncode == 0, result.stderr + result.stdout
    return result.stdout, folder / "run", domain


def test_the_fish_swims_on_its_path(shown):
    output, *_ = shown
    rmse = float(re.search(r"cross-track, m +([\d.]+)", output)[1])
    assert rmse < 0.015  # m; with an idle rudder 0.3 and more


def test_latency_and_cpu_of_every_node_are_shown(shown):
    output, *_ = shown
    assert float(re.search(r"latency_p99_ms +([\d.]+)", output)[1]) > 0.0
    for name in ("simulator", "camera", "tracker", r"fusion \+ planner \+ controller", "recorder"):
        assert re.search(rf"/{name} +\d+ %", output)


def test_recording_and_page_are_there(shown):
    _, folder, _ = shown
    assert (folder / "recording" / "metadata.yaml").exists()
    page = (folder / "report.html").read_text()
    assert "Path in the pool" in page
    assert not re.search(r"<(script|link|img)[^>]+(src|href)=", page)


def test_nothing_is_left_running(shown):
    *_, domain = shown
    assert not domain_in_use(domain)


def test_sigterm_ends_the_demo_and_its_nodes(tmp_path):
    domain = choose_domain()
    with subprocess.Popen(
        [PROGRAM, "demo", "--domain", str(domain), "--out", "run"],
        cwd=tmp_path,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        deadline = time.monotonic() + 30.0
        while not (tmp_path / "run" / "logs" / "fish_control.pilot.log").exists():
            assert time.monotonic() < deadline and process.poll() is None, "the demo did not start"
            time.sleep(0.05)
        process.send_signal(signal.SIGTERM)
        errors = process.communicate(timeout=40)[1]
    assert "Traceback" not in errors
    assert not domain_in_use(domain)


BROKEN = "weights.safetensors"
BAD_INPUT = {
    "letter": (["--letter", "?"], "unknown letter '?'; known: A B C"),
    "path arguments": (["--letter", "circle", "--path-args", "{radius: "], "expected YAML"),
    "walls": (["--letter", "circle", "--path-args", "{radius: 1}"], "must stay within |y|"),
    "not a number": (["--speed", "fast"], "invalid float value: 'fast'"),
    "speed": (["--speed", "9"], "expected 0.05 to 0.5"),
    "duration": (["--duration", "-1"], "expected a positive number"),
    "hardware": (["--hardware", "real"], "expected one of sim, fake"),
    "domain": (["--domain", "500"], "0 to 232"),
    "weights": (["--weights", BROKEN], "not a safetensors file"),
    "robot": (["--robot", "absent.yaml"], "absent.yaml"),
}


@pytest.mark.parametrize(("arguments", "expected"), BAD_INPUT.values(), ids=BAD_INPUT)
def test_bad_input_is_one_line(arguments, expected, tmp_path, monkeypatch, capsys):
    (tmp_path / BROKEN).write_text(json.dumps("not weights"))
    monkeypatch.chdir(tmp_path)
    assert_one_line(in_this_process("demo", *arguments, capsys=capsys), expected)


def test_an_unknown_make_variable_is_one_line():
    command = ["make", "--silent", "help", "LETER=S"]
    result = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert result.returncode != 0
    assert len(result.stderr.strip().splitlines()) == 1
    assert "unknown variable LETER; known: LETTER" in result.stderr


def test_a_domain_in_use_is_one_line(tmp_path):
    domain = choose_domain()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind(("", discovery_port(domain, 0)))
        assert_one_line(demo(tmp_path, "--domain", domain), f"ROS domain {domain} is in use")


def test_an_output_folder_with_something_in_it_is_kept(tmp_path, monkeypatch, capsys):
    (tmp_path / "precious").write_text("mine")
    monkeypatch.chdir(tmp_path)
    assert_one_line(in_this_process("demo", "--out", ".", capsys=capsys), "not empty")
    assert os.listdir(tmp_path) == ["precious"]


def in_this_process(*words, capsys):
    """What `robofish` with these words would return and print; a process of its own needs two seconds to start."""
    try:
        status = command.main([str(word) for word in words])
    except SystemExit as ended:
        status = ended.code
    return subprocess.CompletedProcess(words, status, *capsys.readouterr())


def assert_one_line(result, expected):
    assert result.returncode != 0
    assert "Traceback" not in result.stderr + result.stdout
    assert len(result.stderr.strip().splitlines()) == 1
    assert expected in result.stderr
