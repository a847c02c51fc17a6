# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Can a model follow the fish at all? What short windows with free start states leave, over the noise of the camera.

A model that is right leaves the noise. One that lacks something cannot follow two seconds of swimming from any start state: its
innovations are then no innovations, and its likelihood chooses for the wrong reasons.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fish_sim.robot import Robot
from fish_sysid.dataset.experiment import Experiment
from fish_sysid.estimation.ekf_types import Noise
from fish_sysid.estimation.parametrization import nominal_hypothesis
from fish_sysid.estimation.shooting.coordinates import ShotParametrization
from fish_sysid.estimation.shooting.multiple_shooting import Shooting
from fish_sysid.estimation.shooting.schedule import FIRST, ladder_start
from fish_sysid.estimation.shooting.windows import cut, regular_starts

LENGTH, EVERY = 2.0, 8.0  # s, of windows and between them
LADDER = ((1.0, 1.0), (5.0, 2.0))  # of the tail's stiffness, and of masses and drags in sway
ITERATIONS = 8
FAINT = 0.05  # typical strengths, at which effects start
TOO_FAR = 2.0  # times the camera's noise


def misfit(
    experiment: Experiment,
    robot: Robot,
    noise: Noise,
    free: Sequence[str],
    length: float = LENGTH,
    effects: Sequence[str] = (),
) -> float:
    """The larger of the camera's residuals in position and heading over their noise (medians), of the better start.

    effects: that the model may have as well, all at once. 0 where no window can be cut: nothing speaks against the model.
    """
    windows = cut(experiment, regular_starts(experiment, length, EVERY, FIRST), length)
    if not len(windows):
        return 0.0
    hypothesis, sizes = nominal_hypothesis(robot, tuple(free)), []
    for name in effects:
        hypothesis = hypothesis.with_effect(name, FAINT)
    for stiffness, heavy in LADDER:
        theta = ladder_start(ShotParametrization(hypothesis), stiffness, heavy)
        shooting = Shooting(experiment, ShotParametrization(hypothesis, theta), windows)
        guess = shooting.settle(shooting.first_guess(theta))
        _, guess = shooting.fit(guess, ITERATIONS)
        e, F = shooting.errors(guess).e, len(windows.poses.t)
        position = _size(e[: 2 * F]) * shooting.scale.position / noise.camera_position
        heading = _size(e[2 * F : 3 * F]) * shooting.scale.heading / noise.camera_heading
        sizes.append(max(position, heading))
    return float(min(sizes))


def _size(e: np.ndarray) -> float:
    """Standard deviation of a normal distribution with this median of sizes."""
    return float(np.median(np.abs(e)) / 0.6745)
