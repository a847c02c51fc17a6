# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The verbs as a user types them."""

import json
from pathlib import Path

import pytest

from fish_control.control_law import ControlLimits
from fish_control.gains_file import read_gains_file
from fish_control.line_of_sight import GuidanceConfig
from fish_report.robofish import main
from fish_sim.robot import Robot
from fish_sim.robot_file import save_robot
from fish_train.evaluation.open_loop import law_of_robot
from fish_train.verbs.train import command_line

SETTINGS = [
    "batch=2",
    "unroll=2",
    "hold=5",
    "episode=1.0",
    "approach=0.2",
    "amplitudes=[1.0]",
    "cycles=[0.5]",
    "radii=[1.5]",
    "thresholds=[0.4]",
    "criterion_episodes=1",
    "polish_updates=4",
]

GAINS = "0.3,0.3,0.03,0.6,0.05,0"
BROKEN = "broken.yaml"
EVALUATE = ["evaluate", "--constant", GAINS]


@pytest.mark.parametrize("form", ["network", "schedule", "constant"])
def test_train_then_use(form: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = tmp_path / "seed_1"
    assert main(["train", "--out", str(tmp_path), "--form", form, "--set", *SETTINGS]) == 0
    assert "1 of 1 runs finished" in capsys.readouterr().out
    if form == "schedule":
        assert len(json.loads((folder / "schedule.json").read_text())["weights"]) == 18
        return
    assert main(["weights", "show", str(folder / "gains.safetensors")]) == 0
    shown = capsys.readouterr().out
    assert ("6-128-128-64-6" if form == "network" else "constant gains") in shown
    assert str(tmp_path) not in (folder / "model_card.md").read_text()


def test_gains_of_a_robot_carry_its_own_feed_forward(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    heavy, stuck = (
        Robot().with_parameters(head_drag_surge=0.5),
        Robot().with_parameters(head_drag_surge=1e4),
    )
    contracts = {}
    for name, robot in {"heavy": heavy, "stuck": stuck}.items():
        file = tmp_path / f"{name}.yaml"
        save_robot(robot, file)
        given = [
            "--robot",
            str(file),
            "--form",
            "constant",
            "--max-seconds",
            "0",
            "--set",
            *SETTINGS,
        ]
        main(["train", "--out", str(tmp_path / name), *given])  # one episode
        contracts[name] = read_gains_file(tmp_path / name / "seed_1" / "gains.safetensors").contract
    law = law_of_robot(heavy)
    assert (contracts["heavy"].limits, contracts["heavy"].guidance) == (law.limits, law.guidance)
    assert (contracts["stuck"].limits, contracts["stuck"].guidance) == (
        ControlLimits(),
        GuidanceConfig(),
    )
    said = capsys.readouterr().out
    assert f"heavy.yaml: throttle {law.limits.throttle_linear:.3g} u" in said
    assert "the nominal fish's feed-forward is used" in said


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["train", "--set", "batch=0"], "batch: got 0"),
        (["train", "--set", "radii=[0.05]"], "radii: got 0.05"),
        (["train", "--search"], "differential evolution is for --form constant or schedule"),
        (["train", "--robot", "nowhere.yaml"], "nowhere.yaml"),
        (["train", "--warm-start", "nowhere.safetensors"], "nowhere.safetensors"),
        (["train", "--seeds", "0"], "expected counts of at least 1"),
        (["train", "--set", "batch=2020-13-45"], "'2020-13-45' is not a value"),
        (["train", "--set", "radii=[1.0"], "'[1.0' is not a value: while parsing a flow sequence"),
        (
            ["train", "--config", BROKEN],
            "broken.yaml: cannot be read as YAML: while scanning a simple key",
        ),
        (["train", "--resume", "--overwrite"], "--resume --overwrite: one continues the runs"),
        (["train", "--max-seconds", "nan"], "--max-seconds nan: expected at least 0 s"),
        (["train", "--max-seconds", "-1"], "--max-seconds -1: expected at least 0 s"),
        (
            ["train", "--form", "constant", "--search", "--max-seconds", "9"],
            "leave out --max-seconds",
        ),
        (
            ["train", "--form", "constant", "--search", "--resume"],
            "--search --resume: a search cannot be continued",
        ),
        (["evaluate"], "nothing to evaluate"),
        (["evaluate", "--constant", "1,2"], "got 2 numbers"),
        ([*EVALUATE, GAINS], "constant: more than one of --weights and --constant has this name"),
        ([*EVALUATE, "--off", "1.5"], "off: got 1.5; expected a share"),
        ([*EVALUATE, "--latency", "-1"], "camera_latency = -1.0: expected"),
        ([*EVALUATE, "--current", "nan"], "effects.current.y: got nan"),
        ([*EVALUATE, "--paths", "circle:radius=[1"], "got '[1' as radius"),
        ([*EVALUATE, "--perfect", "--latency", "0.3"], "no camera takes part"),
        ([*EVALUATE, "--robust", "--off", "0.1"], "leave out --off or --robust"),
        ([*EVALUATE, "--robust", "--current", "0.1"], "leave out --current or --robust"),
        (
            [*EVALUATE, "--robust", "--latency", "0.1", "--perfect"],
            "leave out --latency --perfect or --robust",
        ),
        (["coverage", "--seed", "-1"], "--seed -1: expected at least"),
        (["coverage", "--duration", "inf"], "--duration inf --seed 0: expected at least"),
        (["weights", "show", "nowhere.safetensors"], "nowhere.safetensors"),
    ],
)
def test_bad_input_is_one_line(
    arguments: list[str],
    said: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / BROKEN).write_text("batch: 2\nunroll")
    assert main(arguments) == 1
    error = capsys.readouterr().err
    assert said in error
    assert error.count("\n") == 1


@pytest.mark.parametrize(
    ("typed", "kept"),
    [
        (
            "--out=/home/me/runs --robot=/home/me/fish/model.yaml --jobs=4 --seed=3",
            "--robot=model.yaml --seed=3",
        ),
        ("--out /home/me/runs --robot /home/me/fish/model.yaml --jobs 4", "--robot model.yaml"),
        ("--ou=/home/me/runs --jo 4 --res --seeds 2", "--seeds 2"),
        (
            "--overwrite --set=batch=2 unroll=3 --config ../r/e.yaml",
            "--set=batch=2 unroll=3 --config e.yaml",
        ),
    ],
)
def test_the_command_that_travels_with_the_weights_names_no_folder(typed: str, kept: str) -> None:
    assert command_line(["robofish", "train", *typed.split()]) == kept.split()


def test_what_resume_and_overwrite_contradict_about_is_left_alone(tmp_path: Path) -> None:
    folder = tmp_path / "seed_1"
    folder.mkdir()
    (folder / "checkpoint.npz").write_bytes(b"days of work")
    assert main(["train", "--out", str(tmp_path), "--resume", "--overwrite"]) == 1
    assert (folder / "checkpoint.npz").read_bytes() == b"days of work"
