# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""A program swum open loop by the simulated robot, as a user starts it, and its recordings."""

import json
import subprocess

import numpy as np
import pytest
from test_demo import PROGRAM, assert_one_line, in_this_process

from fish_bag import read_dataset
from fish_node.domain import choose_domain, domain_in_use
from fish_sysid.dataset.experiment import build_experiment

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
def test_bad_input_is_one_line(tmp_path, monkeypatch, capsys, content, arguments, said):
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
