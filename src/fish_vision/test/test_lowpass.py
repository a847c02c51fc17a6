# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Low-pass over poses: delay, gain, and starting again."""

from math import cos, pi, sin, sqrt

import numpy as np
import pytest

from fish_vision.detections import PoseLowPass
from fish_vision.pose import HeadPose
from fish_vision.tracker import Detection

CUTOFF, RATE = 2.0, 200.0  # Hz


def detection(
    t: float, x: float, heading: float = 0.0, tail: tuple[float, ...] | None = None
) -> Detection:
    head = HeadPose(x, -x, (heading + pi) % (2 * pi) - pi, np.eye(3))
    return Detection(t, head, tail, 1.0, (0, 0, 1, 1), False)


def test_off_gives_every_pose_back() -> None:
    found = detection(3.0, 0.1)
    assert PoseLowPass(0.0, 0.5).filtered(found) is found


def test_steady_motion_is_right_at_its_stamp_with_irregular_frames() -> None:
    rng, lowpass, t = np.random.default_rng(0), PoseLowPass(CUTOFF, 0.5), 100.0
    for _ in range(200):
        t += rng.uniform(0.01, 0.08)
        out = lowpass.filtered(detection(t, 0.3 * t, 0.9 * t, (0.2 * t, -0.1 * t)))
        assert out.head.x == pytest.approx(0.3 * out.stamp, abs=1e-9)
        assert sin(out.head.heading - 0.9 * out.stamp) == pytest.approx(0.0, abs=1e-9)
        assert cos(out.head.heading - 0.9 * out.stamp) > 0
        assert out.tail == pytest.approx((0.2 * out.stamp, -0.1 * out.stamp), abs=1e-9)
        assert -pi <= out.head.heading < pi
    assert t - out.stamp == pytest.approx(1 / (2 * pi * CUTOFF), rel=0.5)


def test_delay_is_the_time_constant_less_half_a_frame() -> None:
    lowpass = PoseLowPass(CUTOFF, 0.5)
    times = np.arange(400) / RATE
    delays = [t - lowpass.filtered(detection(t, 0.0)).stamp for t in times]
    assert delays[0] == 0.0
    assert delays[-1] == pytest.approx(1 / (2 * pi * CUTOFF) - 0.5 / RATE, abs=1e-4)


@pytest.mark.parametrize(
    ("frequency", "gain"), [(0.05, 1.0), (CUTOFF, 1 / sqrt(2)), (10 * CUTOFF, 0.1)]
)
def test_gain_is_that_of_a_first_order_filter(frequency: float, gain: float) -> None:
    lowpass, times = PoseLowPass(CUTOFF, 0.5), np.arange(0.0, 20.0 / frequency, 0.02 / frequency)
    times = times if times[1] < 1 / RATE else np.arange(0.0, 3.0 / frequency, 1 / RATE)
    out = [lowpass.filtered(detection(t, sin(2 * pi * frequency * t))).head.x for t in times]
    last = out[len(out) // 2 :]
    assert (max(last) - min(last)) / 2 == pytest.approx(gain, rel=0.05)


def test_it_starts_again_after_a_gap_or_a_clock_that_jumps_back() -> None:
    lowpass = PoseLowPass(CUTOFF, 0.5)
    for k in range(50):
        lowpass.filtered(detection(k / RATE, 0.0))
    after_gap = lowpass.filtered(detection(5.0, 1.0))
    assert (after_gap.stamp, after_gap.head.x) == (5.0, 1.0)
    back = lowpass.filtered(detection(1.0, 2.0))
    assert (back.stamp, back.head.x) == (1.0, 2.0)


def test_a_tail_that_comes_back_waits_until_its_time_is_the_head_s() -> None:
    lowpass = PoseLowPass(CUTOFF, 0.5)
    for k in range(200):
        lowpass.filtered(detection(k / RATE, 0.0))
    out = [lowpass.filtered(detection(k / RATE, 0.0, 0.0, (0.1,))) for k in range(200, 400)]
    assert out[0].tail is None
    assert out[-1].tail == pytest.approx((0.1,))
    waited = next(k for k, found in enumerate(out) if found.tail is not None) / RATE
    assert waited == pytest.approx(3 / (2 * pi * CUTOFF), rel=0.1)
