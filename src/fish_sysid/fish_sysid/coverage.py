# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Do the standard errors mean what they say? Identification of many synthetic robots whose truth is known."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fish_sim.robot import Robot
from fish_sim.water_push import USUAL_SIZE
from fish_sysid.dataset.synthetic import KINDS, program, record
from fish_sysid.estimation.ekf_types import Noise
from fish_sysid.estimation.map_fit import Fit
from fish_sysid.estimation.noise_estimation import usual_noise
from fish_sysid.estimation.parametrization import (
    LOG_PRIOR,
    NOMINAL_FREE,
    nominal_hypothesis,
)
from fish_sysid.estimation.refit import ANNEAL_HELD, refit, refit_if_suspect

Array = NDArray[np.float64]

SPREAD = 0.3  # of the truth around the nominal values


@dataclass(frozen=True)
class Repetition:
    """One synthetic robot identified."""

    seed: int
    names: tuple[str, ...]
    score: Array  # (K,) (estimate - truth) / standard error, in the logarithm
    relative_error: Array  # (K,) estimate over truth, minus one


@dataclass(frozen=True)
class Coverage:
    """Shares over repetitions."""

    names: tuple[str, ...]
    inside95: Array  # (K,) share of repetitions with the truth in the 95 % interval
    within3: Array  # (K,) share within three standard errors
    rms_score: Array  # (K,) 1 when the errors have the size they claim
    median_error: Array  # (K,) of the absolute relative error
    repetitions: int

    @property
    def overall(self) -> tuple[float, float]:
        """Shares over all parameters and repetitions: 95 % intervals, three standard errors."""
        return float(self.inside95.mean()), float(self.within3.mean())


def draw_truth(random: np.random.Generator) -> Robot:
    """A robot with every free parameter within SPREAD of its nominal value, within its prior where that is narrower."""
    nominal = Robot()
    factors = {name: min(SPREAD, LOG_PRIOR.get(name, SPREAD)) for name in NOMINAL_FREE}
    return nominal.with_parameters(
        **{
            name: nominal.parameters[name] * (1.0 + random.uniform(-f, f))
            for name, f in factors.items()
        }
    )


def repeat(seed: int, trials: int, duration: float) -> Repetition:
    """Draw a robot, record it, identify it from the nominal values."""
    random = np.random.default_rng(seed)
    truth = draw_truth(random)
    commands = np.stack(
        [program(KINDS[m % len(KINDS)], duration, random) for m in range(trials)], axis=1
    )
    experiment, _ = record(truth, commands, Noise(wrench=USUAL_SIZE), random)
    hypothesis = nominal_hypothesis(Robot())
    # as `identify` does
    origin = hypothesis.parametrization.origin()
    fit = refit(hypothesis, origin, experiment, usual_noise(experiment), ANNEAL_HELD)
    return scored(seed, truth, refit_if_suspect(fit, experiment))


def scored(seed: int, truth: Robot, fit: Fit) -> Repetition:
    """Errors of a fit over their standard errors, in theta."""
    coordinates = fit.hypothesis.parametrization
    names = fit.hypothesis.free
    true_theta = coordinates.encode(np.array([truth.parameters[name] for name in names]))
    error = fit.theta - true_theta
    return Repetition(seed, names, error / np.sqrt(np.diag(fit.covariance)), np.expm1(error))


def summarise(repetitions: list[Repetition]) -> Coverage:
    """Shares over repetitions; raises ValueError without any."""
    if not repetitions:
        raise ValueError("no repetition: expected at least one")
    z = np.array([r.score for r in repetitions])
    error = np.array([r.relative_error for r in repetitions])
    return Coverage(
        repetitions[0].names,
        (np.abs(z) < 1.96).mean(0),
        (np.abs(z) < 3.0).mean(0),
        np.sqrt((z**2).mean(0)),
        np.median(np.abs(error), axis=0),
        len(z),
    )


def study(
    repetitions: int,
    trials: int,
    duration: float,
    seed: int = 0,
    done: Callable[[Repetition], None] = lambda _: None,
) -> list[Repetition]:
    """Repetitions one after the other (each uses all cores); `done` hears of each."""
    out = []
    for i in range(repetitions):
        out.append(repeat(seed + i, trials, duration))
        done(out[-1])
    return out
