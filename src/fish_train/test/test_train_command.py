"""The verbs as a user types them."""

import json
from pathlib import Path

import pytest

from fish_train.commands.main import main

SETTINGS = [
    "batch=2", "unroll=2", "hold=5", "episode=1.0", "approach=0.2", "amplitudes=[1.0]", "cycles=[0.5]", "radii=[1.5]",
    "thresholds=[0.4]", "criterion_episodes=1", "polish_updates=4",
]  # fmt: skip


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


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["train", "--set", "batch=0"], "batch: got 0"),
        (["train", "--set", "radii=[0.05]"], "radii: got 0.05"),
        (["train", "--search"], "differential evolution is for --form constant or schedule"),
        (["train", "--robot", "nowhere.yaml"], "nowhere.yaml"),
        (["train", "--warm-start", "nowhere.safetensors"], "nowhere.safetensors"),
        (["train", "--seeds", "0"], "expected counts of at least 1"),
        (["evaluate"], "nothing to evaluate"),
        (["evaluate", "--constant", "1,2"], "got 2 numbers"),
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
    assert main(arguments) == 1
    error = capsys.readouterr().err
    assert said in error and error.count("\n") == 1
