# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""One training run in its folder: resume, train, save, write the weights."""

from __future__ import annotations

import shutil
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import torch

from fish_control.gains_file import GainsFileError, read_gains_file
from fish_control.policy_spec import INPUTS, OUTPUTS
from fish_report.errors import UserError
from fish_sim.robot import Robot
from fish_train.training.closed_loop_equations import Law
from fish_train.training.config import TrainConfig
from fish_train.training.network import (
    FORMS,
    LAYERS,
    Array,
    from_tensors,
)
from fish_train.training.run_files import (
    CARD,
    holds_weights,
    load_checkpoint,
    save_checkpoint,
    training_state,
    write_card,
    write_weights,
)
from fish_train.training.run_log import RunLog
from fish_train.training.search import search
from fish_train.training.trainer import Progress, Trainer, TrainingDiverged

CHECKPOINT = "checkpoint.npz"
CHECKPOINT_PERIOD = 5.0  # s
State = Literal["training", "finished", "stopped", "diverged"]


@dataclass(frozen=True)
class Job:
    """What to train and where."""

    folder: Path
    config: TrainConfig
    robot: Robot
    seed: int
    command: str  # said in weights file and model card
    warm_start: Path | None = None
    form: str = "network"  # of network.FORMS
    search: bool = False  # differential evolution instead of gradients
    resume: bool = False
    overwrite: bool = False
    max_seconds: float = float("inf")
    law: Law = field(default_factory=Law)  # with the robot's feed-forward


@dataclass(frozen=True)
class Status:
    """What the display shows of a run."""

    seed: int
    state: State
    levels: int
    seconds: float
    rate: float  # environment steps per second since this start
    progress: Progress | None
    message: str = ""


def run(job: Job, report: Callable[[Status], None]) -> Status:
    """Train to the end of the recipe; returns the last status.

    Training that diverges goes back to the last good checkpoint, and its weights are written. Status, curve and card
    describe these weights and no update after them.
    """
    torch.set_num_threads(1)
    # whatever can be refused is refused before --overwrite deletes a run
    trainer = Trainer(job.config, job.robot, job.seed, job.law, check_job(job), FORMS[job.form])
    checkpoint = prepare_folder(job)
    if checkpoint.exists():
        load_checkpoint(checkpoint, trainer)
    else:
        save_checkpoint(checkpoint, trainer)
    if job.search:
        return _search(job, trainer, report)
    with RunLog(job.folder, trainer.update) as log:
        session = _Session(job, trainer, log, report)
        try:
            state: State = session.train()
            message = session.what_is_left() if state == "stopped" else ""
        except TrainingDiverged as error:
            at = trainer.update
            load_checkpoint(checkpoint, trainer)
            session.roll_back()
            state = "diverged"
            message = (
                f"training diverged at update {at} ({error}); rolled back to update {trainer.update}, whose "
                "weights are kept. Use a smaller learning_rate or clip"
            )
    if not holds_weights(job.folder, trainer):  # what an earlier start handed out keeps its note
        write_weights(job.folder, trainer, job.command)
    made, card = training_state(trainer, diverged=state == "diverged"), job.folder / CARD
    # a run that was finished before has no episode to tell of; its card does
    if not card.exists() or made not in card.read_text(encoding="utf-8"):
        write_card(job.folder, trainer, made, session.progress, session.seconds, job.command)
    status = session.status(state, message)
    report(status)
    return status


def _search(job: Job, trainer: Trainer, report: Callable[[Status], None]) -> Status:
    """Write what differential evolution finds."""
    began = time.monotonic()

    def status(state: State, message: str) -> Status:
        return Status(
            job.seed, state, len(trainer.levels), time.monotonic() - began, 0.0, None, message
        )

    cost, weights = search(trainer, lambda text: report(status("training", text)))
    trainer.set_weights(weights)
    made = f"found by differential evolution, mean stage cost {cost:.5f}"
    write_weights(job.folder, trainer, job.command)
    write_card(job.folder, trainer, made, None, time.monotonic() - began, job.command)
    last = status("finished", f"mean stage cost {cost:.5f}")
    report(last)
    return last


