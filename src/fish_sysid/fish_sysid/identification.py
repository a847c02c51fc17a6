"""Identify a robot from recordings: parameters with standard errors, and how well they predict unseen trials."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fish_sim.robot import Robot
from fish_sysid.dataset.camera_time_offset import Alignment, align, moved_back
from fish_sysid.dataset.experiment import Experiment
from fish_sysid.estimation.effect_selection import Step, choose_effects, step_text
from fish_sysid.estimation.ekf_types import Noise
from fish_sysid.estimation.global_fit import refit_if_suspect
from fish_sysid.estimation.initial_noise import initial_noise
from fish_sysid.estimation.map_fit import Fit
from fish_sysid.estimation.multistep_fit import fit_multistep
from fish_sysid.estimation.parametrization import (
    NOMINAL_FREE,
    nominal_hypothesis,
    zeros,
)
from fish_sysid.estimation.refit import ANNEAL_HELD, refit
from fish_sysid.estimation.sensor_noise import usual_noise
from fish_sysid.estimation.thresholds import INNOVATION_RMS_REJECT, RATIO_REJECT
from fish_sysid.prediction.baselines import fit_baselines, predict_baseline
from fish_sysid.prediction.prediction import (
    EVERY,
    HORIZONS,
    WARM_UP,
    ErrorSizes,
    Estimates,
    Predictions,
    estimate,
    predict,
    prediction_errors,
)
from fish_sysid.prediction.stroke_average import HALF_WINDOW

Array = NDArray[np.float64]

UNDETERMINED = 0.7  # posterior over prior standard deviation; above, the data say little
ENTANGLED = 0.95  # correlation of two parameters that the data hardly tell apart
WORSE = (
    1.1  # times the error of the robot it began with: more than two robots as good differ by chance
)
STILL = (
    0.02  # rad and share of full speed: below this spread of the commands nothing excites the fish
)
BASELINES = ("constant", "arx", "bilinear")
AHEAD, PEEK = "_ahead", HALF_WINDOW  # suffix of predictors that know so many s of what comes
EFFECT_START = 0.3  # typical strengths, at which the fit of an effect starts
FITTED_FOR_OUTLOOK = (
    "the model needs sensors far noisier than they are, or water far stronger than in any pool: it lacks something, so that "
    "it was fitted to predictions over 0.5 to 5 s instead of the likelihood; standard errors count every error as "
    "independent, which is too small; `robofish diagnose` looks for what is missing"
)
NOT_CHOSEN = (
    "no effects looked for: the model needs no noisier sensors than there are and no stronger water; `robofish diagnose` "
    "asks the likelihood"
)
NO_IMU = "its biases stay unknown, and fast motion is seen by the camera only"
NO_ENCODER = "the rotor is taken to follow its commands"
Report = Callable[[str], None]  # told what is being done


@dataclass(frozen=True)
class Identification:
    """What came out."""

    fit: Fit
    start: Robot
    training: Experiment
    held_out: Experiment | None  # None: a single trial
    judged: Predictions  # of the held-out trials, or of the only trial
    estimates: Estimates  # of the training trials
    errors: dict[str, ErrorSizes]  # "start", "identified", then the baselines that could be fitted
    statements: tuple[
        str, ...
    ]  # what is wrong with the data or the result, and what can still be said
    seconds: float
    camera_delay: float = 0.0  # s, taken out of all trials above

    @property
    def robot(self) -> Robot:
        """The identified robot, with the delay that its camera has in the recordings as they are."""
        effects = {
            name: values for name, values in self.fit.robot.effects.items() if name != "disturbance"
        }
        plain = replace(self.fit.robot, effects=effects)
        return (
            plain.with_effect("camera_latency", delay=self.camera_delay)
            if self.camera_delay
            else plain
        )

    @property
    def undetermined(self) -> tuple[str, ...]:
        """Parameters whose uncertainty is about the prior's: the data do not determine them."""
        return undetermined(self.fit)

    @property
    def correlation(self) -> Array:
        """(K, K) of the parameters' errors."""
        deviation = np.sqrt(np.diag(self.fit.covariance))
        matrix: Array = self.fit.covariance / np.outer(deviation, deviation)
        return matrix


