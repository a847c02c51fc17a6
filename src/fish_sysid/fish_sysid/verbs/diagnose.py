# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Say where recordings and model differ, which physics is missing, and write the corrected robot."""

from __future__ import annotations

import argparse
import time
from pathlib import Path

from fish_bag.topic_map import add_topic_arguments, topic_map
from fish_report.errors import UserError, user_errors
from fish_report.files import named_path, writable_folder, write_json
from fish_report.terminal import PARAGRAPH, cell, say, terminal
from fish_sim.robot_file import read_model, save_robot
from fish_sysid.dataset.read import line, read_days, read_experiment

FILES = ("diagnosis.json", "model.yaml", "report.html")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the verb's arguments."""
    parser.add_argument(
        "dataset",
        type=Path,
        nargs="+",
        help="recordings or folders of recordings of one robot and day",
    )
    parser.add_argument(
        "--baseline",
        type=Path,
        nargs="+",
        metavar="OLD",
        help="recordings of the same robot when it swam well, a folder for each day: say what changed since, "
        "and nothing of what every recording lacks",
    )
    parser.add_argument("--robot", type=Path, help="robot.yaml (default: the nominal fish)")
    parser.add_argument(
        "--out", type=Path, required=True, help="folder for diagnosis.json, model.yaml, report.html"
    )
    parser.add_argument(
        "--false-alarms",
        type=float,
        help="tolerated share of false alarms (default 0.02)",
    )
    parser.add_argument(
        "--candidates",
        metavar="NAME,NAME",
        help="what competes (default: every name of the vocabulary)",
    )
    parser.add_argument(
        "--without",
        metavar="STAGE,STAGE",
        help="stages of the search to leave out, for an ablation (`robofish prove --without`)",
    )
    add_topic_arguments(parser)


def run(args: argparse.Namespace) -> int:
    """Diagnose, write the three files, print the verdict."""
    from fish_sysid.dataset.camera import with_marker
    from fish_sysid.diagnosis.corrected_model import corrected
    from fish_sysid.diagnosis.diagnosis_json import answer
    from fish_sysid.diagnosis.pipeline import diagnose
    from fish_sysid.diagnosis.significance import Level
    from fish_sysid.diagnosis.vocabulary import NoCandidateError, known
    from fish_sysid.reports.diagnosis_page import write_diagnosis_page
    from fish_sysid.reports.verdict_sentence import sentence

    if args.baseline:
        return _compare(args)
    console, start = terminal(stderr=True), time.monotonic()
    robot = read_model(args.robot)
    with user_errors():
        level = Level() if args.false_alarms is None else Level(args.false_alarms)
        names = known(args.candidates.split(",")) if args.candidates else None
        without = left_out_stages(args.without)
    experiment, left_out = read_experiment(*args.dataset, topics=topic_map(args))
    writable_folder(args.out, names=FILES, inputs=(args.robot, args.topics))
    with console.status("diagnosing") as status:

        def progress(text: str) -> None:
            line = f"{time.monotonic() - start:5.0f} s  {text}"
            status.update(cell(line))
            if not console.is_terminal:
                say(console, line)

        try:
            result = diagnose(experiment, robot, level, progress, names, without=without)
        except NoCandidateError as error:
            raise UserError(str(error)) from error
        content = {**answer(result), "left_out": left_out, "stages": sorted(result.task.acted)}
    write_json(args.out / "diagnosis.json", content)
    fit = corrected(result)
    save_robot(
        with_marker(fit.robot.without_effect("disturbance"), result.task.ahead),
        args.out / "model.yaml",
        fit.standard_errors,
        notes=sentence(content),
    )
    write_diagnosis_page(
        args.out / "report.html", named_path(args.dataset[0]).name, content, result
    )
    for text in [*map(line, left_out), sentence(content)]:
        say(terminal(), text, PARAGRAPH)
    say(terminal(), f"{args.out}/{', '.join(FILES)} ({time.monotonic() - start:.0f} s)")
    return 0


def _compare(args: argparse.Namespace) -> int:
    """What changed since the baseline: the same three files."""
    from fish_sysid.diagnosis.change.change import Change
    from fish_sysid.diagnosis.change.change_json import answer, changed_robot, sentence
    from fish_sysid.diagnosis.change.compare import compare
    from fish_sysid.reports.change_page import write_change_page

    console, start = terminal(stderr=True), time.monotonic()
    for option in ("candidates", "false_alarms", "without"):
        if getattr(args, option) is not None:
            said = option.replace("_", "-")
            raise UserError(
                f"--{said} goes without --baseline: a comparison has its own level and names; leave it out"
            )
    robot = read_model(args.robot)
    new, olds, left_out, unlike = read_days(args.dataset, args.baseline, topic_map(args))
    writable_folder(args.out, names=FILES, inputs=(args.robot, args.topics))

    def progress(text: str) -> None:
        say(console, f"{time.monotonic() - start:5.0f} s  {text}")

    change = (
        compare(new, olds, robot, progress)
        if unlike is None
        else Change("not_comparable", reason=unlike)
    )
    content = answer(change)
    content["left_out"] = [*left_out, *content["left_out"]]
    write_json(args.out / "diagnosis.json", content)
    written = "diagnosis.json, report.html"
    if change.robot is None:  # a model of an earlier comparison says what this one does not
        if (older := args.out / "model.yaml").exists():
            older.unlink()
            written += "; model.yaml of an earlier run is removed"
    else:
        save_robot(changed_robot(change), args.out / "model.yaml", notes=sentence(change))
        written = "diagnosis.json, model.yaml, report.html"
    write_change_page(args.out / "report.html", named_path(args.dataset[0]).name, content, change)
    for text in [*map(line, content["left_out"]), sentence(change)]:
        say(terminal(), text, PARAGRAPH)
    say(terminal(), f"{args.out}/{written} ({time.monotonic() - start:.0f} s)")
    return 0


def left_out_stages(given: str | None) -> frozenset[str]:
    """The stages that --without names, separated by commas; raises UserError for an unknown one."""
    from fish_sysid.diagnosis.task import STAGE_NAMES

    stages = frozenset(given.split(",")) if given else frozenset()
    if unknown := sorted(stages - STAGE_NAMES):
        raise UserError(
            f"--without: got {', '.join(unknown)}; expected stages of the search: {', '.join(sorted(STAGE_NAMES))}"
        )
    return stages
