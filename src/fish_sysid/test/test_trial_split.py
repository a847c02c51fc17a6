# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Which trials are held out, searched and checked."""

from dataclasses import replace

import numpy as np
import pytest
from swims import GIVEN, swim

from fish_sysid.diagnosis.trial_split import excitation, split_trials, trials_of


def test_held_out_trials_take_no_part():
    split = split_trials(swim(GIVEN, kinds=("sines",) * 7, duration=1.0))
    assert set(split.held_out).isdisjoint(split.training)
    assert {*split.search, *split.check} == set(split.training)
    assert set(split.search).isdisjoint(split.check)
    assert sorted((*split.training, *split.held_out)) == list(range(7))


def test_the_search_uses_the_four_training_trials_that_are_excited_most():
    data = swim(GIVEN, kinds=("sines",) * 9, duration=1.0)
    still = data.commands * np.isin(range(9), (0, 3, 4, 7, 8))[:, None]  # 2, 5 and 8 are held out
    split = split_trials(replace(data, commands=still))
    assert split.held_out == (2, 5, 8)
    assert split.search == (0, 3, 4, 7)
    assert split.check == (1, 6)


def test_held_out_trials_have_no_influence_on_what_is_searched():
    """Measured against one that steers far, a fast straight swim would excite more than a slow steered one."""
    data = swim(GIVEN, kinds=("sines",) * 9, duration=2.0)
    swing = np.sin(0.2 * np.arange(data.length))[:, None]
    rotor = np.where(np.arange(9) == 6, 25.0, np.where(np.arange(9) == 7, 0.0, 100.0)) * swing
    rudder = np.where(np.isin(np.arange(9), (4, 7)), 0.0, 0.3) * swing
    calm = replace(data, commands=np.stack([rotor, rudder], axis=-1))
    far = calm.commands.copy()
    far[:, 2, 1] = 0.78 * np.sign(swing[:, 0])
    steered = replace(calm, commands=far)
    assert split_trials(calm).search == split_trials(steered).search == (0, 1, 3, 6)


def test_padding_does_not_excite():
    """A steady circle of half the length is no step of the rudder."""
    data = swim(GIVEN, kinds=("sines",) * 6, duration=2.0)
    commands = np.stack([np.sin(0.2 * np.arange(data.length)), np.zeros(data.length)], axis=-1)
    commands = np.repeat(commands[:, None], 6, axis=1)
    commands[..., 1] = 0.3 * np.sin(0.1 * np.arange(data.length))[:, None]
    commands[:, 3] = [1.0, 0.4]
    commands[100:, 3] = 0.0
    steps = np.where(np.arange(6) == 3, 100, data.steps)
    strength = excitation(replace(data, commands=commands, steps=steps))
    assert strength[3] == pytest.approx(0.0, abs=1e-9)
    assert strength[0] > 1.0


def test_a_search_knows_which_training_trials_it_has_not_fitted():
    data = swim(GIVEN, kinds=("sines",) * 9, duration=1.0)
    split = split_trials(data)
    trials = trials_of(data, split)
    assert [trials.training.names[i] for i in trials.check] == [data.names[i] for i in split.check]
    assert {*trials.searched.names}.isdisjoint(trials.training.names[i] for i in trials.check)
