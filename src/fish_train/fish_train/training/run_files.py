# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Files of a training run: its checkpoint, the weights file that the controller loads, the model card.

A checkpoint is saved whole or not at all, so that a killed run continues exactly.
"""

from __future__ import annotations

import json
import math
import os
import zipfile
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from fish_control.gains_file import read_gains_file, write_gains_file
from fish_control.policy import Policy
from fish_control.policy_spec import PolicySpec
from fish_report.errors import UserError
from fish_report.files import write_json
from fish_sim.ops import NUMPY
from fish_train.training.closed_loop_equations import CONTROL_PERIOD, Law, gains_of
from fish_train.training.network import FORMS, to_tensors, weight_count
from fish_train.training.trainer import Progress, Trainer

FORMAT = 1
# each form has a number of weights of its own
FORM_OF = {weight_count(form.layers): name for name, form in FORMS.items()}
# of the recipe what may be another when a run goes on: it decides where the run ends, not how it gets there
FREE = ("max_updates",)
# relative: a feed-forward that is measured again, with other libraries, differs in the last digits
LAW_TOLERANCE = 1e-6
WEIGHTS = "gains.safetensors"
SCHEDULE = "schedule.json"
WHAT = {
    "policy": (
        "Maps head angle, surge speed, wanted speed, heading, speed and cross-track error to the six gains of the two",
        "PID controllers; network 6-128-128-64-6, ReLU, tanh to the gain ranges. Read by the controller node",
        "(fish_control) without torch.",
    ),
    "none": (
        "Six constant gains of the two PID controllers, a baseline. Read by the controller node (fish_control).",
    ),
    "schedule": (
        "Gains of the two PID controllers by wanted speed and path curvature: a baseline, not for the robot.",
    ),
}
CARD = "model_card.md"


def save_checkpoint(path: Path, trainer: Trainer) -> None:
    """Write the trainer's state; an older checkpoint is replaced in one step."""
    plain, arrays = trainer.state()
    content: dict[str, Any] = arrays
    plain |= {
        "format": FORMAT,
        "config": trainer.config.to_plain(),
        "robot": trainer.robot.digest(),
    }
    plain["law"] = law_constants(trainer.law)
    part = path.with_suffix(".part")
    with part.open("wb") as stream:
        np.savez(stream, plain=np.array(json.dumps(plain)), **content)
    os.replace(part, path)


def load_checkpoint(path: Path, trainer: Trainer) -> None:
    """Bring a freshly made trainer to a saved state.

    Raises:
        UserError: not a checkpoint, or one of another form, recipe, robot, seed or law; says what differs.
    """
    try:
        with np.load(path, allow_pickle=False) as content:
            arrays = {name: content[name] for name in content.files}
        plain: dict[str, Any] = json.loads(str(arrays.pop("plain")))
    except (zipfile.BadZipFile, ValueError, KeyError, EOFError) as error:
        raise UserError(
            f"{path}: not a checkpoint of training ({error}); start anew with --overwrite"
        ) from error
    came = (plain.get("format"), plain.get("robot"), plain.get("seed"))
    expected = (FORMAT, trainer.robot.digest(), trainer.seed)
    if came != expected:
        raise UserError(f"{path}: format, robot and seed are {came}; expected {expected}")
    ours = {"form": FORM_OF[trainer.weights.size], **trainer.config.to_plain()}
    theirs = {"form": FORM_OF.get(arrays["weights"].size), **plain["config"]}
    differing = [k for k in ours if k not in FREE and ours[k] != theirs.get(k)]
    if differing:
        said = ", ".join(f"{k} was {theirs.get(k)!r}, is {ours[k]!r}" for k in differing)
        raise UserError(
            f"{path}: made by another recipe: {said}; continue with the same or start anew (--overwrite)"
        )
    _check_law(path, plain.get("law"), law_constants(trainer.law))
    trainer.restore(plain, arrays)


def law_constants(law: Law) -> dict[str, Any]:
    """The constants of a law by name; what its policy looks at is the form's."""
    parts = {
        "limits": asdict(law.limits),
        "guidance": asdict(law.guidance),
        "tracker": asdict(law.tracker),
    }
    return {
        f"{part}.{name}": value for part, values in parts.items() for name, value in values.items()
    }


def _check_law(path: Path, theirs: Mapping[str, Any] | None, ours: Mapping[str, Any]) -> None:
    """Refuse to continue with another law than before: the weights file would carry one that few updates have seen."""
    if theirs is None:  # of a version that did not note it: most likely the nominal fish's
        if ours == law_constants(Law()):
            return
        raise UserError(
            f"{path}: made before checkpoints noted the law's feed-forward, so it may be another than that of this robot; "
            "start anew (--overwrite, or another folder)"
        )
    differing = [k for k in ours if not _same(ours[k], theirs.get(k))]
    if differing:
        said = ", ".join(f"{k} was {theirs.get(k)!r}, is {ours[k]!r}" for k in differing)
        raise UserError(
            f"{path}: trained with another law: {said}; give --robot as it was given then (or leave it out), or start "
            "anew (--overwrite, or another folder)"
        )


