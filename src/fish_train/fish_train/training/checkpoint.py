"""A training run on disk: saved whole or not at all, so that a killed run continues exactly."""

from __future__ import annotations

import json
import os
import zipfile
from pathlib import Path
from typing import Any

import numpy as np

from fish_train.errors import UserError
from fish_train.training.network import FORMS, weight_count
from fish_train.training.trainer import Trainer

FORMAT = 1
# each form has a number of weights of its own
FORM_OF = {weight_count(form.layers): name for name, form in FORMS.items()}


def save_checkpoint(path: Path, trainer: Trainer) -> None:
    """Write the trainer's state; an older checkpoint is replaced in one step."""
    plain, arrays = trainer.state()
    content: dict[str, Any] = arrays
    plain |= {"format": FORMAT, "config": trainer.config.to_plain(), "robot": trainer.robot.digest()}
    part = path.with_suffix(".part")
    with part.open("wb") as stream:
        np.savez(stream, plain=np.array(json.dumps(plain)), **content)
    os.replace(part, path)


def load_checkpoint(path: Path, trainer: Trainer) -> None:
    """Bring a freshly made trainer to a saved state.

    Raises:
        UserError: not a checkpoint, or one of another form, recipe, robot or seed; says what differs.
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
    differing = [k for k in ours if ours[k] != theirs.get(k)]
    if differing:
        said = ", ".join(f"{k} was {theirs.get(k)!r}, is {ours[k]!r}" for k in differing)
        raise UserError(
            f"{path}: made by another recipe: {said}; continue with the same or start anew (--overwrite)"
        )
    trainer.restore(plain, arrays)
