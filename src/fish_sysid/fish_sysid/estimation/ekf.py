# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""One pass of the extended Kalman filter over an experiment: compiled where possible, else in NumPy."""

from __future__ import annotations

from collections.abc import Sequence

from fish_sim.compiled import compiler, lanes
from fish_sim.robot import Robot
from fish_sim.scheme import Scheme, default_scheme, stable_scheme
from fish_sim.step import Stepper, kernel
from fish_sysid.dataset.experiment import Experiment
from fish_sysid.estimation.ekf_compiled import compiled_passes, filter_library
from fish_sysid.estimation.ekf_numpy import Filter
from fish_sysid.estimation.ekf_types import Array, FilterResult, Noise, Problem, SensorModel


def run_filter(
    experiment: Experiment,
    stepper: Stepper,
    p: Array,
    dp: Array,
    sensors: SensorModel,
    noise: Noise,
    keep: bool = False,
) -> FilterResult:
    """Innovations, likelihood, score and Gauss-Newton matrix of all trials.

    p (NP,): parameters of the stepper, which must have the effect `disturbance`; dp (K, NP): their derivatives with
    respect to the free parameters; keep: store what the smoother needs.
    """
    return run_filters(Problem(experiment, stepper, p, dp, sensors), [noise], keep)[0]


def run_filters(
    problem: Problem, noises: Sequence[Noise], keep: bool = False
) -> list[FilterResult]:
    """`run_filter` with each noise: several at once leave no core without work."""
    compiled = compiled_passes(problem, noises, keep)
    return compiled or [Filter(problem, noise).run(keep) for noise in noises]


def filter_stepper(robot: Robot) -> Stepper:
    """The robot's stepper with half the substeps of the simulator's default, for speed, or as many as it needs.

    On 4 trials of 10 s (n = 3) it changes the log likelihood by 0.3 nats and the fitted parameters by 0.01 standard errors.
    """
    scheme = default_scheme(robot.links)
    return Stepper.of(
        robot, stable_scheme(robot, Scheme(scheme.method, (scheme.substeps + 1) // 2))
    )


def prepare(robot: Robot) -> None:
    """Compile what a pass needs for a robot's structure unless it is in the cache: seconds that a caller may want to show."""
    stepper = filter_stepper(robot)
    filter_library(stepper.layout.structure, stepper.scheme.method)
    kernel(stepper.layout.structure, stepper.scheme, lanes(), compiler() is not None, "memory")
