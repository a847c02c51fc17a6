# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The swing of the head with the stroke is measured at the camera's frames and counts when a robot is fitted to predictions."""

from __future__ import annotations

import numpy as np
import pytest

from fish_sim.model import DT
from fish_sim.robot import Robot
from fish_sysid.dataset.synthetic import program, record
from fish_sysid.estimation.ekf_types import Noise
from fish_sysid.estimation.parametrization import nominal_hypothesis
from fish_sysid.estimation.shooting.residuals import SENSORS
from fish_sysid.estimation.shooting.schedule import Found, multistep
from fish_sysid.estimation.shooting.stroke_swing import stroke_frequency, swing_weights
from fish_sysid.estimation.shooting.stroke_targets import MEANS

FREQUENCY = 2.0 * np.pi * 1.6  # rad/s


def test_a_swing_on_a_turn_is_found_at_eleven_frames_a_second() -> None:
    t = np.arange(-0.49, 0.5, 1.0 / 11.0)
    heading = 1.0 + 0.4 * t + 0.05 * np.cos(FREQUENCY * t) - 0.03 * np.sin(FREQUENCY * t)
    assert swing_weights(t, FREQUENCY) @ heading == pytest.approx([0.05, -0.03], abs=1e-9)


@pytest.mark.parametrize(("rate", "frequency"), [(11.0, 0.0), (3.0, FREQUENCY), (8.0, 24.0)])
def test_no_swing_is_read_where_there_is_none_or_frames_are_too_few(
    rate: float, frequency: float
) -> None:
    t = np.arange(-0.49, 0.5, 1.0 / rate)
    assert not swing_weights(t, frequency).any()


def test_the_stroke_s_frequency_is_that_of_the_rotor() -> None:
    t = DT * np.arange(100)
    assert stroke_frequency(40.0 * np.sin(FREQUENCY * t)) == pytest.approx(FREQUENCY, rel=0.1)
    assert stroke_frequency(40.0 * np.sin(4.0 * np.pi * t)) == pytest.approx(4.0 * np.pi, rel=0.01)
    assert stroke_frequency(np.full(100, 40.0)) == 0.0


def test_a_head_that_swings_too_far_costs() -> None:
    """Half the head's inertia: the swing is off by far more than with the right one."""
    random = np.random.default_rng(3)
    commands = np.stack([program(kind, 10.0, random) for kind in ("sines", "turn")], axis=1)
    experiment, _ = record(Robot(links=1), commands, Noise(wrench=(1e-3, 2e-3, 5e-5)), random)

    def swing_error(factor: float) -> float:
        inertia = factor * Robot(links=1).parameters["head_inertia"]
        hypothesis = nominal_hypothesis(
            Robot(links=1).with_parameters(head_inertia=inertia), ("head_drag_surge",)
        )
        cost = multistep(experiment, Found(hypothesis, np.zeros(1 + len(SENSORS)), np.inf), 2.0)
        z = np.zeros(1 + len(SENSORS))
        return float(np.sqrt(np.mean(cost.errors(z, cost.states(z))[0][:, MEANS:] ** 2)))

    assert swing_error(0.5) > 3.0 * swing_error(1.0)
