# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Gains to be compared: the policy of a weights file or a baseline's form, read from files or from the command line."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from fish_control.control_law import Gains
from fish_control.gains_file import GainsFileError, read_gains_file, require_fit
from fish_control.path_batch import TrackerConfig
from fish_control.policy import Policy, policy_inputs
from fish_control.policy_spec import OUTPUTS, PolicySpec
from fish_report.errors import UserError
from fish_sim.ops import NUMPY
from fish_train.training.closed_loop_equations import CONTROL_PERIOD, Law, gains_of, schedule_inputs
from fish_train.training.network import FORMS, split, weight_count

Array = NDArray[np.float64]
# the values of `policy_inputs` in its order, each (B,)
Situation = tuple[Array, Array, Array, Array, Array, Array]


class GainsSource(Protocol):
    """Gains for a batch of situations."""

    def gains(self, situation: Situation, speed: Array, curvature: Array) -> Gains:
        """Situations, wanted speed (B,) [m/s], path curvature (B,) [1/m] -> gains, each (B,)."""


@dataclass(frozen=True)
class PolicyGains:
    """A weights file's policy, with a network or constant."""

    policy: Policy

    def gains(self, situation: Situation, speed: Array, curvature: Array) -> Gains:  # noqa: ARG002
        """The policy looks at its inputs only, in the scales of its own contract."""
        inputs = policy_inputs(*situation, np, self.policy.contract.inputs)
        return self.policy.gains(np.stack(inputs, axis=-1))


@dataclass(frozen=True)
class ScheduledGains:
    """Gains that follow wanted speed and curvature smoothly: tanh(W x + b), scaled to the ranges.

    x = ((u - 0.2) / 0.1, |kappa| / 3); weights: flat (18,), W (6, 2) then b (6,).
    """

    weights: Array

    def gains(self, situation: Situation, speed: Array, curvature: Array) -> Gains:  # noqa: ARG002
        """By wanted speed and curvature only."""
        [(W, b)] = split(np.asarray(self.weights), FORMS["schedule"].layers)
        x = np.stack(schedule_inputs(speed, curvature, NUMPY), axis=-1)
        return gains_of(list(np.moveaxis(x @ W.T + b, -1, 0)), NUMPY)


@dataclass(frozen=True)
class Candidate:
    """Gains and the constants of the law they were made for."""

    name: str
    gains: GainsSource
    law: Law = field(default_factory=Law)


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
