# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Recipes: the shipped YAML is the default, and what cannot work is refused by name."""

from pathlib import Path

import pytest

from fish_report.errors import UserError
from fish_train.training.config import TrainConfig, load_config, make_config
from fish_train.verbs.train import parse_settings

RECIPE = Path(__file__).parents[1] / "config" / "train.yaml"


def test_the_shipped_recipe_is_the_default() -> None:
    content = load_config(RECIPE)
    assert list(content) == list(TrainConfig().to_plain())
    assert make_config(content) == TrainConfig()


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"batch": 0}, "batch: got 0"),
        ({"unroll": 2.5}, "unroll: got 2.5; expected a whole number"),
        ({"slowest": 0.3, "fastest": 0.1}, "slowest: got 0.3 m/s; expected at most fastest"),
        ({"fastest": 0.9}, "fastest: got 0.9"),
        ({"radii": [1.0, 0.01]}, "radii: got 0.01"),
        ({"radii": []}, "radii: got ()"),
        ({"thresholds": [0.01, 0.03]}, "thresholds: got .* falling"),
        ({"sinusoid_length": 3.0}, "turns within 0.06 m; expected at least 0.15 m"),
        ({"approach": 20.0}, "approach: got 20.0 s; expected less than an episode"),
        ({"latency": 2.0}, "latency: got 2.0"),
        ({"learning_rate": float("nan")}, "learning_rate: got nan"),
        ({"start_speed_ki": 0.5}, "start_speed_ki: got 0.5"),
        ({"lerning_rate": 1e-3}, "unknown name 'lerning_rate'; known: batch"),
    ],
)
def test_what_cannot_work_is_refused_by_name(values: dict, said: str) -> None:
    with pytest.raises(UserError, match=said.replace("(", r"\(").replace(")", r"\)")):
        make_config(values)


def test_settings_of_the_command_line() -> None:
    assert parse_settings(["batch=4", "learning_rate=3e-4", "radii=[1.0, 0.8]"]) == {
        "batch": 4,
        "learning_rate": 3e-4,
        "radii": [1.0, 0.8],
    }
    with pytest.raises(UserError, match="--set batch: expected KEY=VALUE"):
        parse_settings(["batch"])
    with pytest.raises(UserError, match="expected a number"):
        parse_settings(["batch=many"])


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"batch: 2020-13-45", "cannot be read as YAML: month must be in 1..12"),
        (b"batch: [1", "cannot be read as YAML: while parsing"),
        (b"name: \xff", "cannot be read as YAML: 'utf-8' codec"),
        (b"[batch]", "got list; expected a table of name: value"),
    ],
)
def test_a_recipe_that_is_no_table_is_refused_with_its_name(
    content: bytes, said: str, tmp_path: Path
) -> None:
    (tmp_path / "recipe.yaml").write_bytes(content)
    with pytest.raises(UserError, match=f"recipe.yaml: {said}"):
        load_config(tmp_path / "recipe.yaml")


def test_an_empty_recipe_is_the_default(tmp_path: Path) -> None:
    (tmp_path / "recipe.yaml").write_text("# all as shipped\n")
    assert make_config(load_config(tmp_path / "recipe.yaml")) == TrainConfig()