def _same(a: object, b: object) -> bool:
    if isinstance(a, float) and isinstance(b, float | int):
        return math.isclose(a, b, rel_tol=LAW_TOLERANCE)
    return a == b


def make_policy(trainer: Trainer, note: str) -> Policy:
    """The trained network or constants with their contract."""
    law: Law = trainer.law
    constant = trainer.form.inputs == "none"
    contract = PolicySpec(
        layers=() if constant else trainer.form.layers,
        control_period=CONTROL_PERIOD,
        lookahead=law.tracker.lookahead,
        limits=law.limits,
        guidance=law.guidance,
        robot_hash=trainer.robot.digest(),
        training_seed=trainer.seed,
        note=note,
    )
    if constant:
        return Policy(contract, {"gains": np.array(gains_of(list(trainer.weights), NUMPY))})
    return Policy(contract, to_tensors(trainer.weights))


def write_weights(folder: Path, trainer: Trainer, command: str) -> None:
    """Write the weights file, or a schedule's coefficients with their law: no controller loads a schedule."""
    if trainer.form.inputs == "schedule":
        law: Law = trainer.law
        content = {
            "form": "schedule",
            "command": command,
            "lookahead": law.tracker.lookahead,
            "limits": asdict(law.limits),
            "guidance": asdict(law.guidance),
            "weights": trainer.weights,
        }
        write_json(folder / SCHEDULE, content)
    else:
        write_gains_file(folder / WEIGHTS, make_policy(trainer, f"trained by: {command}"))


def holds_weights(folder: Path, trainer: Trainer) -> bool:
    """Whether the weights file in the folder holds the trainer's weights; a file that cannot be read does not."""
    try:
        if trainer.form.inputs == "schedule":
            content = json.loads((folder / SCHEDULE).read_text(encoding="utf-8"))
            return bool(content["weights"] == trainer.weights.tolist())
        there = read_gains_file(folder / WEIGHTS).tensors
    except (OSError, ValueError, KeyError, TypeError):
        return False
    ours = make_policy(trainer, "").tensors
    return there.keys() == ours.keys() and all(
        np.array_equal(there[name], ours[name]) for name in ours
    )


def write_card(
    folder: Path, trainer: Trainer, made: str, last: Progress | None, seconds: float, command: str
) -> None:
    """Model card; `made`: how."""
    (folder / CARD).write_text(model_card(trainer, made, last, seconds, command), encoding="utf-8")


def training_state(trainer: Trainer, diverged: bool = False) -> str:
    """How far training came; diverged: training went back to the last good checkpoint."""
    how = "diverged, rolled back to" if diverged else "stopped at"
    state = (
        "finished" if trainer.finished else f"{how} level {trainer.level} of {len(trainer.levels)}"
    )
    return f"training {state} after {trainer.update} updates"


def model_card(
    trainer: Trainer, made: str, last: Progress | None, seconds: float, command: str
) -> str:
    """Markdown: what the policy is, how it was trained, how well it follows paths."""
    c, robot = trainer.config, trainer.robot
    effects = ", ".join(robot.effects) or "none"
    lines = [
        "# Gains policy of the robot fish",
        "",
        *WHAT[trainer.form.inputs],
        "",
        f"- command: `{command}`",
        f"- seed {trainer.seed}; {made}, {seconds:.0f} s",
        f"- robot: {robot.name}, {robot.links} links, effects: {effects}; hash {robot.digest()}",
        f"- speeds {c.slowest} to {c.fastest} m/s; sinusoids {list(c.amplitudes)} m with {list(c.cycles)} cycles over "
        f"{c.sinusoid_length} m; circles {list(c.radii)} m",
        f"- domain randomisation {c.randomise:.0%}, latency up to {c.latency} s, noise {c.noise_position} m, "
        f"{c.noise_heading} rad, {c.noise_speed} m/s, {c.noise_rate} rad/s",
    ]
    if last is not None:
        lines += [
            f"- last training episode ({last.name}): mean |cross-track| {last.cross_track:.4f} m, heading "
            f"{last.heading:.3f} rad, speed {last.speed:.4f} m/s",
        ]
    lines += [
        "",
        "Not for: speeds or curves outside these ranges, other robots; `robofish evaluate` tells.",
        "",
        "## Recipe",
        "",
        "```yaml",
        *(f"{name}: {value}" for name, value in c.to_plain().items()),
        "```",
        "",
    ]
    return "\n".join(lines)
