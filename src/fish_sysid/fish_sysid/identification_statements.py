# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""An identification in words: what the data lack and do not determine, and whether physics beats the baselines."""

from __future__ import annotations

import numpy as np

from fish_sim.model import DT
from fish_sysid.dataset.camera import Alignment
from fish_sysid.dataset.experiment import Experiment
from fish_sysid.estimation.map_fit import Fit
from fish_sysid.estimation.parametrization import Parametrization, left_at_zero
from fish_sysid.estimation.shooting.left_out import Step, step_text
from fish_sysid.estimation.shooting.prediction_fit import IMU_CLOCK, PLACE, PredictionFit
from fish_sysid.estimation.shooting.rollout import ShotParametrization
from fish_sysid.estimation.shooting.selection import RANGE, WIDEST
from fish_sysid.prediction.baselines import AHEAD, BASELINES, PEEK
from fish_sysid.prediction.prediction import HORIZONS, WARM_UP, ErrorSizes
from fish_sysid.prediction.stroke_average import stroke_mean

UNDETERMINED = 0.7  # posterior over prior standard deviation; above, the data say little
ENTANGLED = 0.95  # correlation of two parameters that the data hardly tell apart
# times the error of the robot it began with: more than two robots as good differ by chance
WORSE = 1.1
# rad and share of full speed: below this spread of the commands nothing excites the fish
STILL = 0.02
LONG_GAP = 1.0  # s without a sample of IMU or camera
NO_TURN = 0.3  # rad, between the leftmost and the rightmost stroke-mean heading of a trial
NO_IMU = "its biases stay unknown, and fast motion is seen by the camera only"
AGE_UNKNOWN = (
    "the age of the images is not known: no trial has 5 s of gyro without a pause and of images with it; where images are late, "
    "no fit can be trusted before it is: record the IMU"
)
NO_ENCODER = (
    "the rotor is taken to follow its commands, or its measured speed where that drives the model"
)


def step_statement(step: Step) -> str:
    """What a candidate did to training trials left out in turn."""
    family = f"; {', '.join(step.alike)} would do as well" if step.alike else ""
    return f"{step.name}: {'added' if step.added else 'not added'}; {step_text(step)}{family}"


def prediction_statements(found: PredictionFit) -> list[str]:
    """How a robot was fitted to predictions, and what that says."""
    clocks, deviation = found.sensors, found.sensor_errors
    out = [
        f"number of links of the tail: {found.robot.links}",
        *map(step_statement, found.links_judged),
    ]
    out += [
        f"{name}: {clocks[name]:+.3f} +- {deviation[name]:.3f} beyond what was taken out before, by predictions"
        for name in clocks
        if name not in (IMU_CLOCK, PLACE)
    ]
    out.append(
        f"the camera follows a point {clocks[PLACE]:+.3f} +- {deviation[PLACE]:.3f} m ahead of the head's centre of mass, "
        "by predictions: measure where the markers sit"
    )
    if RANGE in found.found.hypothesis.free:
        out.append(
            f"commands of the rudder go beyond rudder_range: the range is fitted ({found.robot.parameters[RANGE]:.2f} rad)"
        )
    elif found.robot.parameters[RANGE] == WIDEST:
        out.append(
            "the rudder has no end in this fit: trials left out show none below its largest command; measure its range"
        )
    return [*out, *map(step_statement, found.steps)]


def lag_statements(lag: Alignment) -> list[str]:
    """What camera and gyro say about each other's stamps."""
    if not lag.delay:
        return []
    if np.isnan(lag.rms):
        return [
            f"images are {lag.delay:.2f} s older than their stamps, as the robot states; taken out of all trials"
        ]
    return [
        f"images are {lag.delay:.2f} s older than their stamps: heading of camera and gyro then differ by {lag.rms:.3f} rad "
        f"instead of {lag.rms_undelayed:.3f} (rms in 4 s); taken out of all trials, camera_latency in robot.yaml"
    ]