class _Session:
    """The loop of one start of a run."""

    def __init__(
        self, job: Job, trainer: Trainer, log: RunLog, report: Callable[[Status], None]
    ) -> None:
        self._job, self._trainer, self._log, self._report = job, trainer, log, report
        self._began, self._first = time.monotonic(), trainer.update
        self.progress: Progress | None = None
        # what the checkpoint's last episode was like; None: it is of an earlier start
        self._saved: Progress | None = None

    @property
    def seconds(self) -> float:
        return self._log.seconds + time.monotonic() - self._began

    def train(self) -> Literal["finished", "stopped"]:
        """Until finished or out of budget; the state it ended in."""
        trainer, saved = self._trainer, time.monotonic()
        while not trainer.finished:
            # a run that was at its limit before this start goes no further; the first start swims one episode at least
            limit = self._limit() if trainer.update > 0 else ""
            if limit or time.monotonic() - saved >= CHECKPOINT_PERIOD:
                self._save()
                saved = time.monotonic()
            if limit:
                return "stopped"
            self._episode()
        trainer.end_episode_early()
        self._save()
        return "finished"

    def _limit(self) -> str:
        """The limit that the run has reached, as the user gave it; empty: none."""
        if self._trainer.update >= self._job.config.max_updates:
            return f"max_updates {self._job.config.max_updates}"
        return (
            f"--max-seconds {self._job.max_seconds:g}"
            if self.seconds >= self._job.max_seconds
            else ""
        )

    def _episode(self) -> None:
        """Swim and report one episode; the polish may end within it."""
        progress = None
        while progress is None and not self._trainer.finished:
            progress = self._trainer.step()
        if progress is not None:
            self.progress = progress
            self._log.add(self.seconds, progress)
            self._report(self.status("training"))

    def what_is_left(self) -> str:
        """Why a run that was stopped did not finish: a level that noise does not let pass looks like one that takes long."""
        trainer, limit = self._trainer, self._limit()
        more = f"{limit.split()[0]} can be raised with --resume"
        if trainer.passed_all:
            return f"stopped at {limit} in the polish, every level passed; {more}"
        level = trainer.levels[trainer.level]
        return (
            f"stopped at {limit} before the level was passed ({level.name}): mean |cross-track| of the last episodes "
            f"{trainer.criterion.mean:.4f} m, expected below {level.threshold:g} m over {self._job.config.criterion_episodes} "
            f"episodes; {more}; where the error falls no further (noise, latency and randomise set a floor) start anew "
            "with higher thresholds"
        )

    def _save(self) -> None:
        self._log.flush()
        save_checkpoint(self._job.folder / CHECKPOINT, self._trainer)
        self._saved = self.progress

    def roll_back(self) -> None:
        """Drop what was reported after the checkpoint, to which the trainer has returned."""
        self.progress = self._saved
        self._log.roll_back(self._trainer.update)

    def status(self, state: State, message: str = "") -> Status:
        """For the display."""
        trainer, c = self._trainer, self._job.config
        steps = (trainer.update - self._first) * c.batch * c.unroll
        spent = max(time.monotonic() - self._began, 1e-9)
        return Status(
            self._job.seed,
            state,
            len(trainer.levels),
            self.seconds,
            steps / spent,
            self.progress,
            message,
        )


def check_job(job: Job) -> Array | None:
    """Refuse a run that cannot start, with nothing touched yet; the weights it starts from, None without a file."""
    there = (job.folder / CHECKPOINT).exists()
    if there and not (job.resume or job.overwrite):
        raise UserError(
            f"{job.folder}: holds a training run; continue it with --resume or replace it with --overwrite"
        )
    if (
        there
        and job.overwrite
        and job.warm_start is not None
        and job.warm_start.resolve().is_relative_to(job.folder.resolve())
    ):
        raise UserError(
            f"--warm-start {job.warm_start}: is of the run that --overwrite deletes; copy it to another folder first"
        )
    return warm_weights(job)


def prepare_folder(job: Job) -> Path:
    """The run's folder, empty or to be continued; the path of its checkpoint."""
    checkpoint = job.folder / CHECKPOINT
    if checkpoint.exists() and job.overwrite:
        shutil.rmtree(job.folder)
    job.folder.mkdir(parents=True, exist_ok=True)
    return checkpoint


def warm_weights(job: Job) -> Array | None:
    """Flat weights of the job's weights file, None without one; only networks start warm."""
    file = job.warm_start
    if file is None:
        return None
    if job.form != "network":
        raise UserError(
            f"--warm-start {file}: got form {job.form}; only a network can start from a weights file"
        )
    try:
        policy = read_gains_file(file)
    except GainsFileError as error:
        raise UserError(str(error)) from error
    if tuple(policy.contract.layers) != LAYERS:
        raise UserError(
            f"{file}: layers are {list(policy.contract.layers)}; a warm start needs {list(LAYERS)}"
        )
    if (policy.contract.inputs, policy.contract.outputs) != (INPUTS, OUTPUTS):
        raise UserError(
            f"{file}: inputs or gains have other scales than those trained here; its weights would mean other gains. "
            "Start from a file that robofish train wrote"
        )
    return from_tensors(policy.tensors)
