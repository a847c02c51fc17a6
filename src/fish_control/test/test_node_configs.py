# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""YAML files and dataclasses say the same; ranges are checked."""

from dataclasses import asdict
from pathlib import Path

import pytest
import yaml

from fish_control.excitation import LAST_ROW
from fish_control.gains_file import read_gains_file
from fish_control.node_configs import (
    ControllerConfig,
    ExciterConfig,
    FusionNodeConfig,
    PlannerConfig,
)

CONFIG = Path(__file__).parents[1] / "config"


@pytest.mark.parametrize(
    ("name", "kind"),
    [
        ("fusion", FusionNodeConfig),
        ("planner", PlannerConfig),
        ("controller", ControllerConfig),
        ("exciter", ExciterConfig),
    ],
)
def test_yaml_holds_the_dataclass(name, kind):
    parameters = yaml.safe_load((CONFIG / f"{name}.yaml").read_text())["/**"]["ros__parameters"]
    defaults = asdict(kind()).items()
    assert parameters == {k: list(v) if isinstance(v, tuple) else v for k, v in defaults}
    assert list(parameters) == list(asdict(kind()))


def test_the_exciters_comment_says_how_long_the_last_row_lasts():
    (end,) = [
        line for line in (CONFIG / "exciter.yaml").read_text().splitlines() if " end:" in line
    ]
    assert end.endswith(f"its end, {LAST_ROW:g} s after its last row begins")


def test_shipped_weights_fit_the_shipped_controller():
    config = ControllerConfig()
    policy = read_gains_file(CONFIG / "gains.safetensors")
    assert policy.contract.differences(1.0 / config.rate_hz, config.lookahead) == []


@pytest.mark.parametrize(
    ("kind", "field", "value", "expected"),
    [
        (PlannerConfig, "speed", 0.6, "0.05 to 0.5 m/s"),
        (PlannerConfig, "speed", float("nan"), "0.05 to 0.5 m/s"),
        (PlannerConfig, "end", "bounce", "known: , stop, loop"),
        (PlannerConfig, "start", "middle", "known: beginning, nearest"),
        (PlannerConfig, "lookahead", 0.0, "lookahead"),
        (ControllerConfig, "command_rate_hz", 120.0, "a multiple of rate_hz"),
        (ControllerConfig, "odometry_timeout", 0.0, "0.02 to 5"),
        (ExciterConfig, "begin", -1.0, "0 to 3600 s"),
        (ExciterConfig, "margin", float("nan"), "0 to 1 m"),
    ],
)
def test_a_value_out_of_range_is_named(kind, field, value, expected):
    with pytest.raises(ValueError) as refusal:
        kind(**{field: value})
    assert field in str(refusal.value)
    assert repr(value) in str(refusal.value)
    assert expected in str(refusal.value)
