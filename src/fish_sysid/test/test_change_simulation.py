# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""A simulation that diverges takes neither the rest of its trial nor its neighbours with it."""

import numpy as np
import pytest

from fish_sim.model import DT
from fish_sim.robot import Robot
from fish_sysid.diagnosis.change.simulation import AFTER, BEFORE, rollout
from fish_sysid.estimation.ekf import filter_stepper

JUMP = 300  # grid point at which the rotor jumps


@pytest.fixture(scope="module")
def driven():
    """Two equal fish, the second with a rotor that jumps as no motor can."""
    stepper = filter_stepper(Robot())
    t = DT * np.arange(900)
    commands = np.zeros((len(t), 2, 2))
    commands[:, :, 0] = 40.0 * np.sin(4.0 * np.pi * t)[:, None]
    commands[JUMP : JUMP + 6, 1, 0] = (4e4, -4e4, 4e4, -4e4, 4e4, -4e4)
    table = np.repeat(stepper.parameters(Robot())[None], 2, axis=0)
    return *rollout(stepper, table, commands), stepper.layout.links + 3


def test_the_trial_goes_on_where_it_diverged(driven) -> None:
    x, lost, turn = driven
    assert np.isfinite(x[:-1]).all()
    again = JUMP + round((AFTER + 1.0) / DT)
    assert x[again:-1, 1, turn].mean() == pytest.approx(x[again:-1, 0, turn].mean(), rel=0.1)
    assert lost[JUMP - round(BEFORE / DT) + 10 : JUMP + round(AFTER / DT), 1].all()


def test_its_neighbour_is_as_without_it(driven) -> None:
    _, lost, _ = driven
    assert not lost[:, 0].any()
