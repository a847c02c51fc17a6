# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Lag, delay and gain of the rudder by the gyro's answer, without a model of the fish."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fish_sim.model import DT
from fish_sysid.dataset.experiment import Experiment, Frames
from fish_sysid.dataset.synthetic import with_injection
from fish_sysid.diagnosis.change.change import Member, Named
from fish_sysid.diagnosis.change.rudder_change import (
    RudderChange,
    rudder_change,
    with_second_opinion,
)
from fish_sysid.diagnosis.change.servos import ANSWERED, delayed, lagged, with_play, with_servo
from fish_sysid.diagnosis.change.step_response import step_response
from fish_sysid.diagnosis.change.strength import Refitted
from fish_sysid.diagnosis.families import family_of

OLD, NEW, STEPS = 8, 5, 1000
STRATA = [0] * (OLD + NEW)
LEVEL = 0.02


def swum(seed: int, count: int) -> Experiment:
    """A body that answers rotor and a rudder of random steps with a lag of 0.15 s, and a gyro with noise."""
    random = np.random.default_rng(seed)
    t = DT * np.arange(STEPS)
    commands, gyro = np.zeros((STEPS, count, 2)), np.zeros((STEPS, count))
    for m in range(count):
        rotor = random.uniform(40.0, 70.0) * np.sin(4.0 * np.pi * t + random.uniform(0.0, 6.0))
        rudder = np.repeat(random.uniform(-0.4, 0.4, STEPS // 50), 50)
        commands[:, m] = np.column_stack([rotor, rudder])
        push = 0.03 * rudder * np.sqrt(lagged(rotor**2, 0.5)) + 0.01 * rotor
        gyro[:, m] = lagged(push, 0.15) + 0.02 * random.standard_normal(STEPS)
    frames = tuple(Frames(t[::5], np.zeros((len(t[::5]), 3))) for _ in range(count))
    names = tuple(f"{seed}_{m}" for m in range(count))
    nothing = np.full((STEPS, count), np.nan)
    return Experiment(
        names, np.full(count, STEPS), commands, gyro, np.full((STEPS, count, 2), np.nan), nothing, frames, True
    )  # fmt: skip


@pytest.fixture(scope="module")
def days() -> tuple[Experiment, Experiment]:
    return swum(1, OLD), swum(2, NEW)


def test_nothing_changed(days) -> None:
    answer = step_response(*days, STRATA, 150)
    assert answer is not None
    assert answer.p_value > LEVEL
    change = rudder_change(*days, STRATA)
    assert change is None or change.p_value > LEVEL


@pytest.mark.parametrize(
    ("name", "values", "tolerance"),
    [("rudder_delay", {"delay": 0.085}, 0.01), ("rudder_gain", {"factor": 0.8}, 0.03)],
)
def test_an_injection_is_named_with_its_number(days, name, values, tolerance) -> None:
    old, new = days
    change = rudder_change(old, with_injection(new, name, values), STRATA)
    assert change is not None
    assert change.p_value < LEVEL
    assert change.named.name == name
    assert change.named.family == "rudder timing"
    ((key, value),) = values.items()
    found = change.named.members[0].refitted.parameters[key]
    assert found.value == pytest.approx(value, abs=tolerance)


def test_a_lag_is_told_from_a_delay(days) -> None:
    """The command is what a servo with a lag of 0.12 s would have had to get."""
    old, new = days
    kept = np.exp(-DT / 0.12)
    rudder = new.commands[..., 1]
    led = rudder.copy()
    led[1:] = (rudder[1:] - kept * rudder[:-1]) / (1.0 - kept)
    change = rudder_change(
        old, replace(new, commands=np.stack([new.commands[..., 0], led], axis=-1)), STRATA
    )
    assert change is not None
    assert change.p_value < LEVEL
    assert [m.name for m in change.named.members] == ["rudder_lag"]
    assert change.named.members[0].refitted.parameters["time_constant"].value == pytest.approx(
        0.12, abs=0.01
    )


def test_servos_do_to_a_step_what_their_names_say() -> None:
    step = np.where(DT * np.arange(200) < 1.0, 0.0, 0.3)
    assert lagged(step, 0.1)[110] == pytest.approx(0.3 * (1.0 - np.exp(-1.1)), abs=0.002)
    assert delayed(step, 0.1)[108] == 0.0
    assert delayed(step, 0.1)[112] == pytest.approx(0.3)
    assert with_play(step, 0.05)[150] == pytest.approx(0.25)
    with pytest.raises(KeyError):
        with_servo(swum(1, 1), "payload", 0.1)
    assert set(ANSWERED) == {"rudder_lag", "rudder_delay", "rudder_backlash", "rudder_gain"}


def test_without_a_gyro_there_is_no_answer(days) -> None:
    old, new = days
    assert step_response(old, replace(new, gyro=np.full_like(new.gyro, np.nan)), STRATA) is None


def test_the_gyro_has_a_second_opinion_on_timing_alone() -> None:
    """The mean motion says placement, the gyro lag; a flow beside it is none of the gyro's business."""
    by_motion = _named("rudder_placement", rudder_placement=0.7, rudder_delay=0.3)
    flow = _named("current", current=1.0)
    by_gyro = RudderChange(0.03, _named("rudder_lag", rudder_lag=0.9, rudder_delay=0.1))
    timing, same = with_second_opinion([by_motion, flow], by_gyro)
    assert {m.name: m.probability for m in timing.members} == pytest.approx(
        {"rudder_lag": 0.45, "rudder_placement": 0.35, "rudder_delay": 0.2}
    )
    assert timing.name == "rudder_lag"
    assert same is flow
    unsure = RudderChange(0.3, by_gyro.named)
    assert with_second_opinion([by_motion], unsure) == [by_motion]


def _named(first: str, **members: float) -> Named:
    none = Refitted({}, "", np.zeros(3))
    made = tuple(Member(name, p, 1.0, 0.5, none) for name, p in members.items())
    return Named(made, family_of(first), 1.0, 0.1)


def test_a_number_at_an_end_of_those_tried_is_not_said_to_be_exact() -> None:
    old, new = swum(1, OLD), with_injection(swum(2, NEW), "rudder_gain", {"factor": 0.4})
    answer = step_response(old, new, STRATA, 20)
    assert answer is not None
    gain = next(servo for servo in answer.servos if servo.name == "rudder_gain").estimate
    assert gain.value == pytest.approx(0.5)  # the least that is tried
    assert gain.std == pytest.approx(0.1 / 12**0.5)
