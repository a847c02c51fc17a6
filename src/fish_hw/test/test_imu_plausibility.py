# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Samples that cannot be used are told from a fish that swims hard, and from a hit."""

import math
from dataclasses import replace

import pytest

from fish_hw.devices.imu_plausibility import ImuPlausibility
from fish_hw.devices.imu_sample import ImuSample

DT = 0.01
FREQUENCY = 2.0 * math.tau  # rad/s


def swimming(count: int, rate: float = 5.3) -> list[ImuSample]:
    """Yaw in strokes of 2 Hz with the highest turn rate of the trials [rad/s]."""
    samples = []
    for k in range(count):
        t = k * DT
        yaw = rate / FREQUENCY * math.sin(FREQUENCY * t)
        samples.append(
            ImuSample(
                t,
                (0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2)),
                (0.0, 0.0, rate * math.cos(FREQUENCY * t)),
                (1.8 * math.cos(FREQUENCY * t), 1.8 * math.sin(FREQUENCY * t), 9.81),
                3,
            )
        )
    return samples


def used(samples: list[ImuSample], check: ImuPlausibility | None = None) -> list[bool]:
    check = check or ImuPlausibility(DT)
    return [check.use(sample) for sample in samples]


@pytest.mark.parametrize("rate", [0.1, 5.3])
def test_a_swimming_fish_is_believed(rate):
    assert all(used(swimming(500, rate)))


def test_a_gyroscope_that_reads_a_third_too_little_is_believed():
    """As in the recordings of the real robot."""
    low = [
        replace(s, angular_velocity=(0.0, 0.0, 0.65 * s.angular_velocity[2])) for s in swimming(500)
    ]
    assert all(used(low))


def test_values_that_stand_still_are_not_used():
    samples, check = swimming(100), ImuPlausibility(DT)
    frozen = samples[:50] + [replace(samples[49], time_s=s.time_s) for s in samples[50:]]
    assert used(frozen, check) == [True] * 50 + [False] * 50
    assert check.trouble == "values stand still"


@pytest.mark.parametrize(
    "flip",
    [
        lambda s: replace(s, angular_velocity=(0.0, 0.0, s.angular_velocity[2] + 8.0)),
        lambda s: replace(s, angular_velocity=(-16.0, 0.0, s.angular_velocity[2])),
        lambda s: replace(s, acceleration=(s.acceleration[0] + 32.0, *s.acceleration[1:])),
        lambda s: replace(s, orientation=(0.0, 0.0, 1.0, 0.0)),
    ],
    ids=["yaw rate", "roll rate", "acceleration", "orientation"],
)
def test_a_bit_error_within_the_sensors_range_costs_its_sample(flip):
    samples = swimming(200)
    for k in range(20, 200, 20):
        samples[k] = flip(samples[k])
    kept = used(samples)
    assert not any(kept[k] for k in range(20, 200, 20))
    assert sum(kept) > 200 - 9 * 13  # an orientation that jumps spoils its window


def test_a_turn_rate_that_steps_is_never_used_again_while_the_orientation_does_not_follow():
    samples, check = swimming(200), ImuPlausibility(DT)
    stepped = [
        replace(s, angular_velocity=(0.0, 0.0, s.angular_velocity[2] + 6.0)) for s in samples[100:]
    ]
    kept = used(samples[:100] + stepped, check)
    assert all(kept[:100])
    assert not any(kept[100:])
    assert "turn rate and orientation disagree by 6." in check.trouble


def test_a_hit_that_turns_the_fish_is_believed_after_some_samples():
    """It turns at 6 rad/s from one sample to the next, and the orientation says so, too."""
    still = swimming(50, 0.01)
    hit = []
    for k in range(50):
        yaw = 6.0 * (k + 1) * DT
        hit.append(
            replace(
                still[0],
                time_s=still[-1].time_s + (k + 1) * DT,
                orientation=(0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2)),
                angular_velocity=(0.0, 0.0, 6.0 + 1e-3 * k),
            )
        )
    kept = used(still + hit)
    assert not kept[50]
    assert all(kept[60:])
