# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""A training run on disk: saved whole or not at all, so that a killed run continues exactly."""

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

from fish_report.errors import UserError
from fish_train.training.closed_loop_equations import Law
from fish_train.training.network import FORMS, weight_count
from fish_train.training.trainer import Trainer

FORMAT = 1
# each form has a number of weights of its own
FORM_OF = {weight_count(form.layers): name for name, form in FORMS.items()}
# of the recipe what may be another when a run goes on: it decides where the run ends, not how it gets there
FREE = ("max_updates",)
# relative: a feed-forward that is measured again, with other libraries, differs in the last digits
LAW_TOLERANCE = 1e-6


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
