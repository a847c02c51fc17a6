# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Counts and judgements for the diagnostics."""

import numpy as np
import pytest

from fish_vision.choice import Reason
from fish_vision.detections import SPACINGS, Statistics
from fish_vision.pose import HeadPose
from fish_vision.tracker import Detection, Lost


def detection(spacing: float, whole_image: bool = False) -> Detection:
    return Detection(
        0.0, HeadPose(0.0, 0.0, 0.0, np.eye(3)), None, spacing, (0, 0, 1, 1), whole_image
    )


def test_results_and_refusals_are_counted_by_kind() -> None:
    statistics = Statistics()
    assert statistics.values() == {"tracked": "0", "from_whole_image": "0"}
    statistics.add(detection(1.0, whole_image=True), 0.004, 0.06)
    statistics.add(Lost(0.0, Reason.JUMP), 0.006, 0.06)
    statistics.refuse("bad image", "JPEG cut off")
    values = statistics.values()
    assert statistics.images == 2
    assert values["tracked"] == values["from_whole_image"] == "1"
    assert values["refused: bad image"] == "1"
    assert statistics.last_error == "JPEG cut off"
    assert statistics.last_reason == Reason.JUMP.value
    assert values[f"lost: {Reason.JUMP.value}"] == "1"
    assert float(values["processing_ms_p50"]) == pytest.approx(5.0)
    assert float(values["stamp_to_pose_ms_p99"]) == pytest.approx(60.0)


@pytest.mark.parametrize(
    ("spacing", "wrong"), [(1.0, False), (1.014, False), (1.016, True), (0.984, True)]
)
def test_a_wrong_marker_spacing_shows_after_enough_poses(spacing: float, wrong: bool) -> None:
    statistics = Statistics()
    for _ in range(SPACINGS - 1):
        statistics.add(detection(spacing), 0.0, 0.0)
    assert statistics.spacing_error() is None
    statistics.add(detection(spacing), 0.0, 0.0)
    assert statistics.spacing_error() == (pytest.approx(spacing - 1.0) if wrong else None)


def test_images_refused_for_one_scale_say_so() -> None:
    statistics = Statistics()
    for _ in range(SPACINGS):
        statistics.add(Lost(0.0, Reason.NO_PAIR, 0.05), 0.0, 0.0)
    assert statistics.refused_spacing() == pytest.approx(0.05)
    statistics.add(detection(1.0), 0.0, 0.0)
    assert statistics.refused_spacing() is None


def test_images_refused_for_many_spacings_show_no_scale() -> None:
    statistics = Statistics()
    for k in range(SPACINGS):
        statistics.add(Lost(0.0, Reason.NO_PAIR, 0.1 if k % 2 else -0.1), 0.0, 0.0)
    assert statistics.refused_spacing() is None
