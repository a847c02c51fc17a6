# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""When frames are due and what was the state then."""

from math import pi

import numpy as np
import pytest

from fish_sim.camera.model import FrameClock, History


def test_history_interpolates_linearly_and_holds_the_ends() -> None:
    history = History()
    history.add(1.0, np.array([0.0, 10.0]))
    history.add(1.1, np.array([1.0, 20.0]))
    np.testing.assert_allclose(history.at(1.025), [0.25, 12.5])
    np.testing.assert_allclose(history.at(0.0), [0.0, 10.0])
    np.testing.assert_allclose(history.at(9.0), [1.0, 20.0])


def test_empty_history_has_no_value() -> None:
    assert History().at(0.0) is None


def test_angles_are_interpolated_the_short_way_round() -> None:
    history = History(angles=(0,))
    history.add(0.0, np.array([pi - 0.1]))
    history.add(1.0, np.array([-pi + 0.1]))
    np.testing.assert_allclose(history.at(0.5), [pi])


def test_a_reset_simulation_forgets_the_past() -> None:
    history = History()
    history.add(50.0, np.array([7.0]))
    history.add(0.0, np.array([1.0]))
    np.testing.assert_allclose(history.at(50.0), [1.0])


def test_old_samples_are_dropped() -> None:
    history = History(span=0.5)
    for k in range(100):
        history.add(0.1 * k, np.array([float(k)]))
    np.testing.assert_allclose(history.at(0.0), [94.0])


def test_frames_come_at_multiples_of_the_period() -> None:
    clock = FrameClock(30.0)
    due = [t for t in (clock.due(0.01 * k) for k in range(100)) if t is not None]
    np.testing.assert_allclose(due, np.arange(30) / 30.0)
    assert clock.skipped == 0


def test_a_late_call_takes_the_newest_frame_and_counts_the_others() -> None:
    clock = FrameClock(10.0)
    assert clock.due(1.0) == pytest.approx(1.0)
    assert clock.due(1.57) == pytest.approx(1.5)
    assert clock.skipped == 4


@pytest.mark.parametrize("time", [0.0, 300.0])
def test_the_clock_follows_a_jump(time: float) -> None:
    clock = FrameClock(10.0)
    clock.due(100.0)
    assert clock.due(time) == pytest.approx(time)
    assert clock.due(time + 0.1) == pytest.approx(time + 0.1)
    assert clock.skipped == 0