def undetermined(fit: Fit, predicted: PredictionFit | None = None) -> tuple[str, ...]:
    """Free parameters whose posterior standard deviation is above UNDETERMINED times the prior's."""
    coordinates = ShotParametrization if predicted else Parametrization
    deviation, prior = np.sqrt(np.diag(fit.covariance)), coordinates(fit.hypothesis).prior
    return tuple(
        n
        for n, d, p in zip(fit.hypothesis.free, deviation, prior, strict=True)
        if d > UNDETERMINED * p
    )


def entangled(fit: Fit) -> list[tuple[str, str, float]]:
    """Pairs of parameters with a correlation beyond ENTANGLED."""
    deviation = np.sqrt(np.diag(fit.covariance))
    correlation = fit.covariance / np.outer(deviation, deviation)
    names = fit.hypothesis.free
    pairs = [
        (i, j) for i in range(len(names)) for j in range(i) if abs(correlation[i, j]) > ENTANGLED
    ]
    return [(names[j], names[i], float(correlation[i, j])) for i, j in pairs]


def data_statements(experiment: Experiment, held_out: Experiment | None) -> list[str]:
    """What the recordings lack, and what that costs."""
    out = []
    if held_out is None:
        out.append(
            "no trial was held out: errors below are of trials that took part in the fit, unseen ones are worse"
        )
    for what, rows, cost in (
        ("IMU", experiment.gyro, NO_IMU),
        ("encoder sample to compare", experiment.encoder, NO_ENCODER),
    ):
        missing = [
            name for m, name in enumerate(experiment.names) if not np.isfinite(rows[:, m]).any()
        ]
        if missing:
            out.append(f"no {what} in {', '.join(missing)}: {cost}")
    out += incomplete(experiment)
    rotor, rudder = experiment.given_commands.T
    if np.std(rudder) < STILL:
        out.append(
            "the rudder hardly moved: turning (yaw and sway drag, servo) is not excited; add rudder steps or sines"
        )
    if np.std(rotor) < STILL * 150.0:
        out.append(
            "the rotor's speed hardly changed: nothing drives the fish; add strokes of several amplitudes"
        )
    short = [
        n
        for n, k in zip(experiment.names, experiment.steps, strict=True)
        if k * 0.01 < WARM_UP + max(HORIZONS)
    ]
    if short:
        out.append(
            f"shorter than {WARM_UP + max(HORIZONS):g} s, so without a say at the longest horizons: {', '.join(short)}"
        )
    return out


def incomplete(experiment: Experiment) -> list[str]:
    """Trials in which a sensor starts late, has holes or sees no turn, and what is done about each."""
    out = []
    for m, name in enumerate(experiment.names):
        steps, frames = int(experiment.steps[m]), experiment.frames[m]
        for what, t, duty in (
            (
                "IMU",
                np.flatnonzero(np.isfinite(experiment.gyro[:steps, m])) * DT,
                "the camera alone tells how it moved",
            ),
            ("camera", frames.t, "no prediction is judged"),
        ):
            if len(t) < 2:
                continue
            gaps = np.diff(np.concatenate([[0.0], t, [(steps - 1) * DT]]))
            longest = int(gaps.argmax())
            if gaps[longest] > LONG_GAP:
                begin = 0.0 if longest == 0 else float(t[longest - 1])
                out.append(
                    f"{name}: no {what} from {begin:.1f} to {begin + gaps[longest]:.1f} s; {duty} there, the rest is used"
                )
        mean = stroke_mean(frames.t, np.arange(0.5, steps * DT, 0.5))(frames.pose)[:, 2]
        known = mean[np.isfinite(mean)]
        if len(known) and (turned := float(np.ptp(known))) < NO_TURN:
            out.append(
                f"{name}: turns by {turned:.2f} rad in all, so that it says little of turning"
            )
    return out


