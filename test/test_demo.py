# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The verbs demo and excite, whole."""

import json
import os
import re
import signal
import socket
import subprocess
import time
from pathlib import Path

import numpy as np
import pytest
from ament_index_python.packages import get_package_prefix

from fish_bag import read_dataset
from fish_node.domain import choose_domain, discovery_port, domain_in_use
from fish_report import robofish as command
from fish_sysid.dataset.experiment import build_experiment

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


# slow enough for the guard never to stop it where the plan puts it
ROWS = [
    {"t": 0, "amplitude": 5.5, "frequency": 2.5, "rudder": 0.0},
    {"t": 3, "amplitude": 5.5, "frequency": 2.5, "rudder": 0.5},
]


def excite(folder, *arguments):
    command = [PROGRAM, "excite", *map(str, arguments)]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=120)


def longest(folder):
    """The swim that a stalled computer cut least: the guard stops a fish of which it hears nothing for half a second."""
    return max(
        read_dataset(folder / "recordings").trials, key=lambda trial: np.ptp(trial.commands.t)
    )


@pytest.fixture(scope="module")
def swum(tmp_path_factory):
    """The last seven seconds of a program: output, folder, domain."""
    folder, domain = tmp_path_factory.mktemp("excite"), choose_domain()
    (folder / "diagnosis.json").write_text(
        json.dumps({"next_experiment": {"why": "to see", "program": ROWS}})
    )
    result = excite(folder, "diagnosis.json", "--begin", 4, "--domain", domain, "--out", "run")
    assert result.returncode == 0, result.stderr + result.stdout
    return result.stdout, folder / "run", domain


def test_the_recording_holds_what_the_program_says(swum):
    _, folder, _ = swum
    trial = longest(folder)
    rotor, rudder = trial.commands.rotor_speed, trial.commands.rudder
    assert np.abs(rotor).max() == pytest.approx(5.5 * 2.0 * np.pi * 2.5, rel=0.02)
    moves = np.abs(rotor) > 1.0
    assert set(np.round(rudder[moves], 6)) <= {0.0, 0.5}
    assert np.mean(rudder[moves] == 0.5) > 0.8
    zero_crossings = np.count_nonzero(np.diff(np.sign(rotor[moves])))
    seconds = np.ptp(trial.commands.t[moves])
    assert zero_crossings / (2.0 * seconds) == pytest.approx(2.5, rel=0.05)


def test_a_command_acts_from_its_stamp_on_however_busy_the_computer_is(swum):
    """The encoder tells what was commanded in the period before, to its noise: a command late by a period is 9 rad/s off."""
    _, folder, _ = swum
    experiment = build_experiment([longest(folder)])
    behind = experiment.encoder[6:, 0] - experiment.commands[5:-1, 0, 0]
    assert np.nanstd(behind) < 0.4
    assert np.nanmax(np.abs(behind)) < 2.0


def test_the_fish_turns_left_from_rest(swum):
    _, folder, _ = swum
    trial = longest(folder)
    heading = np.unwrap(trial.camera.psi)
    assert heading[-1] - heading[0] > 0.5  # rad


def test_how_it_ended_is_said_and_nothing_is_left_running(swum):
    output, _, domain = swum
    assert "trial_00: 4.0 to " in output
    assert "robofish diagnose" in output
    assert not domain_in_use(domain)


@pytest.mark.parametrize(
    ("content", "arguments", "said"),
    [
        ("[]", [], "no rows, expected a list of rows"),
        (json.dumps(ROWS), ["--begin", "50"], "begin is 50 s, expected 0 to 8 s"),
        (json.dumps(ROWS), ["--robot", "absent.yaml"], "absent.yaml"),
        (json.dumps(ROWS), ["--out", "."], "not empty"),
    ],
)
def test_bad_input_is_one_line_of_excite(tmp_path, monkeypatch, capsys, content, arguments, said):
    (tmp_path / "program.json").write_text(content)
    monkeypatch.chdir(tmp_path)
    result = in_this_process("excite", "program.json", *arguments, capsys=capsys)
    assert_one_line(result, said)


def test_the_plan_lists_the_swims_without_swimming(tmp_path, monkeypatch, capsys):
    (tmp_path / "program.json").write_text(json.dumps(ROWS))
    monkeypatch.chdir(tmp_path)
    result = in_this_process("excite", "program.json", "--plan", capsys=capsys)
    assert result.returncode == 0
    assert "heading, rad" in result.stdout
    assert [file.name for file in tmp_path.iterdir()] == ["program.json"]
