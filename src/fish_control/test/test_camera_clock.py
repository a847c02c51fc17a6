# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The age of camera poses: online, in recordings, and what a latency does."""

import numpy as np
import pytest

from fish_control.camera_clock import CameraClock
from fish_control.imu_history import ImuHistory, InertialSample
from fish_control.latency import Latency
from fish_control.offset_sums import ClockEstimate
from fish_control.recorded_offset import pooled, recorded_offset

PERIOD, FRAME, NOISE = 0.01, 1.0 / 30.0, 0.012  # s, s, rad
PRIOR_STD = 0.02  # s


def steady(t):
    """Heading of a fish that has swum for ever, by equal strokes on a course that bends a little."""
    return 0.2 * np.sin(4.0 * np.pi * t) + 0.3 * np.sin(0.5 * t)


def varied(t):
    """The same by strokes that change."""
    return steady(t) + 0.1 * np.sin(4.0 * np.pi * t) * np.sin(0.7 * t) + 0.3 * np.sin(0.8 * t)


def watched(clock, heading, age, late, seconds=12.0, gap=(0.0, 0.0), seed=1):
    """(N, 4) time, error of the offset and its standard deviation [s], whether it is sure: after each pose.

    The IMU begins at 0 and is silent in the gap; images come `age` s after they were taken, stamped `late` s too late.
    """
    rng, imu, rows = np.random.default_rng(seed), ImuHistory(reach=0.1), []
    taken = 0.005 - age
    for t in np.arange(0.0, seconds, PERIOD).tolist():
        if not gap[0] <= t < gap[1]:
            imu.add(t, InertialSample(float(heading(t)), 0.0, 0.0, 0.0))
        while taken + age <= t:
            clock.add(
                taken + late, float(heading(taken) + rng.normal(0.0, NOISE)), imu, imu.last_time
            )
            rows.append((t, clock.current.offset + late, clock.current.std, clock.current.sure))
            taken += FRAME
    return np.array(rows)


@pytest.mark.parametrize("gap", [(0.0, 0.0), (3.0, 3.6)])
@pytest.mark.parametrize("age", [0.5, 0.7, 0.9, 1.2])
def test_what_the_imu_did_not_measure_excludes_no_offset(age, gap):
    """With old images the IMU tells of the right offset last. Until then an offset that is wrong by one stroke fits as well."""
    _, error, _, sure = watched(CameraClock(0.0, PRIOR_STD), steady, age, 0.26, gap=gap).T
    assert np.abs(error[sure > 0]).max(initial=0.0) < 0.01


@pytest.mark.parametrize("gap", [(0.0, 0.0), (3.0, 3.6)])
@pytest.mark.parametrize("age", [0.1, 0.7, 1.2])
def test_strokes_that_change_tell_the_offset_all_the_same(age, gap):
    time, error, std, sure = watched(CameraClock(0.0, PRIOR_STD), varied, age, 0.26, gap=gap).T
    assert np.all(sure[time > 5.0])
    assert np.all(np.abs(error[sure > 0]) < np.maximum(0.005, 4.0 * std[sure > 0]))


def test_equal_strokes_leave_an_offset_that_was_known_sure():
    """Before the IMU's first sample nothing is known; what was known beforehand decides."""
    time, error, _, sure = watched(CameraClock(-0.26, PRIOR_STD), steady, 0.1, 0.26).T
    assert np.all(sure[time > 1.5])
    assert np.abs(error[sure > 0]).max() < 0.005


@pytest.mark.parametrize("age", [0.3, 0.5, 0.7, 1.2])
def test_an_offset_of_several_that_fit_is_as_uncertain_as_they_are_apart(age):
    time, error, std, _ = watched(CameraClock(0.0, PRIOR_STD), steady, age, 0.26).T
    late = time > 3.0
    assert np.all(np.abs(error[late]) < 3.0 * std[late])