def fit_statements(fit: Fit, predicted: PredictionFit | None = None) -> list[str]:
    """What the data do not determine."""
    out = []
    if names := undetermined(fit, predicted):
        out.append(
            f"the data do not determine {', '.join(names)}: values and errors rest on the prior"
        )
    if names := left_at_zero(fit.robot):
        out.append(
            f"{', '.join(names)}: 0 in the robot that the fit began with, so 0 in the one that came out"
        )
    for first, second, value in entangled(fit):
        out.append(f"{first} and {second} are hardly told apart (correlation {value:+.3f})")
    if not predicted and (worst := fit.max_innovation_rms) > 1.5:
        out.append(
            f"innovations are {worst:.1f} times as large as the noise explains: standard errors are too small"
        )
    out.append("rigid masses and lengths are taken as measured; all else scales with them")
    return out


def lost_statements(training: Experiment, fit: Fit) -> list[str]:
    """Trials on which the filter diverged with the fitted model."""
    lost = [
        n
        for n, value in zip(training.names, fit.log_likelihood, strict=True)
        if not np.isfinite(value)
    ]
    if not lost:
        return []
    return [
        f"the filter loses the fish in {', '.join(lost)} with these values and begins anew there"
    ]


def start_statements(errors: dict[str, ErrorSizes]) -> list[str]:
    """Where the positions that the fit predicts are further off than those of the robot it began with."""
    start, fitted = errors["start"], errors["identified"]
    pairs = zip(fitted.horizons, start.rms[:, 0], fitted.rms[:, 0], strict=True)
    worse = [
        f"{h:g} s ({mine:.3g} m against {before:.3g})"
        for h, before, mine in pairs
        if mine > WORSE * before
    ]
    if not worse:
        return []
    return [
        f"the fit predicts positions worse than the robot it began with at {', '.join(worse)}: the model lacks something; "
        "robofish diagnose looks for it and makes a model that predicts"
    ]


def verdict(errors: dict[str, ErrorSizes]) -> list[str]:
    """Whether the physics beats the baselines, all knowing the past, and all knowing a little of what comes."""
    if not any(name in errors for name in BASELINES):
        return []
    return [_against(errors, ""), _against(errors, AHEAD)]


def _against(errors: dict[str, ErrorSizes], suffix: str) -> str:
    """Each number against the best of the baselines, at the horizons that the trials are long enough for.

    What the physics cannot predict because it diverges is lost: errors are those of the predictions that it ends.
    """
    names = [name + suffix for name in BASELINES if name + suffix in errors]
    mine = errors["identified" + suffix]
    terms = f" where all know {PEEK:g} s of what comes" if suffix else ""
    ended, expected = (
        mine.counts.sum(0),
        np.max([errors[name].counts.sum(0) for name in names], axis=0),
    )
    compared = [(i, h) for i, h in enumerate(mine.horizons) if expected[i]]
    if not compared:
        return f"no trial is long enough to compare the physics model with the baselines{terms}"
    lost = []
    for i, h in compared:
        if ended[i] < expected[i]:
            lost.append(
                f"{expected[i] - ended[i]} of {expected[i]} predictions at {h:g} s, which diverge"
            )
        for j, quantity in enumerate(("position", "heading", "speed")):
            best = min(names, key=lambda name: np.nan_to_num(errors[name].rms[i, j], nan=np.inf))
            if mine.rms[i, j] >= (theirs := errors[best].rms[i, j]):
                by = best.removesuffix(suffix)
                lost.append(
                    f"{quantity} at {h:g} s ({mine.rms[i, j]:.3g} against {theirs:.3g}, {by})"
                )
    if lost:
        return f"the physics model does NOT beat the baselines{terms} in {', '.join(lost)}"
    at = " s, ".join(f"{h:g}" for _, h in compared)
    return f"the physics model beats all baselines{terms} in position, heading and speed at {at} s"
