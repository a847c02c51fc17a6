# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""A servo that changed on a fish that no model of the simulator is: what OLD's trials say of other commands."""

from __future__ import annotations

import numpy as np
import pytest
from kinematic_swims import World, kinematic_swims

from fish_sim.robot import Robot
from fish_sysid.dataset.experiment import Experiment
from fish_sysid.dataset.synthetic import with_injection
from fish_sysid.diagnosis.change.case import Case
from fish_sysid.diagnosis.change.change import Change
from fish_sysid.diagnosis.change.channels import swims
from fish_sysid.diagnosis.change.compare import LOOKS
from fish_sysid.diagnosis.change.explanation import explained, swapped_in
from fish_sysid.diagnosis.change.naming import judge_all
from fish_sysid.diagnosis.change.other_commands import FORM, OldAnswer
from fish_sysid.diagnosis.change.rows import MEAN_MOTION, look, trial_rows
from fish_sysid.diagnosis.change.shared_fit import regression
from fish_sysid.diagnosis.change.swap_test import Gains

NAMES = ("current", "camera_scale", "camera_heading_offset", "rudder_offset", "rudder_gain")
OLD, NEW = 12, 6  # trials


@pytest.fixture(scope="module")
def days() -> tuple[Experiment, Experiment]:
    return kinematic_swims(World(), 1, OLD), kinematic_swims(World(), 2, NEW)


@pytest.fixture(scope="module")
def looks_at(days):
    """looks_at(new): both looks at a NEW of the same OLD."""
    old, _ = days
    rows_of_old = trial_rows(Robot(), old, swims(old), NAMES)
    answer = OldAnswer.of(rows_of_old)
    both = answer.added(rows_of_old, swims(old), old)

    def cases(new: Experiment) -> list[Case]:
        moved = answer.added(trial_rows(Robot(), new, swims(new), NAMES), swims(new), new)
        found = []
        for channels in LOOKS.values():
            kept, cut = look(both, channels), look(moved, channels)
            fit, strata, day_of = regression(kept, cut), [0] * (OLD + NEW), [0] * OLD + [1] * NEW
            days_of_new = tuple(swims(new))
            found.append(
                Case(channels, fit, kept, cut, strata, day_of, Robot(), new, days_of_new, answer)
            )
        return found

    return cases


@pytest.mark.parametrize(("name", "value"), [("rudder_offset", 0.06), ("rudder_gain", 0.8)])
def test_the_column_is_what_a_fish_of_another_structure_does(days, looks_at, name, value) -> None:
    _, new = days
    key = {"rudder_offset": "offset", "rudder_gain": "factor"}[name]
    case = looks_at(with_injection(new, name, {key: value}))[0]
    judged = judge_all(case.fit)
    assert judged[name].key == (name, FORM)
    assert judged[name].strengths[0] == pytest.approx(1.0, abs=0.2)
    assert judged[name].gain == max(one.gain for one in judged.values())


def test_another_zero_of_the_servo_is_named_with_its_number(days, looks_at) -> None:
    _, new = days
    looks = looks_at(with_injection(new, "rudder_offset", {"offset": -0.05}))
    found = explained(Change("changed"), looks, swapped_in(looks, ()))
    (named,) = found.named
    offset = named.members[0].refitted.parameters["offset"]
    assert named.name == "rudder_offset"
    assert offset.value == pytest.approx(-0.05, abs=3.0 * offset.std)
    assert offset.std < 0.01
    assert found.remainder_p_value > 0.005


def test_what_differs_from_trial_to_trial_weighs_less(days) -> None:
    """A camera's scale that is drawn for every trial: it gains as little as the trials' own differences let it."""
    random = np.random.default_rng(5)
    old, new = (_scaled_trial_by_trial(day, random) for day in days)
    gained = {}
    for case, (yesterday, today) in {"varied": (old, new), "equal": days}.items():
        rows = [
            look(trial_rows(Robot(), day, swims(day), NAMES), MEAN_MOTION)
            for day in (yesterday, today)
        ]
        fit = regression(*rows)
        gained[case] = Gains(fit, ()).dispersion(), judge_all(fit)
    varied, equal = gained["varied"][0], gained["equal"][0]
    assert varied["camera_scale", 0] > 5.0 * equal["camera_scale", 0]
    assert varied["camera_heading_offset", 0] < 0.5 * varied["camera_scale", 0]
    one = gained["varied"][1]["camera_scale"]
    assert one.dispersion == varied["camera_scale", 0]
    assert one.gain < 3.0


def _scaled_trial_by_trial(day: Experiment, random: np.random.Generator) -> Experiment:
    parts = [
        with_injection(day.select([m]), "camera_scale", {"factor": 1.0 + 0.1 * random.normal()})
        for m in range(len(day.names))
    ]
    frames = tuple(part.frames[0] for part in parts)
    return Experiment(
        day.names, day.steps, day.commands, day.gyro, day.accel, day.encoder, frames=frames,
        start_at_rest=False,
    )  # fmt: skip