@pytest.mark.parametrize(("camera", "imu"), [(-0.3, -0.3), (0.0, -0.3), (0.0, 0.0)])
def test_a_new_start_knows_the_offset_of_before(camera, imu):
    """The images on their way were stamped before the clocks were set."""
    age, late = 0.5, 0.26
    before = CameraClock(0.0, PRIOR_STD)
    watched(before, varied, age, late)
    clock = before.anew()
    for _ in range(4):
        clock.add(0.0, 0.0, ImuHistory(reach=0.1), age - late + imu - camera)
    assert clock.current.offset == pytest.approx(-late + imu - camera, abs=0.03)
    assert not clock.current.sure


def test_percentiles_of_the_last_values():
    latency = Latency(size=101)
    for _ in range(1000):
        latency.add(100.0)
    for k in range(101):
        latency.add(k / 1000.0)
    assert latency.percentiles() == pytest.approx((0.05, 0.099))


def test_nothing_without_values():
    assert Latency().percentiles() is None


def heading(t):
    swing = 0.2 * np.sin(4.0 * np.pi * t) * (1.0 + 0.3 * np.sin(0.7 * t))
    return np.where(t > 2.0, swing + 0.3 * np.sin(0.8 * t), 0.0)


def swum(seed, late, latency=0.1, seconds=40.0, still=False):
    rng = np.random.default_rng(seed)
    imu = np.arange(0.0, seconds, 0.01)
    exposed = np.arange(0.0, seconds, 1.0 / 30.0)
    true = (lambda t: 0.0 * t) if still else heading
    seen = true(exposed) + rng.normal(0.0, 0.012, len(exposed))
    latencies = np.full(len(exposed), latency - late)
    return exposed + late, seen, latencies, imu, true(imu) + 1.0


@pytest.mark.parametrize("late", [-1.0, 0.0, 0.05, 0.49, 20.0])
def test_the_offset_and_the_age_are_found(late):
    found = recorded_offset(*swum(1, late, latency=0.6))
    assert found.estimate.sure
    assert found.estimate.offset == pytest.approx(-late, abs=0.003)
    assert found.age == pytest.approx(0.6, abs=0.003)
    assert len(found.blocks) >= 6


def test_errors_are_as_large_as_the_standard_deviation_says():
    found = [recorded_offset(*swum(seed, 0.2)).estimate for seed in range(30)]
    ratios = np.array([(e.offset + 0.2) / e.std for e in found])
    assert 0.3 < np.sqrt(np.mean(ratios**2)) < 1.6


def test_a_fish_at_rest_is_not_sure():
    assert not recorded_offset(*swum(1, 0.1, still=True)).estimate.sure


def test_sensors_that_do_not_overlap_are_refused():
    camera, seen, latencies, imu, yaw = swum(1, 0.0)
    with pytest.raises(ValueError, match="do not overlap"):
        recorded_offset(camera, seen, latencies, imu + 500.0, yaw)
    with pytest.raises(ValueError, match="0 camera poses"):
        recorded_offset(camera[:0], seen[:0], latencies[:0], imu, yaw)


@pytest.mark.parametrize("between", [0.0, 0.01])
def test_pooled_offsets_say_how_much_the_recordings_differ(between):
    rng, stds, errors, found = np.random.default_rng(5), np.linspace(0.002, 0.006, 12), [], []
    for _ in range(200):
        own = -0.5 + rng.normal(0.0, between, 12) + rng.normal(0.0, stds)
        mean = pooled([ClockEstimate(o, s, True) for o, s in zip(own, stds, strict=True)])
        errors.append((mean.offset + 0.5) / mean.std)
        found.append(mean.between)
    assert 0.85 < np.std(errors) < 1.2
    assert np.mean(found) == pytest.approx(between, abs=0.0015)


def test_one_recording_stands_for_itself():
    assert pooled([ClockEstimate(-0.3, 0.004, True)]) == pytest.approx((-0.3, 0.004, 0.0))
