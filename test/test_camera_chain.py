# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Rendered image -> JPEG -> tracker: accuracy over the whole pool, detection under glare, matching files."""

from dataclasses import replace
from math import pi, sin
from pathlib import Path

import numpy as np
import pytest

from fish_sim.camera import CameraConfig, FishPose, PoolRenderer
from fish_vision.calibration import Calibration, Lens, read_lens
from fish_vision.config import TrackerConfig
from fish_vision.picture import from_compressed
from fish_vision.pose import wrap
from fish_vision.tracker import Detection, Lost, Tracker

CAMERA, TRACKER = CameraConfig(), TrackerConfig()
LENS_FILE = Path(__file__).parents[1] / "src" / "fish_vision" / "config" / "simulated_camera.yaml"


@pytest.fixture(scope="module")
def renderer() -> PoolRenderer:
    return PoolRenderer(CAMERA.model(), CAMERA.shape(), CAMERA.look())


@pytest.fixture(scope="module")
def calibration() -> Calibration:
    model = CAMERA.model()
    lens = Lens.from_camera_info(
        *model.size, "plumb_bob", model.K.ravel().tolist(), model.D.tolist()
    )
    return Calibration(lens, TRACKER.mount())


def errors(found: Detection, pose: FishPose) -> np.ndarray:
    """x, y (m), heading (rad)."""
    head = found.head
    return np.array([head.x - pose.x, head.y - pose.y, wrap(head.heading - pose.heading)])


def anywhere(count: int, seed: int) -> list[FishPose]:
    """Poses over the whole pool, up to a head's length from the walls."""
    random = np.random.default_rng(seed)
    return [
        FishPose(
            random.uniform(-2.06, 2.06),
            random.uniform(-0.99, 0.99),
            random.uniform(-pi, pi),
            tuple(random.uniform(-0.35, 0.35, 3)),
        )
        for _ in range(count)
    ]


def test_pose_errors_over_the_whole_pool(renderer: PoolRenderer, calibration: Calibration) -> None:
    pairs = []
    for k, pose in enumerate(poses := anywhere(150, seed=11)):
        image = from_compressed(
            renderer.jpeg(renderer.render([pose], 0.37 * k)), CAMERA.model().size
        )
        found = Tracker(TRACKER, calibration).track(image, 0.0)
        if isinstance(found, Detection):
            pairs.append((found, pose))
    assert len(pairs) >= 0.99 * len(poses)
    error = np.array([errors(*pair) for pair in pairs])
    rms = np.sqrt(np.mean(error**2, axis=0))
    assert np.hypot(rms[0], rms[1]) < 1e-3
    assert rms[2] < 0.008
    bends = np.array([np.subtract(f.tail, p.tail) for f, p in pairs if f.tail is not None])
    assert len(bends) > 0.9 * len(pairs)
    assert np.sqrt(np.mean(bends**2, axis=0)).max() < 0.06
    whitened = [
        e @ np.linalg.solve(f.head.covariance, e) / 3
        for e, (f, _) in zip(error, pairs, strict=True)
    ]
    assert 0.2 < np.mean(whitened) < 2.0  # the stated covariance is about the true one


def test_a_swimming_fish_is_followed_through_the_glare(
    renderer: PoolRenderer, calibration: Calibration
) -> None:
    tracker, lost, error = Tracker(TRACKER, calibration), 0, []
    for k in range(
        300
    ):  # 10 s at 0.4 m/s along the lamps' mirror images, the head swinging at 2 Hz
        t = k / 30.0
        pose = FishPose(
            -2.0 + 0.4 * t, 0.55 + 0.08 * sin(t), 0.25 * sin(4 * pi * t), (0.2 * sin(9 * t),) * 3
        )
        image = from_compressed(renderer.jpeg(renderer.render([pose], t)), CAMERA.model().size)
        found = tracker.track(image, t)
        if isinstance(found, Lost):
            lost += 1
        else:
            error.append(errors(found, pose))
    assert lost <= 0.01 * 300
    rms = np.sqrt(np.mean(np.square(error), axis=0))
    assert np.hypot(rms[0], rms[1]) < 2e-3
    assert rms[2] < 0.012


def test_default_files_of_camera_and_tracker_agree() -> None:
    lens, model = read_lens(LENS_FILE), CAMERA.model()
    np.testing.assert_allclose(lens.K, model.K)
    np.testing.assert_allclose(lens.D, model.D)
    assert lens.size == model.size
    assert TRACKER.camera_position == CAMERA.camera_position
    assert TRACKER.camera_tilt == CAMERA.camera_tilt
    shape = CAMERA.shape()
    assert TRACKER.front_marker[0] == shape.front_marker
    assert TRACKER.rear_marker[0] == shape.rear_marker
    assert (TRACKER.marker_diameter, TRACKER.tail_marker_diameter) == (
        shape.marker_diameter,
        shape.tail_marker_diameter,
    )
    assert (TRACKER.hinge_offset, TRACKER.tail_links) == (shape.hinge_offset, shape.links)
    assert TRACKER.link_length == pytest.approx(shape.link_length)


def test_a_tilted_camera_elsewhere_works_as_well() -> None:
    camera = replace(
        CAMERA,
        camera_position=(-0.8, 0.5, 3.6),
        camera_tilt=(0.12, -0.2, 0.6),
        focal=(760.0, 765.0),
    )
    tracker = replace(
        TRACKER, camera_position=camera.camera_position, camera_tilt=camera.camera_tilt
    )
    model = camera.model()
    renderer = PoolRenderer(model, camera.shape(), replace(camera.look(), glare=0.0))
    lens = Lens.from_camera_info(
        *model.size, "plumb_bob", model.K.ravel().tolist(), model.D.tolist()
    )
    calibration = Calibration(lens, tracker.mount())
    found = []
    for pose in (p for p in anywhere(60, seed=3) if abs(p.x) < 1.4):
        result = Tracker(tracker, calibration).track(renderer.render([pose], 0.0), 0.0)
        assert isinstance(result, Detection)
        found.append(errors(result, pose))
    rms = np.sqrt(np.mean(np.square(found), axis=0))
    assert np.hypot(rms[0], rms[1]) < 2e-3
    assert rms[2] < 0.012
