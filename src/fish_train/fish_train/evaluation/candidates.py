# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Gains to be compared, read from what training wrote or from the command line."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from fish_control.control_law import Gains
from fish_control.gains_file import GainsFileError, read_gains_file, require_fit
from fish_control.path_batch import TrackerConfig
from fish_control.policy import Policy
from fish_control.policy_spec import OUTPUTS, PolicySpec
from fish_report.errors import UserError
from fish_train.evaluation.gains_source import PolicyGains, ScheduledGains
from fish_train.evaluation.study import Candidate
from fish_train.training.closed_loop_equations import CONTROL_PERIOD, Law
from fish_train.training.network import FORMS, weight_count

# of a schedule, with the names and checks of a weights file's contract
LAW_KEYS = ("lookahead", "limits", "guidance")


def read_candidate(text: str) -> Candidate:
    """`[NAME=]FILE` of a weights file (.safetensors) or of a schedule (.json); a file's own path may have a `=` in it."""
    name, equals, rest = ("", "", text) if Path(text).is_file() else text.partition("=")
    path = Path(rest if equals else text)
    name = name if equals else f"{path.parent.name}/{path.stem}" if path.parent.name else path.stem
    return read_schedule(name, path) if path.suffix == ".json" else read_policy(name, path)


def read_policy(name: str, path: Path) -> Candidate:
    """A weights file with the law it was made for."""
    try:
        policy = read_gains_file(path)
        # as the controller node asks; the lookahead is the file's own here
        require_fit(policy, path, CONTROL_PERIOD, policy.contract.lookahead)
    except GainsFileError as error:
        raise UserError(str(error)) from error
    return Candidate(name, PolicyGains(policy), _law(policy.contract, path))


def read_schedule(name: str, path: Path) -> Candidate:
    """The coefficients of scheduled gains with their law; a file without a law has the nominal fish's."""
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        weights = np.array(content["weights"], dtype=float)
        has_law = any(key in content for key in LAW_KEYS)
        given = {key: content[key] for key in LAW_KEYS} if has_law else {}
        contract = PolicySpec.from_json({**PolicySpec(layers=()).to_json(), **given})
    except (json.JSONDecodeError, KeyError, TypeError, ValueError) as error:
        raise UserError(
            f"{path}: not a schedule written by robofish train --form schedule ({error})"
        ) from error
    expected = weight_count(FORMS["schedule"].layers)
    if weights.shape != (expected,):
        raise UserError(f"{path}: weights have shape {weights.shape}; expected ({expected},)")
    return Candidate(name, ScheduledGains(weights), _law(contract, path))


def _law(contract: PolicySpec, path: Path) -> Law:
    """What a file says of the law its gains were made for."""
    try:
        tracker = TrackerConfig(lookahead=contract.lookahead)
    except ValueError as error:
        raise UserError(f"{path}: {error}") from error
    return Law(limits=contract.limits, guidance=contract.guidance, tracker=tracker)


def constant_candidate(text: str) -> Candidate:
    """`[NAME=]kp,ki,kd,kp,ki,kd` of steering and speed."""
    name, equals, rest = text.partition("=")
    try:
        values = [float(part) for part in (rest if equals else text).split(",")]
    except ValueError:
        raise UserError(
            f"constant gains {text!r}: expected six numbers, kp,ki,kd of steering and of speed"
        ) from None
    if len(values) != len(OUTPUTS):
        raise UserError(
            f"constant gains {text!r}: got {len(values)} numbers; expected {len(OUTPUTS)}"
        )
    for value, output in zip(values, OUTPUTS, strict=True):
        if not output.low <= value <= output.high:
            raise UserError(
                f"{output.name}: got {value}; expected {output.low:g} to {output.high:g}"
            )
    return Candidate(name if equals else "constant", PolicyGains(Policy.constant(Gains(*values))))