def identify(
    experiment: Experiment,
    robot: Robot,
    noise: Noise | None = None,
    hold_out: int = 4,
    free: tuple[str, ...] = NOMINAL_FREE,
    report: Report = lambda _: None,
    effects: tuple[str, ...] = (),
    choose_from: tuple[str, ...] = (),
) -> Identification:
    """Fit the nominal parameters (and those of the robot's effects in `free`) and judge them on trials left out.

    hold_out: every so-manieth trial takes no part in fitting; 0: none. Raises ValueError when it is negative or 1.
    effects: names added to the robot's, their parameters free. choose_from: where the model is wrong beyond its noise, those
    of these effects are added that let it predict training trials better when they are left out in turn.
    A delay of the camera that the gyro shows is taken out of all trials first, so that horizons count from the moment an
    image was taken, and goes into the robot that comes back.
    """
    began = time.monotonic()
    train, held = split(len(experiment.names), hold_out)
    lag = Alignment(0.0, np.nan, np.nan)
    if "camera_latency" not in (*robot.sensors, *effects):
        lag = align(experiment.select(train))
        experiment = moved_back(experiment, lag.delay)
    training, held_out = experiment.select(train), experiment.select(held) if held else None
    noise = noise or usual_noise(
        training
    )  # what trials left out say of the sensors takes no part either
    hypothesis = nominal_hypothesis(robot, free)
    for name in effects:
        hypothesis = hypothesis.with_effect(name, EFFECT_START)
    # not from many places: of a wrong model's optima the likelihood does not tell which predicts, and this way is measured
    origin = hypothesis.parametrization.origin()
    fit = refit(hypothesis, origin, training, noise, ANNEAL_HELD, report)
    wrong = is_wrong(fit, noise)
    fit = fit_multistep(fit, training, report) if wrong else refit_if_suspect(fit, training, report)
    steps: tuple[Step, ...] = ()
    if wrong and choose_from:
        fit, steps = choose_effects(fit, training, choose_from, report)
        fit = fit_multistep(fit, training, report) if any(step.added for step in steps) else fit
    report("predicting trials left out")
    judged, errors, lacking = judge(training, held_out, robot, fit)
    estimates = estimate(training, fit.robot, fit.noise)
    statements = [
        *data_statements(experiment, held_out),
        *lag_statements(lag),
        *fit_statements(fit),
    ]
    statements += lost_statements(training, fit)
    statements += [
        *([FITTED_FOR_OUTLOOK] if wrong else []),
        *([NOT_CHOSEN] if choose_from and not wrong else []),
        *map(step_statement, steps),
        *lacking,
        *start_statements(errors),
        *verdict(errors),
    ]
    seconds = time.monotonic() - began
    return Identification(
        fit,
        robot,
        training,
        held_out,
        judged,
        estimates,
        errors,
        tuple(statements),
        seconds,
        lag.delay,
    )


def is_wrong(fit: Fit, noise: Noise) -> bool:
    """The model needs sensors far noisier than they are said to be, or a force that no water has: the likelihood misleads."""
    told = [
        (getattr(fit.noise, key), getattr(noise, key))
        for key in ("gyro", "camera_position", "camera_heading")
    ]
    return any(needed > INNOVATION_RMS_REJECT * said for needed, said in told) or bool(
        fit.process_noise_ratio.max() > RATIO_REJECT
    )


def step_statement(step: Step) -> str:
    """What a candidate did to training trials left out in turn."""
    return f"{step.name}: {'added' if step.added else 'not added'}; {step_text(step)}"


def lag_statements(lag: Alignment) -> list[str]:
    """What camera and gyro say about each other's stamps."""
    if not lag.delay:
        return []
    return [
        f"images are {lag.delay:.2f} s older than their stamps: heading of camera and gyro then differ by {lag.rms:.3f} rad "
        f"instead of {lag.rms_undelayed:.3f} (rms in 4 s); taken out of all trials, camera_latency in robot.yaml"
    ]


def split(trials: int, hold_out: int) -> tuple[list[int], list[int]]:
    """Indices of training and held-out trials: every `hold_out`-th, the last one of a small set, none of a single one."""
    if hold_out < 0 or hold_out == 1:
        raise ValueError(
            f"hold-out {hold_out}: expected 0 (none) or at least 2 (every second trial)"
        )
    if hold_out == 0 or trials == 1:
        return list(range(trials)), []
    held = list(range(hold_out - 1, trials, hold_out)) or [trials - 1]
    return [i for i in range(trials) if i not in held], held


def judge(
    training: Experiment, held_out: Experiment | None, start: Robot, fit: Fit
) -> tuple[Predictions, dict[str, ErrorSizes], list[str]]:
    """Predictions, errors of both robots and of the baselines, and what could not be had, on the held-out trials."""
    unseen = held_out or training
    longest = max(HORIZONS)
    judged = predict(unseen, fit.robot, fit.noise, longest, EVERY, WARM_UP)
    peeking = predict(unseen, fit.robot, fit.noise, longest, EVERY, WARM_UP, PEEK)
    before = predict(
        unseen, start, initial_noise(unseen, start, fit.noise), longest, EVERY, WARM_UP
    )
    errors = {"start": prediction_errors(before), "identified": prediction_errors(judged)}
    try:
        baselines = fit_baselines(training)
    except ValueError as error:
        return judged, errors, [f"no baselines: {error}"]
    for name, advance in baselines.items():
        errors[name] = prediction_errors(predict_baseline(advance, judged, HALF_WINDOW))
    errors["identified" + AHEAD] = prediction_errors(peeking)
    for name, advance in baselines.items():
        errors[name + AHEAD] = prediction_errors(predict_baseline(advance, judged))
    return judged, errors, []


def undetermined(fit: Fit) -> tuple[str, ...]:
    """Free parameters whose posterior standard deviation is above UNDETERMINED times the prior's."""
    deviation, prior = np.sqrt(np.diag(fit.covariance)), fit.hypothesis.parametrization.prior
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
        ("encoder", experiment.encoder, NO_ENCODER),
    ):
        missing = [
            name for m, name in enumerate(experiment.names) if not np.isfinite(rows[:, m]).any()
        ]
        if missing:
            out.append(f"no {what} in {', '.join(missing)}: {cost}")
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


def fit_statements(fit: Fit) -> list[str]:
    """What the data do not determine."""
    out = []
    if names := undetermined(fit):
        out.append(
            f"the data do not determine {', '.join(names)}: values and errors rest on the prior"
        )
    if names := zeros(fit.robot):
        out.append(
            f"{', '.join(names)}: 0 in the robot that the fit began with, so 0 in the one that came out"
        )
    for first, second, value in entangled(fit):
        out.append(f"{first} and {second} are hardly told apart (correlation {value:+.3f})")
    if (worst := fit.max_innovation_rms) > 1.5:
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
