# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Predict a recording: every HORIZON seconds the robot starts from its estimated state and swims on with the recorded inputs.

The state is estimated by a Kalman filter with the same model from what was measured up to that moment. The table has one
row for each camera pose; pose and heading are what the camera should show and what it showed. Body velocities, measured
and predicted alike, are the slope of a straight line through the poses within half a second (Hann window), so that the
swing of the strokes is averaged out.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from fish_bag.recording_files import files_under
from fish_bag.topic_map import add_topic_arguments, topic_map
from fish_report.errors import user_errors
from fish_report.files import writable_file
from fish_report.terminal import say, terminal
from fish_sim.robot_file import read_model
from fish_sysid.dataset.read import line, read_experiment


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of the verb."""
    parser.add_argument("recording", type=Path, help="one recording, or a folder of trials")
    parser.add_argument("--model", type=Path, required=True, help="model.yaml or robot.yaml")
    parser.add_argument(
        "--horizon", type=float, default=2.0, help="s between start points (default: %(default)s)"
    )
    parser.add_argument(
        "--out", type=Path, default=Path("predictions.csv"), help="table (default: %(default)s)"
    )
    add_topic_arguments(parser)


def run(args: argparse.Namespace) -> int:
    """Write the table, print the errors."""
    from fish_report.terminal import print_table
    from fish_sysid.estimation.map_fit import initial_noise
    from fish_sysid.estimation.noise_estimation import usual_noise
    from fish_sysid.prediction.kept_noise import kept_noise
    from fish_sysid.prediction.prediction import WARM_UP, predict, prediction_errors
    from fish_sysid.reports.identify_tables import error_table, write_predictions

    console = terminal()
    writable_file(args.out, inputs=(*files_under(args.recording), args.model, args.topics))
    model = read_model(args.model)
    experiment, left_out = read_experiment(args.recording, topics=topic_map(args))
    with user_errors():
        noise = kept_noise(model) or initial_noise(experiment, model, usual_noise(experiment))
        predictions = predict(experiment, model, noise, args.horizon)
        rows = write_predictions(args.out, predictions)
        horizons = tuple(h for h in (1.0, 2.0, 5.0) if h <= args.horizon) or (args.horizon,)
        errors = prediction_errors(
            predict(experiment, model, noise, args.horizon, 1.0, WARM_UP), horizons
        )
    for text in left_out:
        say(console, line(text))
    if errors.counts.any():
        print_table(console, error_table({"model": errors}))
    else:
        say(
            console,
            f"no trial lasts {WARM_UP + args.horizon:g} s: errors at the horizon cannot be stated",
        )
    say(console, f"{rows} rows: {args.out}")
    return 0
